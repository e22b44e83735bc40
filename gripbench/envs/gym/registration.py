"""Gymnasium ids of the scenarios; `import gripbench` registers them, as Gymnasium's users expect.

This module imports little, because everybody who imports gripbench imports it.
"""

from __future__ import annotations

import re
from pathlib import Path

import gymnasium

_SCENARIOS = Path(__file__).parents[2] / "configs" / "scenarios"
_IDENTITY = re.compile(r'^environment = "(gripbench/[^"]+)"', re.MULTILINE)


def register_environments() -> None:
    """Register the versioned id of every scenario that ships and can be stepped."""
    for path in sorted(_SCENARIOS.glob("*.toml")):
        found = _IDENTITY.search(path.read_text(encoding="utf-8"))
        if found and found.group(1) not in gymnasium.registry:
            gymnasium.register(
                id=found.group(1),
                entry_point="gripbench.envs.gym.environment:VehicleEnvironment",
                vector_entry_point="gripbench.envs.gym.vector_environment:VehicleVectorEnvironment",
                kwargs={"scenario": path.stem},
            )
