"""Draws: from a scenario, its population and a seed, a car, a road, a drive and instruments.

The draws are quasi-random: point `seed` of a sequence of Latin hypercubes with a dimension for each
cause. Every 20 seeds from a multiple of 20 on meet each twentieth of each spread once, and every
method, level and scenario meets the same quantiles. A Sobol sequence covers each spread as well,
but in 59 dimensions two causes have a correlation of 0.96 over its first 20 points, and of 0.75
over its first 100: what one does would be put down to the other.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.envs.hidden_draws import entropy
from gripbench.envs.instruments.sensors import Sensor
from gripbench.envs.populations.cars import car_on_road
from gripbench.envs.populations.causes import CAUSES, DIMENSION, SHAPES_OF_TYRES
from gripbench.envs.populations.drives import drawn_scenario
from gripbench.envs.populations.grades import load_grade
from gripbench.envs.populations.population import Population, load_population
from gripbench.envs.scenarios import Scenario
from gripbench.envs.vehicles import CarOnPaper, CarOnRoad, Vehicle, load_vehicle
from gripbench.errors import InputError

DIMENSIONS = 128
"""Of the sequence: more than there are causes, because another number would move all draws."""

BLOCK = 20
"""Seeds that cover every dimension evenly."""

_ENTROPY = 2014
_CANDIDATES = 16  # hypercubes, of which the one with the least correlations is taken


@dataclass(frozen=True)
class Draw:
    """What one seed draws.

    Attributes
    ----------
    scenario
        Road and drive, as a scenario that has no population any more.
    road
        The car that the plant integrates.
    paper
        The car that methods are told of.
    sensors
        Instruments by channel.
    deviations
        Deviation from paper by cause.
    """

    scenario: Scenario
    road: CarOnRoad
    paper: CarOnPaper
    sensors: dict[str, Sensor]
    deviations: dict[str, float]


def quantiles(seed: int) -> npt.NDArray[np.float64]:
    """Return point `seed` of the sequence, shape (DIMENSIONS,), each within 0 and 1."""
    return np.asarray(_hypercube(*entropy(_ENTROPY, seed // BLOCK))[seed % BLOCK])


@lru_cache(maxsize=64)
def _hypercube(*words: int) -> npt.NDArray[np.float64]:
    """Return a block of the sequence, shape (BLOCK, DIMENSIONS), from what names it."""
    from scipy.stats import qmc  # slow to import

    draws = np.random.default_rng(list(words))
    sampler = qmc.LatinHypercube(DIMENSIONS, rng=draws)
    candidates = [sampler.random(BLOCK) for _ in range(_CANDIDATES)]
    return np.asarray(min(candidates, key=_largest_correlation))


def _largest_correlation(points: npt.NDArray[np.float64]) -> float:
    return float(np.abs(np.corrcoef(points.T) - np.eye(points.shape[1])).max())


def deviations_of(population: Population, seed: int) -> dict[str, float]:
    """Return the deviation of every cause of a population at level 1, with its centre left out."""
    drawn = _correlated(population, quantiles(seed))
    return {
        name: spread.deviation(float(drawn[DIMENSION[name]]))
        for name, spread in population.spreads.items()
    }


def _correlated(population: Population, drawn: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return quantiles whose normal scores have the population's correlations."""
    if not population.correlations:
        return drawn
    from scipy.special import ndtr, ndtri

    drawn = drawn.copy()
    named = sorted({DIMENSION[name] for item in population.correlations for name in item.causes})
    matrix = population.correlation_matrix()[np.ix_(named, named)]
    drawn[named] = ndtr(np.linalg.cholesky(matrix) @ ndtri(drawn[named]))
    return drawn


def scaled(
    population: Population, deviations: Mapping[str, float], level: float
) -> dict[str, float]:
    """Return deviations at a level: the same draw, scaled, around the centre of each cause."""
    found = {}
    for name, spread in population.spreads.items():
        if name == "drive.side":
            found[name] = deviations[name] if level > 0.0 else 0.0  # a sign, no size
        elif name in _NOISE:
            found[name] = level * spread.std
        else:
            found[name] = spread.centre + level * deviations[name]
    return found


_NOISE = ("road.friction_along", "road.grade_along", "road.bank_along")


def draw(
    scenario: Scenario,
    seed: int,
    vehicle: Vehicle | None = None,
    changes: Mapping[str, float] | None = None,
) -> Draw:
    """Return what a seed draws of a scenario's population at the scenario's level.

    Parameters
    ----------
    scenario
        At level 0, or without a population, nothing is drawn.
    seed
        Seed of the run.
    vehicle
        The vehicle on paper; the scenario's own unless one is given.
    changes
        Deviations by cause that take the place of those drawn, whatever the level.

    Raises
    ------
    InputError
        If a cause is unknown, or what is drawn is no scenario.
    """
    paper = CarOnPaper((vehicle or load_vehicle(scenario.vehicle)).values())
    for name in changes or {}:
        if name not in CAUSES or name == SHAPES_OF_TYRES:
            from gripbench.errors import unknown

            raise unknown("cause", name, CAUSES)
    if not scenario.population or (scenario.level == 0 and not changes):
        return Draw(scenario, CarOnRoad(dict(paper)), paper, scenario.all_sensors(), {})
    population = load_population(scenario.population)
    level = float(scenario.level)
    found = scaled(population, deviations_of(population, seed), level) if level else {}
    found |= changes or {}
    tyre = ""
    if population.shape is not None and level:
        tyre = population.shape.shape(float(quantiles(seed)[DIMENSION[SHAPES_OF_TYRES]]))

    def d(name: str) -> float:
        return found.get(name, 0.0)

    limit, usual = (population.slip_limit, population.usual_friction) if level else (0.0, 0.0)
    try:
        driven = drawn_scenario(scenario, d, tyre, limit, usual)
    except ValueError as error:
        said = " ".join(str(error).split())
        raise InputError(
            f"{scenario.name}: seed {seed} draws what cannot be driven: {said}"
        ) from None
    road = car_on_road(paper, found, population.effects)
    if level:
        paper = CarOnPaper(
            {
                **paper,
                "friction_prior": population.friction_prior.mean,
                "friction_prior_std": population.friction_prior.std,
            }
        )
    return Draw(driven, road, paper, instruments(scenario, population, d), found)


def paper_of(scenario: Scenario, vehicle: Vehicle | None = None) -> CarOnPaper:
    """Return the car that methods are told of in a scenario, the same for every seed."""
    paper = CarOnPaper((vehicle or load_vehicle(scenario.vehicle)).values())
    if scenario.population and scenario.level:
        prior = load_population(scenario.population).friction_prior
        paper["friction_prior"], paper["friction_prior_std"] = prior.mean, prior.std
    return paper


def drawn_from(scenario: Scenario) -> dict[str, Any]:
    """Return all that files say of the population and the instruments of a scenario's level."""
    population = load_population(scenario.population)
    sensors = graded_sensors(scenario, population)
    return {
        "population": population.model_dump(mode="json"),
        "instruments": {name: sensor.model_dump() for name, sensor in sensors.items()},
    }


def sensors_at(scenario: Scenario) -> dict[str, Sensor]:
    """Return the instruments of a scenario, those of its level's grade where it has a level."""
    if not scenario.level:
        return scenario.all_sensors()
    return graded_sensors(scenario, load_population(scenario.population))


def graded_sensors(scenario: Scenario, population: Population) -> dict[str, Sensor]:
    """Return the instruments of a scenario's level, before a car's own errors come on top."""
    from gripbench.envs.worlds import known_worlds

    grade = load_grade(population.instruments.grade(scenario.level))
    if grade is None:
        return scenario.all_sensors()
    names = known_worlds()[scenario.world].truth_type.names or ()
    return {
        channel: _disturbed(_in_world(sensor, channel, names), scenario.sensors.get(channel))
        for channel, sensor in grade.sensors.items()
        if (sensor.source or _source(channel, names)) in names
    }


def _disturbed(sensor: Sensor, own: Sensor | None) -> Sensor:
    """Return an instrument with the disturbance that the scenario itself names for its channel."""
    if own is None:
        return sensor
    return sensor.model_copy(
        update={
            "bias": sensor.bias + own.bias,
            "bias_std": math.hypot(sensor.bias_std, own.bias_std),
            "noise_std": math.hypot(sensor.noise_std, own.noise_std),
            "noise_hold": own.noise_hold,
            "lowpass": own.lowpass,
            "scale": sensor.scale * own.scale,
        }
    )


def _source(channel: str, names: tuple[str, ...]) -> str:
    """Return the truth behind a channel: of a plant that drives straight, GPS measures v_x."""
    return "speed_x" if channel == "speed_gps" and channel not in names else channel


def _in_world(sensor: Sensor, channel: str, names: tuple[str, ...]) -> Sensor:
    """Return a sensor without what a plant of fewer dimensions does not have."""
    changes: dict[str, Any] = {}
    if not sensor.source and _source(channel, names) != channel:
        changes["source"] = _source(channel, names)
    if sensor.cross and sensor.cross not in names:
        changes |= {"cross": "", "misalignment": 0.0, "misalignment_std": 0.0}
    if "yaw_rate" not in names:
        changes |= {"lever_x": 0.0, "lever_y": 0.0}
    return sensor.model_copy(update=changes) if changes else sensor


def instruments(scenario: Scenario, population: Population, d: Any) -> dict[str, Sensor]:
    """Return the instruments of one car: those of its grade, with what the car does to them."""
    found = {}
    for channel, sensor in graded_sensors(scenario, population).items():
        changes: dict[str, float] = {}
        if channel == "steer_angle":
            # The wheels' angle is worked out from the steering wheel's by the ratio on paper.
            changes["scale"] = sensor.scale * (1.0 + d("car.steering_ratio"))
            changes["bias"] = sensor.bias + d("car.steering_offset")
        elif channel.startswith("torque_"):
            changes["scale"] = sensor.scale * (1.0 + d("car.torque_gain"))
            changes["negative_scale"] = sensor.negative_scale * (1.0 + d("car.brake_gain"))
        found[channel] = sensor.model_copy(update=changes) if changes else sensor
    return found
