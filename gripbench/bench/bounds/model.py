"""A scenario and a seed in; what is unknown of that run, linearised along it, out.

Unknown are the plant's states, what the driver does, the road's variation along the way and every
cause of the population that moves the car or the road. The driver's actions are held as they were
recorded: were they worked out again for each cause, an estimator would be granted the driver's law,
and with it the sideslip that this driver feels, and the friction by which this driver chooses the
speed. What the driver does is known from instruments alone: a random walk whose steps have, within
a second, the covariance of those of this very drive.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.bounds.recursion import Motion, discretise
from gripbench.envs.instruments.sensors import Sensor
from gripbench.envs.plants.longitudinal.scenario import PAPER_SOLVER
from gripbench.envs.plants.longitudinal.trajectory import LongitudinalTrajectory
from gripbench.envs.plants.planar.trajectory import PlanarTrajectory
from gripbench.envs.plants.trajectory import ROAD, Floats, Shift, Trajectory
from gripbench.envs.populations.cars import car_on_road
from gripbench.envs.populations.causes import PROCESSES
from gripbench.envs.populations.draws import Draw, draw
from gripbench.envs.populations.population import Population, load_population
from gripbench.envs.scenarios import Scenario
from gripbench.envs.vehicles import CarOnRoad
from gripbench.errors import InputError

STEP = 0.01
"""Time between the samples of the recursion [s]: that of production instruments."""

SHARE = 1e-5
"""Half width of central differences over the size of what is moved."""

_DRIVEN = 1.0  # window over which the driver's steps are averaged [s]
_PROCESSES = ("friction_along", "grade", "bank")
_TRAJECTORIES: dict[str, type[Any]] = {
    "longitudinal": LongitudinalTrajectory,
    "planar": PlanarTrajectory,
}


@dataclass(frozen=True)
class Model:
    """One run, linearised: what is unknown, how it moves and what the truth shows of it.

    Attributes
    ----------
    time
        Samples [s], shape (n,).
    names
        What is unknown: states, the driver's inputs, the road's variation, causes over their
        standard deviation.
    start
        Its covariance at the start, shape (size, size).
    motion
        How it moves.
    truth
        Signals of the truth, shape (n,) each.
    slopes
        Slope of each of those signals to what is unknown, shape (n, size) each.
    yaw_acceleration
        Rate of the yaw rate and its slopes, where the plant turns: shapes (n,) and (n, size).
    sensors
        Instruments of the car that was drawn.
    deviations
        Standard deviation of the causes of instruments, by name.
    sample_time
        Of the recording [s].
    """

    time: Floats
    names: tuple[str, ...]
    start: Floats
    motion: Motion
    truth: dict[str, Floats]
    slopes: dict[str, Floats]
    yaw_acceleration: tuple[Floats, Floats] | None
    sensors: dict[str, Sensor]
    deviations: dict[str, float]
    sample_time: float


def reason_for_none(scenario: Scenario) -> str:
    """Return why there is no bound for a scenario; empty: there is one."""
    if scenario.world not in _TRAJECTORIES:
        known = ", ".join(sorted(_TRAJECTORIES))
        if scenario.name.startswith("recording:"):
            return "a recording of a real vehicle: the plant that made it is not known"
        return f"of the world '{scenario.world}' no slopes are known (known: {known})"
    if scenario.integrator == PAPER_SOLVER and not scenario.level:
        return "the paper's solver makes errors of its own, which no noise describes"
    if scenario.faults:
        return "faults of instruments are not modelled"
    return ""


def linearise(
    scenario: Scenario, seed: int, signals: tuple[str, ...], step: float = STEP,
    share: float = SHARE,
) -> Model:  # fmt: skip
    """Return a run of a scenario, linearised.

    Parameters
    ----------
    scenario
        At any level; see `reason_for_none`.
    seed
        Seed of the run.
    signals
        Signals of the truth whose slopes are needed.
    step
        Time between samples [s], rounded to a multiple of the scenario's.
    share
        Half width of central differences over the size of what is moved.

    Raises
    ------
    InputError
        If there is no bound for the scenario, or the run is over at its first samples.
    """
    reason = reason_for_none(scenario)
    if reason:
        raise InputError(f"{scenario.name}: no bound: {reason}")
    drawn = draw(scenario, seed)
    run = _TRAJECTORIES[scenario.world](drawn.scenario, drawn.road, seed, step)
    if len(run.time) < 2:
        raise InputError(f"{scenario.name}: seed {seed} ends before its second sample")
    step = float(run.time[1] - run.time[0])
    population = load_population(scenario.population) if scenario.level else None
    spreads = _spreads(population, scenario.level)
    columns: dict[str, Floats] = {}
    for index, name in enumerate(run.states):
        columns[name] = run.state_slope(index, share)
    for index, name in enumerate(run.given):
        columns[f"driver.{name}"] = run.input_slope(index, share)
    processes = _processes(drawn.scenario)
    road = {name: run.road_slope(name, share) for name in _roads(processes, spreads)}
    for name in processes:
        columns[f"along.{name}"] = road[name]
    causes = {}
    for name, deviation in spreads.items():
        slope = _cause_slope(name, deviation, run, drawn, road, share, population)
        if slope is not None and np.any(slope):
            columns[name] = slope * deviation
            causes[name] = deviation
    names, states = tuple(columns), len(run.states)
    stacked = np.stack(list(columns.values()), axis=2)  # n, rates and truth, size
    slopes = np.ascontiguousarray(stacked[:, :states])
    noisy = bool(np.any(run.jumps))
    parts = max(round(step / run.plant_step), 1) if noisy else 1
    transition, noise = discretise(slopes, step, parts, run.jumps)
    nothing = run.evaluate(Shift())
    known = run.truth_type.names or ()
    kept = [name for name in dict.fromkeys(signals) if name in known]
    places = {name: states + known.index(name) for name in kept}
    turns = run.states.index("yaw_rate") if "yaw_rate" in run.states else -1
    return Model(
        time=run.time,
        names=names,
        start=_start(scenario, drawn, run, names, causes, processes, population),
        motion=_motion(run, names, transition, noise, processes, step),
        truth={name: nothing[:, place].copy() for name, place in places.items()},
        slopes={name: np.ascontiguousarray(stacked[:, at]) for name, at in places.items()},
        yaw_acceleration=None if turns < 0 else (nothing[:, turns].copy(), slopes[:, turns].copy()),
        sensors=drawn.sensors,
        deviations={name: spreads[name] for name in _INSTRUMENTS if name in spreads},
        sample_time=scenario.sample_time,
    )


_INSTRUMENTS = ("car.steering_ratio", "car.steering_offset", "car.torque_gain", "car.brake_gain")


def _spreads(population: Population | None, level: int) -> dict[str, float]:
    """Return the standard deviation of every cause of a level that moves car or road."""
    if population is None:
        return {}
    return {
        name: level * spread.moments[1]
        for name, spread in population.spreads.items()
        if name.startswith(("car.", "tyre."))
        or (name.removeprefix("road.") in ROAD and name not in PROCESSES)
    }


def _processes(scenario: Any) -> dict[str, tuple[float, float]]:
    """Return standard deviation and correlation length [m] of what varies along the road."""
    road = getattr(scenario, "road", scenario)
    found = {}
    for name, key in zip(_PROCESSES, ("mu_std", "grade_std", "bank_std"), strict=True):
        deviation = float(getattr(road, key, 0.0))
        if deviation > 0.0:
            found[name] = (deviation, float(road.correlation_length))
    return found


def _roads(processes: dict[str, Any], spreads: dict[str, float]) -> list[str]:
    named = [name.removeprefix("road.") for name in spreads if name.startswith("road.")]
    return list(dict.fromkeys((*processes, *named)))


def _cause_slope(
    name: str, deviation: float, run: Trajectory, drawn: Draw, road: dict[str, Floats],
    share: float, population: Population | None,
) -> Floats | None:  # fmt: skip
    if name.startswith("road."):
        return road[name.removeprefix("road.")]
    if name in _INSTRUMENTS or deviation == 0.0 or population is None:
        return None
    size = 100.0 * share * deviation
    ahead, behind = (_car(drawn, population, {name: side * size}) for side in (1.0, -1.0))
    return run.slope(Shift(car=ahead), Shift(car=behind), size)


def _car(drawn: Draw, population: Population, more: dict[str, float]) -> CarOnRoad:
    """Return the car with more deviations than it was drawn with."""
    found = dict(drawn.deviations)
    for name, size in more.items():
        found[name] = found.get(name, 0.0) + size
    return car_on_road(drawn.paper, found, population.effects)


def _start(
    scenario: Scenario, drawn: Draw, run: Trajectory, names: tuple[str, ...],
    causes: dict[str, float], processes: dict[str, tuple[float, float]],
    population: Population | None,
) -> Floats:  # fmt: skip
    """Return the covariance at the start: the causes' prior, and the speed of which none is told.

    The wheels roll with the car at the start; where there is a heading, it is any.
    """
    size = len(names)
    prior = np.zeros((size, size))
    for first in causes:
        for second in causes:
            prior[names.index(first), names.index(second)] = _correlation(population, first, second)
    for name, (deviation, _) in processes.items():
        at = names.index(f"along.{name}")
        prior[at, at] = deviation**2
    to_start = np.eye(size)
    begun = run.start()
    speed = float(begun[0])
    for index, name in enumerate(run.states):
        if index and name.startswith("wheel_speed_"):
            to_start[index, 0] = begun[index] / max(speed, 1e-9)
    for name, deviation in causes.items():
        if name.startswith("road.") or population is None:
            continue
        width = 1e-3 * deviation
        ahead, behind = (
            run.start(_car(drawn, population, {name: side * width})) for side in (1.0, -1.0)
        )
        to_start[: len(begun), names.index(name)] = (ahead - behind) / 2e-3
    prior[0, 0] = _speed_spread(population, scenario.level, speed) ** 2
    if "yaw" in run.states:
        at = run.states.index("yaw")
        prior[at, at] = math.pi**2 / 3.0
    return to_start @ prior @ to_start.T


def _speed_spread(population: Population | None, level: int, speed: float) -> float:
    if population is None:
        return 0.0
    found = population.drive
    of_start = found["initial_speed"].moments[1] if "initial_speed" in found else 0.0
    relative = found["speed"].moments[1] if "speed" in found else 0.0
    return level * math.hypot(of_start, relative * speed)


def _correlation(population: Population | None, first: str, second: str) -> float:
    if first == second:
        return 1.0
    pairs = {item.causes: item.value for item in (population.correlations if population else ())}
    return float(pairs.get((first, second), pairs.get((second, first), 0.0)))


def _motion(
    run: Trajectory, names: tuple[str, ...], transition: Floats, noise: Floats,
    processes: dict[str, tuple[float, float]], step: float,
) -> Motion:  # fmt: skip
    n, size = len(run.time), len(names)
    decay, spread = np.ones((n - 1, size)), np.zeros((n - 1, size))
    for name, (deviation, length) in processes.items():
        at = names.index(f"along.{name}")
        decay[:, at] = np.exp(-np.abs(run.state[:-1, 0]) * step / length)
        spread[:, at] = deviation**2 * (1.0 - decay[:, at] ** 2)
    return Motion(transition, noise, decay, spread, _driven(run.inputs, step))


def _driven(inputs: Floats, step: float) -> npt.NDArray[np.float64]:
    """Return the covariance of the driver's steps, averaged over a second around each."""
    from scipy.ndimage import uniform_filter1d  # slow to import

    steps = np.diff(inputs, axis=0)
    squares = steps[:, :, None] * steps[:, None, :]
    window = max(round(_DRIVEN / step), 1)
    return np.asarray(uniform_filter1d(squares, window, axis=0, mode="constant"))
