"""Road and drive of one seed: from a scenario and the deviations of causes, the scenario to run."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from gripbench.envs.drivers.path_drivers import (
    SineSteer,
    SineThenSquareSteer,
    Steering,
    StepSteer,
)
from gripbench.envs.drivers.profiles import Segment
from gripbench.envs.plants.bicycle import BicycleScenario
from gripbench.envs.plants.driven import DrivenScenario
from gripbench.envs.plants.longitudinal.scenario import PAPER_SOLVER, LongitudinalScenario
from gripbench.envs.roads.paths import DoubleLaneChange, Path, PublicRoad, Slalom
from gripbench.envs.roads.road import Road
from gripbench.envs.scenarios import Scenario

Deviation = Callable[[str], float]

_GAINS = {
    "preview_time": "drive.preview",
    "slip_use": "drive.slip_use",
    "counter_steer": "drive.counter_steer",
    "yaw_damping": "drive.yaw_damping",
    "reaction": "drive.reaction",
    "speed_gain": "drive.speed_gain",
}

_NEAR_FULL = 1500.0
"""Axle torque [N m] from which a driver adds a `_RESERVE` of what the population says."""

_RESERVE = 0.1

_LEAST_GAP = 1.0
"""Shortest stretch of one friction between two steps [s]."""

SLIPPERIEST, GRIPPIEST = 0.08, 1.1
"""Friction coefficients between which roads lie: wet ice and clean dry asphalt."""


def friction_of(nominal: float, deviation: float) -> float:
    """Return the friction coefficient of a road that deviates from a nominal one.

    The logarithm of the coefficient over its range has log-odds, and those deviate: whatever is
    drawn is a road, and no scenario's own surface says much of the friction of its draws.

    Parameters
    ----------
    nominal
        Friction coefficient of the scenario.
    deviation
        Of the log-odds; 0 gives the nominal value to the last bit.

    Examples
    --------
    >>> [round(friction_of(0.25, deviation), 2) for deviation in (-3.0, 0.0, 3.0)]
    [0.09, 0.25, 0.94]
    """
    if deviation == 0.0 or nominal <= 0.0:
        return nominal
    low, high = _limits(nominal)
    odds = math.exp(_log_odds(nominal) + deviation)
    return low * (high / low) ** (odds / (1.0 + odds))


def friction_slope(friction: float) -> float:
    """Return the slope of a friction's logarithm to the deviation that `friction_of` takes."""
    low, high = _limits(friction)
    return math.log(friction / low) * math.log(high / friction) / math.log(high / low)


def _log_odds(friction: float) -> float:
    low, high = _limits(friction)
    return math.log(math.log(friction / low) / math.log(high / friction))


def _limits(friction: float) -> tuple[float, float]:
    return min(SLIPPERIEST, friction / 1.1), max(GRIPPIEST, 1.1 * friction)


def drawn_scenario(
    scenario: Scenario, d: Deviation, tyre: str, slip_limit: float, usual: float
) -> Scenario:
    """Return a scenario with the road and the drive of one seed.

    Parameters
    ----------
    scenario
        The nominal one.
    d
        Deviation by cause, 0 where it does not deviate.
    tyre
        Shape of the tyres' force curve; empty: the scenario's own.
    slip_limit
        Of a longitudinal car, see `Population.slip_limit`.
    usual
        Friction of the roads of the population, see `Population.usual_friction`.
    """
    changes: dict[str, Any] = {}
    if isinstance(scenario, LongitudinalScenario):
        changes = _straight(scenario, d, slip_limit, _shift(scenario.friction[0].first, usual))
    elif isinstance(scenario, DrivenScenario):
        changes = _driven(scenario, d, _shift(scenario.road.mu, usual))
    if tyre and hasattr(scenario, "tyre"):
        changes["tyre"] = tyre
    # Read anew, so that a draw that the model does not allow is an error and never a run.
    return type(scenario).model_validate(scenario.model_copy(update=changes).model_dump())


def _shift(nominal: float, usual: float) -> float:
    """Return what takes the log-odds of a scenario's friction to those of a usual road."""
    return _log_odds(usual) - _log_odds(nominal) if usual else 0.0


def _straight(
    scenario: LongitudinalScenario, d: Deviation, slip_limit: float, shift: float
) -> dict[str, Any]:
    changes: dict[str, Any] = {
        "initial_speed": max(scenario.initial_speed + d("drive.initial_speed"), 0.0),
        "road_grade": scenario.road_grade + d("road.grade"),
        "grade_std": scenario.grade_std + d("road.grade_along"),
        "mu_std": scenario.mu_std + d("road.friction_along"),
        "friction": _friction(scenario, d, shift),
        "driver": scenario.driver.model_copy(
            update={
                "front": _torque(scenario, scenario.driver.front, d),
                "rear": None
                if scenario.driver.rear is None
                else _torque(scenario, scenario.driver.rear, d),
                "slip_limit": scenario.driver.slip_limit or slip_limit,
            }
        ),
    }
    if scenario.integrator == PAPER_SOLVER and scenario.level > 0:
        changes["integrator"] = "ros3"  # instruments need samples
    return changes


def _friction(scenario: LongitudinalScenario, d: Deviation, shift: float) -> tuple[Segment, ...]:
    pieces = sorted(scenario.friction, key=lambda piece: piece.start)
    starts = [0.0]
    for number, piece in enumerate(pieces[1:], 1):
        moved = piece.start * (1.0 + d(f"road.step_place_{number}"))
        starts.append(_on_sample(scenario, max(moved, starts[-1] + _LEAST_GAP)))
    ends = [*starts[1:], max(pieces[-1].end, starts[-1] + _LEAST_GAP)]
    drawn = []
    for number, (piece, start, end) in enumerate(zip(pieces, starts, ends, strict=True)):
        by = shift + d("road.friction") + (d(f"road.friction_step_{number}") if number else 0.0)
        values = {name: friction_of(getattr(piece, name), by) for name in ("first", "last")}
        values["amplitude"] = piece.amplitude * (values["first"] / piece.first)
        drawn.append(piece.model_copy(update={**values, "start": start, "end": end}))
    return tuple(drawn)


def _torque(
    scenario: LongitudinalScenario, pieces: tuple[Segment, ...], d: Deviation
) -> tuple[Segment, ...]:
    stretch, strength = 1.0 + d("drive.timing"), 1.0 + d("drive.amplitude")
    peak = max(
        (abs(value) for p in pieces for value in (p.first, p.last, p.amplitude)), default=0.0
    )
    if peak * strength > _NEAR_FULL:  # who drives so hard already adds less
        strength = max(1.0 + _RESERVE * d("drive.amplitude"), min(strength, _NEAR_FULL / peak))
    return tuple(
        piece.model_copy(
            update={
                "start": _on_sample(scenario, piece.start * stretch),
                "end": _on_sample(scenario, piece.end * stretch),
                "first": piece.first * strength,
                "last": piece.last * strength,
                "amplitude": piece.amplitude * strength,
                "period": piece.period * stretch,
            }
        )
        for piece in pieces
    )


def _on_sample(scenario: Scenario, time: float) -> float:
    """Return the sample next to a time [s]; one that is a sample already stays to the last bit."""
    place = time / scenario.sample_time
    return time if abs(place - round(place)) < 1e-9 else round(place) * scenario.sample_time


def _driven(scenario: DrivenScenario, d: Deviation, shift: float) -> dict[str, Any]:
    # A driver feels how slippery it is, and the acceleration scales with the friction: by a speed
    # with its root, or at the same speed by wider turns. A speed would otherwise tell the friction.
    # On better grip some drive faster and some do not. The linear bicycle knows no friction.
    ratio = 1.0
    if not isinstance(scenario, BicycleScenario):
        ratio = friction_of(scenario.road.mu, shift + d("road.friction")) / scenario.road.mu
    held = min(max(d("drive.held_speed"), 0.0), 1.0)
    slower = ratio ** (0.5 * (1.0 - held))
    speed = scenario.speed * (1.0 + d("drive.speed")) * slower
    strength, stretch = 1.0 + d("drive.amplitude"), 1.0 + d("drive.timing")
    strength *= min(ratio, 1.0) ** held
    side = -1.0 if d("drive.side") < 0.0 else 1.0
    driver = scenario.driver
    gains = {key: getattr(driver, key) * (1.0 + d(cause)) for key, cause in _GAINS.items()}
    return {
        "speed": speed,
        "speed_wave": scenario.speed_wave.model_copy(
            update={"amplitude": scenario.speed_wave.amplitude * strength * slower}
        ),
        "path": None if scenario.path is None else _path(scenario.path, strength, stretch, side),
        "steering": None
        if scenario.steering is None
        else _steering(scenario.steering, strength, stretch, side),
        "driver": driver.model_copy(
            update={
                **gains,
                "brake_at": driver.brake_at * (1.0 + d("drive.brake_timing")),
                "brake_deceleration": driver.brake_deceleration * (1.0 + d("drive.brake_strength")),
            }
        ),
        "road": _road(scenario.road, d, shift, slower),
    }


def _path(path: Path, strength: float, stretch: float, side: float) -> Path:
    if isinstance(path, DoubleLaneChange):
        return path.model_copy(
            update={"lead_in": path.lead_in * stretch, "offset": path.offset * strength * side}
        )
    if isinstance(path, Slalom):
        return path.model_copy(
            update={
                "lead_in": path.lead_in * stretch,
                "amplitude": path.amplitude * strength * side,
            }
        )
    if isinstance(path, PublicRoad):
        return path.model_copy(
            update={
                "lead_in": path.lead_in * stretch,
                "radius_low": path.radius_low / strength,
                "radius_high": path.radius_high / strength,
            }
        )
    return path.model_copy(
        update={
            "segments": [
                segment.model_copy(
                    update={
                        "length": segment.length * stretch,
                        "radius": segment.radius / strength,
                        "angle": segment.angle * side,
                        "transition": segment.transition / strength,
                    }
                )
                for segment in path.segments
            ]
        }
    )


def _steering(steering: Steering, strength: float, stretch: float, side: float) -> Steering:
    changes: dict[str, Any] = {"amplitude": steering.amplitude * strength * side}
    if isinstance(steering, SineThenSquareSteer):
        changes |= {
            "change": steering.change * stretch,
            "sine_frequency": steering.sine_frequency / stretch,
            "square_frequency": steering.square_frequency / stretch,
        }
    elif isinstance(steering, StepSteer):
        changes["start"] = steering.start * stretch
    else:
        changes |= {
            "start": steering.start * stretch,
            "frequency": steering.frequency / stretch,
        }
        if isinstance(steering, SineSteer):
            changes["end"] = steering.end * stretch
    return steering.model_copy(update=changes)


def _road(road: Road, d: Deviation, shift: float, slower: float) -> Road:
    by = shift + d("road.friction")
    surfaces = tuple(
        surface.model_copy(
            update={
                "mu": friction_of(surface.mu, by + d(f"road.friction_step_{number}")),
                "start": surface.start * (1.0 + d(f"road.step_place_{number}")) * slower,
            }
        )
        for number, surface in enumerate(road.surfaces, 1)
    )
    return road.model_copy(
        update={
            "mu": friction_of(road.mu, by),
            "mu_right": friction_of(road.mu_right, by + d("road.friction_right")),
            "mu_after": friction_of(road.mu_after, by + d("road.friction_step_1")),
            "mu_jump_at": road.mu_jump_at * (1.0 + d("road.step_place_1")) * slower,
            "mu_std": road.mu_std + d("road.friction_along"),
            "bank": road.bank + d("road.bank"),
            "grade": road.grade + d("road.grade"),
            "bank_std": road.bank_std + d("road.bank_along"),
            "grade_std": road.grade_std + d("road.grade_along"),
            "surfaces": surfaces,
        }
    )
