"""The worlds: which plant simulates which scenario, and how a recording is made of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gripbench.configuration import CONFIGS, parse, read_toml
from gripbench.envs.instruments.sensors import SensorSuite
from gripbench.envs.plants.bicycle import BicycleScenario, BicycleSimulation
from gripbench.envs.plants.longitudinal.world import (
    PAPER_SOLVER,
    LongitudinalScenario,
    LongitudinalSimulation,
)
from gripbench.envs.plants.planar.world import PlanarScenario, PlanarSimulation
from gripbench.envs.plants.simulation import Simulation
from gripbench.envs.recordings import Recording
from gripbench.envs.scenarios import Scenario
from gripbench.envs.vehicles import Vehicle, load_vehicle
from gripbench.errors import InputError, nearest, unknown


@dataclass(frozen=True)
class World:
    """A kind of plant: the model of its scenario files and its simulation."""

    scenario: type[Scenario]
    simulation: Callable[..., Simulation]
    truth_type: np.dtype[Any]


WORLDS: dict[str, World] = {
    "longitudinal": World(
        LongitudinalScenario, LongitudinalSimulation, LongitudinalSimulation.truth_type
    ),
    "planar": World(PlanarScenario, PlanarSimulation, PlanarSimulation.truth_type),
    "bicycle": World(BicycleScenario, BicycleSimulation, BicycleSimulation.truth_type),
}
"""Every world, by the name that scenario files use."""


def scenario_files() -> dict[str, Path]:
    """Return the scenario files that ship with gripbench, by scenario name."""
    return {path.stem: path for path in sorted((CONFIGS / "scenarios").glob("*.toml"))}


def load_scenario(name: str) -> Scenario:
    """Return a scenario by the name of a file that ships, or by the path of a TOML file.

    Raises
    ------
    InputError
        If there is no such scenario or its file has a mistake.
    """
    if name.endswith(".toml"):
        path = Path(name)
    else:
        files = scenario_files()
        if name not in files:
            raise unknown("scenario", name, files)
        path = files[name]
    content = read_toml(path)
    world = content.get("world")
    if world not in WORLDS:
        raise InputError(f"{path}: key 'world' is {world!r}: {nearest(str(world), WORLDS)}")
    scenario = parse(WORLDS[world].scenario, content, path)
    if name.endswith(".toml"):
        sample_time = None if scenario.integrator == PAPER_SOLVER else scenario.sample_time
        try:
            SensorSuite(scenario.all_sensors(), WORLDS[world].truth_type, sample_time, 0)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
    return scenario


def simulation_of(scenario: Scenario, vehicle: Vehicle | None = None) -> Simulation:
    """Return the simulation of a scenario, with the scenario's own vehicle unless one is given."""
    return WORLDS[scenario.world].simulation(scenario, vehicle or load_vehicle(scenario.vehicle))


def record(scenario: Scenario, seed: int, vehicle: Vehicle | None = None) -> Recording:
    """Simulate a scenario once and measure it with the scenario's sensors.

    Parameters
    ----------
    scenario
        What to run.
    seed
        Seed of all randomness of the run; the same seed gives the same bytes.
    vehicle
        Vehicle to run; the scenario's own unless one is given.
    """
    vehicle = vehicle or load_vehicle(scenario.vehicle)
    simulation = simulation_of(scenario, vehicle)
    truth = simulation.run(seed)
    suite = SensorSuite(scenario.all_sensors(), simulation.truth_type, simulation.sample_time, seed)
    return Recording(
        scenario=scenario.name,
        seed=seed,
        vehicle=vehicle.values(),
        observations=suite.observe(truth),
        truth=truth,
        score_from=scenario.score_from,
        termination=simulation.termination,
        notes=simulation.notes(),
    )
