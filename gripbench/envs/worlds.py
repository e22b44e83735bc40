"""The worlds: which plant simulates which scenario, and how a recording is made of it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.configuration import CONFIGS, named_file, parse, read_toml
from gripbench.envs.instruments.fault_injection import Faults
from gripbench.envs.instruments.faults import check_present, choose_fault, split_faults
from gripbench.envs.instruments.sensors import Sensor
from gripbench.envs.instruments.suite import SensorSuite
from gripbench.envs.plants.bicycle import BicycleScenario, BicycleSimulation
from gripbench.envs.plants.longitudinal.scenario import PAPER_SOLVER, LongitudinalScenario
from gripbench.envs.plants.longitudinal.world import LongitudinalSimulation
from gripbench.envs.plants.planar.world import PlanarScenario, PlanarSimulation
from gripbench.envs.plants.simulation import Lanes, Simulation
from gripbench.envs.populations.draws import draw
from gripbench.envs.populations.population import (
    check_support,
    load_population,
    population_path,
)
from gripbench.envs.recordings import Recording
from gripbench.envs.scenarios import LEVELS, Scenario
from gripbench.envs.vehicles import Vehicle, load_vehicle
from gripbench.errors import InputError, nearest, one_line
from gripbench.extensions import entry_points, load


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
"""Every world that ships, by the name that scenario files use."""


@cache
def known_worlds() -> dict[str, World]:
    """Return every world by name: those that ship, and those of the group `gripbench.worlds`.

    Raises
    ------
    InputError
        If a package's world cannot be loaded, is none, or has the name of one that ships.
    """
    found = dict(WORLDS)
    for name, point in entry_points("gripbench.worlds").items():
        if name in found:
            raise InputError(f"entry point '{name}' of {point.group}: there is a world '{name}'")
        found[name] = load(point, World)
    return found


def scenario_files() -> dict[str, Path]:
    """Return the scenario files that ship with gripbench, by scenario name."""
    return {path.stem: path for path in sorted((CONFIGS / "scenarios").glob("*.toml"))}


def load_scenario(name: str) -> Scenario:
    """Return a scenario by the name of a file that ships, or by the path of a TOML file.

    `NAME@LEVEL` is the scenario at a level of its population, see `at_level`.

    Raises
    ------
    InputError
        If there is no such scenario or its file has a mistake.
    """
    plain, faults = split_faults(name)
    if faults:
        return with_faults(load_scenario(plain), faults)
    place, level = split_level(name)
    if level or place != name:
        return at_level(load_scenario(place), level)
    path = named_file("scenario", name, scenario_files())
    content = read_toml(path)
    world = content.get("world")
    worlds = known_worlds()
    if not isinstance(world, str) or world not in worlds:
        hint = nearest(str(world), worlds)
        raise InputError(f"{path}: key 'world' is {one_line(repr(world), 80)}: {hint}")
    scenario = parse(worlds[world].scenario, content, path)
    if name.endswith(".toml"):
        sample_time = None if scenario.integrator == PAPER_SOLVER else scenario.sample_time
        try:
            SensorSuite(scenario.all_sensors(), known_worlds()[world].truth_type, sample_time, 0)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
    return scenario


def at_level(scenario: Scenario, level: int) -> Scenario:
    """Return a scenario at a level of its population; its name then ends with `@` and the level.

    Raises
    ------
    InputError
        If there is no such level, or the scenario names no population.
    """
    name = re.split("[@+]", scenario.name)[0]
    if level not in LEVELS:
        known = ", ".join(map(str, LEVELS))
        raise InputError(f"{name}: unknown level {level}: known: {known}")
    if level and not scenario.population:
        raise InputError(f"{name}: key 'population' is missing, so there is no level {level}")
    if level:
        population = load_population(scenario.population)
        check_support(
            population,
            load_vehicle(scenario.vehicle).values(),
            population_path(scenario.population),
        )
    full = "+".join((f"{name}@{level}" if level else name, *scenario.faults))
    return scenario.model_copy(update={"name": full, "level": level})


def with_faults(scenario: Scenario, faults: Sequence[str]) -> Scenario:
    """Return a scenario with faults of its instruments; its name then ends with them.

    Parameters
    ----------
    scenario
        At any level; faults that it has already act first.
    faults
        Each `NAME:SEVERITY` or `NAME:SEVERITY:CHANNEL`.

    Raises
    ------
    InputError
        If there is no such fault or severity, or it acts on nothing that the instruments give.
    """
    chosen = [choose_fault(text) for text in faults]
    if scenario.integrator == PAPER_SOLVER and not scenario.level:
        raise InputError(f"{scenario.name}: faults need equally spaced samples, which it has not")
    for one in chosen:
        check_present(one, list(sensors_of(scenario, 0)))
    names = tuple(one.name for one in chosen)
    return scenario.model_copy(
        update={
            "name": "+".join((scenario.name, *names)),
            "faults": (*scenario.faults, *names),
        }
    )


def faults_of(
    scenario: Scenario, observation_type: np.dtype[Any], sample_time: float | None, seed: int
) -> Faults | None:
    """Return the faults of a run; None where the scenario has none."""
    if not scenario.faults:
        return None
    chosen = [choose_fault(text) for text in scenario.faults]
    return Faults(chosen, observation_type, sample_time, scenario.horizon, seed)


def split_level(name: str) -> tuple[str, int]:
    """Split `NAME@LEVEL` into name and level; without `@` the level is 0.

    Raises
    ------
    InputError
        If the level is no whole number.
    """
    place, mark, level = name.rpartition("@")
    if not mark:
        return name, 0
    if not level.isdigit():
        raise InputError(f"scenario {name!r}: what follows '@' must be a level, such as {place}@1")
    return place, int(level)


def simulation_of(scenario: Scenario, vehicle: Vehicle | None = None) -> Simulation:
    """Return the simulation of a scenario, with the scenario's own vehicle unless one is given.

    At a level above 0 every seed that it is reset with draws another car, road and drive.
    """
    if scenario.level:
        return DrawnSimulation(scenario, vehicle)
    return known_worlds()[scenario.world].simulation(
        scenario, vehicle or load_vehicle(scenario.vehicle)
    )


def sensors_of(scenario: Scenario, seed: int) -> dict[str, Sensor]:
    """Return the instruments by channel that a seed draws of a scenario."""
    return draw(scenario, seed).sensors


class DrawnSimulation(Simulation):
    """Runs of a scenario at a level above 0: every seed has a car, a road and a drive of its own.

    Parameters
    ----------
    scenario
        A scenario with a population.
    vehicle
        The vehicle on paper; the scenario's own unless one is given.
    """

    def __init__(self, scenario: Scenario, vehicle: Vehicle | None = None) -> None:
        self._scenario = scenario
        self._vehicle = vehicle
        world = known_worlds()[scenario.world]
        self.truth_type = world.truth_type  # type: ignore[misc]
        self._begin(0)
        self.actions = self._inner.actions  # type: ignore[misc]
        self.sample_time = self._inner.sample_time

    @property
    def termination(self) -> str:  # type: ignore[override]
        """Why the run ended before its horizon; empty while it goes on."""
        return self._inner.termination

    def reset(self, seed: int) -> npt.NDArray[Any]:
        """Draw and start a run; return its first sample."""
        self._begin(seed)
        return self._inner.reset(seed)

    def drive(self) -> npt.NDArray[np.float64]:
        """Return what the driver commands next."""
        return self._inner.drive()

    def advance(self, action: npt.NDArray[np.float64]) -> npt.NDArray[Any]:
        """Hold an action for one sample time; return the sample at its end."""
        return self._inner.advance(action)

    def run(self, seed: int) -> npt.NDArray[Any]:
        """Draw and run to the horizon or termination."""
        self._begin(seed)
        return self._inner.run(seed)

    def notes(self) -> dict[str, float]:
        """Return facts of the run that a score may need, by name."""
        return self._inner.notes()

    def path(self) -> npt.NDArray[np.float64]:
        """Return the path of the run."""
        return self._inner.path()

    @classmethod
    def together(cls, simulations: Sequence[Any]) -> Lanes:
        """Return runs that advance one after the other: no two have the same car."""
        return Lanes(simulations)

    def _begin(self, seed: int) -> None:
        drawn = draw(self._scenario, seed, self._vehicle)
        self._inner = known_worlds()[self._scenario.world].simulation(drawn.scenario, drawn.road)


def record(
    scenario: Scenario,
    seed: int,
    vehicle: Vehicle | None = None,
    changes: Mapping[str, float] | None = None,
) -> Recording:
    """Simulate a scenario once and measure it with the instruments of its level.

    Parameters
    ----------
    scenario
        What to run.
    seed
        Seed of all randomness of the run; the same seed gives the same bytes.
    vehicle
        Vehicle on paper; the scenario's own unless one is given. At level 0 it is also the one
        that is simulated.
    changes
        Deviations from paper by cause that take the place of those drawn.
    """
    drawn = draw(scenario, seed, vehicle, changes)
    simulation = known_worlds()[scenario.world].simulation(drawn.scenario, drawn.road)
    truth = simulation.run(seed)
    suite = SensorSuite(drawn.sensors, simulation.truth_type, simulation.sample_time, seed)
    observations, notes, clean = suite.observe(truth), simulation.notes(), None
    faults = faults_of(scenario, suite.observation_type, simulation.sample_time, seed)
    if faults is not None:
        clean = observations.copy()
        faults.apply(observations)
        notes = notes | dict(
            zip(("fault_begin", "fault_end"), map(float, faults.window), strict=True)
        )
    return Recording(
        scenario=scenario.name,
        seed=seed,
        vehicle=drawn.paper,
        observations=observations,
        truth=truth,
        score_from=scenario.score_from,
        termination=simulation.termination,
        notes=notes,
        clean=clean,
    )
