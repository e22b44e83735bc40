"""Gymnasium ids of the scenarios, registered when Gymnasium or gripbench is imported."""

from __future__ import annotations

import tomllib

import gymnasium

from gripbench.envs.worlds import scenario_files


def register_environments() -> None:
    """Register the versioned id of every scenario that ships and can be stepped."""
    for name, path in scenario_files().items():
        identity = tomllib.loads(path.read_text(encoding="utf-8")).get("environment")
        if identity and identity not in gymnasium.registry:
            gymnasium.register(
                id=identity,
                entry_point="gripbench.envs.environment:VehicleEnvironment",
                vector_entry_point="gripbench.envs.vector_environment:VehicleVectorEnvironment",
                kwargs={"scenario": name},
            )
