"""The Gymnasium environments as data: from an id to its actions, observation, reward and end."""

from __future__ import annotations

from typing import Any

import gymnasium

from gripbench.envs.gym.arguments import OPTIONS
from gripbench.envs.gym.environment import ActionMap, VehicleEnvironment
from gripbench.envs.plants.bicycle import BicycleScenario
from gripbench.envs.plants.driven import DrivenScenario
from gripbench.envs.plants.planar.world import PlanarScenario
from gripbench.envs.scenarios import Scenario
from gripbench.envs.signals import NEW, signal
from gripbench.envs.worlds import known_worlds, load_scenario
from gripbench.errors import unknown

NAMESPACE = "gripbench/"
"""How the ids of all environments begin."""

_REWARD = "minus half of the mean distance to the driver's action: 0 for the driver, -1 at least"

Lines = list[tuple[str, ...]]


def environment_names() -> dict[str, str]:
    """Return the scenario of each environment, by id."""
    return {
        identity: spec.kwargs["scenario"]
        for identity, spec in sorted(gymnasium.registry.items())
        if identity.startswith(NAMESPACE)
    }


def environment_lines() -> tuple[tuple[str, ...], Lines]:
    """Return header and lines of the table of all environments."""
    lines: Lines = []
    for identity, name in environment_names().items():
        item = load_scenario(name)
        lines.append(
            (
                identity,
                item.world,
                f"{item.sample_time:g} s",
                str(item.steps),
                item.sensor_suite,
                ", ".join(ends(item)),
            )
        )
    return ("environment", "world", "sample time", "steps", "sensors", "ends early by"), lines


def action_lines() -> tuple[tuple[str, ...], Lines]:
    """Return header and lines of the table of the actions of each world."""
    lines: Lines = []
    for world, parts in known_worlds().items():
        actions = parts.simulation.actions  # type: ignore[attr-defined]
        for at, (action, scale) in enumerate(
            zip(actions, ActionMap.of(actions).scale, strict=True)
        ):
            allowed = f"{action.low:g} to {action.high:g} {action.unit}"
            size = f"{scale:g} {action.unit}"
            lines.append((world, str(at), action.name, allowed, size, action.description))
    return ("world", "at", "input", "range", "an action of 1", "meaning"), lines


def observation_lines() -> tuple[tuple[str, ...], Lines]:
    """Return header and lines of the table of what each sensor suite lets one observe."""
    found: dict[str, str] = {}
    for name in environment_names().values():
        environment = VehicleEnvironment(name)
        suite = environment.scenario.sensor_suite
        found.setdefault(suite, ", ".join(environment.observation_space.spaces))  # type: ignore[attr-defined]
    return ("sensors", "observation"), sorted(found.items())


def markdown(table: tuple[tuple[str, ...], Lines]) -> str:
    """Return a table of this module as Markdown, as docs/environments.md holds it."""
    header, lines = table
    rows = [header, ("---",) * len(header), *lines]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def ends(scenario: Scenario) -> tuple[str, ...]:
    """Return what may end a run before its horizon, as `info["termination"]` names it."""
    if not isinstance(scenario, DrivenScenario):
        return ("diverged",)
    reasons = ["spin"]
    if isinstance(scenario, PlanarScenario):
        reasons.append("roll_over")
        if scenario.stop_speed > 0.0:
            reasons.append("stop")
    if scenario.path is not None:
        reasons.append("off_road")
    return (*reasons,) if isinstance(scenario, BicycleScenario) else (*reasons, "diverged")


def environment_settings(identity: str) -> dict[str, Any]:
    """Return everything that a user of an environment must know.

    Raises
    ------
    InputError
        If there is no such environment.
    """
    names = environment_names()
    if identity not in names:
        raise unknown("environment", identity, names)
    environment = VehicleEnvironment(names[identity], idealised=True)
    scenario, space = environment.scenario, environment.observation_space
    inputs = zip(environment.simulation.actions, environment.action_map.scale, strict=True)
    channels = {
        name: {
            "unit": signal(name).unit,
            "low": float(box.low),
            "high": float(box.high),
            "on_request": signal(name.removesuffix(NEW)).idealised,
        }
        for name, box in space.spaces.items()  # type: ignore[attr-defined]
    }
    return {
        "environment": identity,
        "scenario": scenario.name,
        "world": scenario.world,
        "sample_time": scenario.sample_time,
        "steps": scenario.steps,
        "actions": [vars(action) | {"scale": float(scale)} for action, scale in inputs],
        "reward": _REWARD,
        "observation": channels,
        "options": OPTIONS if scenario.world != "bicycle" else {"speed": OPTIONS["speed"]},
        "ends": list(ends(scenario)),
    }
