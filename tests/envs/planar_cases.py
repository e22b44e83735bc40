"""Planar runs for the tests: scenarios that ship, with single keys changed."""

from typing import Any

import numpy as np

from gripbench.configuration import CONFIGS, parse, read_toml
from gripbench.envs.plants.planar.world import PlanarScenario, PlanarSimulation
from gripbench.envs.vehicles import Vehicle, load_vehicle

SCENARIOS = sorted(
    path.stem
    for path in (CONFIGS / "scenarios").glob("*.toml")
    if read_toml(path)["world"] == "planar"
)

OPEN_LOOP = {
    "name": "open_loop",
    "environment": "gripbench/OpenLoop-v0",
    "description": "Open-loop steering on a level road",
    "world": "planar",
    "vehicle": "dakhlallah2008",
    "horizon": 5.0,
    "sample_time": 0.001,
    "sensor_suite": "dakhlallah2008",
    "speed": 20.0,
    "steering": {"kind": "step_steer", "amplitude": 0.0},
    "road": {"mu": 0.8},
}


def scenario_of(base: str | dict[str, Any], **changes: Any) -> PlanarScenario:
    """Return a scenario by name or content; tables in `changes` are merged into its own."""
    content = dict(base) if isinstance(base, dict) else read_toml(_file(base))
    for key, value in changes.items():
        merge = isinstance(value, dict) and isinstance(content.get(key), dict)
        content[key] = content[key] | value if merge else value
    return parse(PlanarScenario, content, "test.toml")


def _file(name: str) -> Any:
    return CONFIGS / "scenarios" / f"{name}.toml"


def simulation_of(
    base: str | dict[str, Any], vehicle: Vehicle | None = None, **changes: Any
) -> PlanarSimulation:
    scenario = scenario_of(base, **changes)
    return PlanarSimulation(scenario, vehicle or load_vehicle(scenario.vehicle))


def vehicle_with(name: str, **values: float) -> Vehicle:
    """Return a vehicle that ships with single parameters changed."""
    vehicle = load_vehicle(name)
    given = vehicle.model_dump()
    for key, value in values.items():
        given["parameters"][key] = {"value": value, "source": "test"}
    return Vehicle.model_validate(given)


def held(simulation: PlanarSimulation, action: list[float], samples: int) -> np.ndarray:
    """Advance a simulation under one action; return the samples."""
    return np.concatenate([simulation.advance(np.array(action)) for _ in range(samples)])
