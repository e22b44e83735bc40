"""A longitudinal scenario's TOML tables in, checked; its friction and grade along the road out."""

from __future__ import annotations

from itertools import pairwise
from typing import Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator, model_validator

from gripbench.configuration import Configuration
from gripbench.envs.drivers.profiles import Segment, check_range
from gripbench.envs.roads.road import SPACING, smooth_noise
from gripbench.envs.scenarios import Scenario

PAPER_SOLVER = "paper"

FULL_TORQUE = 5000.0
"""Torque on an axle at most, either way [N m]."""

_LONGEST_ROAD = 2000.0  # of a rough road [m]


class TorqueDriver(Configuration):
    """Torque [N m] on each axle over time; the rear axle follows the front unless given.

    Attributes
    ----------
    front, rear
        Torque profiles.
    slip_limit
        Slip ratio from which torque is reduced (traction control, anti-lock brakes), gone at twice
        of it; 0: never.
    """

    front: tuple[Segment, ...]
    rear: tuple[Segment, ...] | None = None
    slip_limit: float = Field(default=0.0, ge=0.0, le=0.5)

    @field_validator("front", "rear")
    @classmethod
    def _check_range(cls, torque: tuple[Segment, ...] | None) -> tuple[Segment, ...] | None:
        check_range(torque or (), -FULL_TORQUE, FULL_TORQUE)
        for before, after in pairwise(sorted(torque or (), key=lambda s: s.start)):
            if after.start < before.end:
                raise ValueError(f"pieces overlap at {after.start:g} s")
        return torque


class LongitudinalScenario(Scenario):
    """A scenario of straight driving, wheels lumped to axles.

    Attributes
    ----------
    initial_speed
        Speed at the start [m/s]; the wheels roll without slip.
    road_grade
        Inclination [rad], positive downhill.
    grade_std
        Standard deviation [rad] of smooth noise on it along the road.
    friction
        Friction coefficient over time, both axles.
    mu_std
        Standard deviation of smooth noise on its logarithm along the road.
    correlation_length
        Of the noise [m].
    tyre
        Shape of the tyres' force curve, see `gripbench.envs.tyres.combined`; the Magic Formula is
        the vehicle's own.
    wheel_speed_noise
        Process noise: relative standard deviation of the wheel speeds' jumps after each
        millisecond; 0 in the paper's solver, whose own error takes its place.
    driver
        Torque profiles.
    """

    world: Literal["longitudinal"]
    integrator: Literal["ros3", "rk4", "paper"] = "ros3"
    initial_speed: float = Field(default=1.0, ge=0.0, le=100.0)
    road_grade: float = Field(default=0.0, ge=-0.5, le=0.5)
    grade_std: float = Field(default=0.0, ge=0.0, le=0.2)
    friction: tuple[Segment, ...] = Field(min_length=1)
    mu_std: float = Field(default=0.0, ge=0.0, le=0.5)
    correlation_length: float = Field(default=40.0, ge=1.0)
    tyre: Literal["brush", "dugoff", "magic_formula", "fitted_curve"] = "magic_formula"
    wheel_speed_noise: float = Field(default=0.0, ge=0.0, le=0.1)
    driver: TorqueDriver

    @field_validator("friction")
    @classmethod
    def _check_range(cls, friction: tuple[Segment, ...]) -> tuple[Segment, ...]:
        check_range(friction, 0.01, 2.0)
        return friction

    @model_validator(mode="after")
    def _check_friction(self) -> Self:
        covered = 0.0
        for piece in sorted(self.friction, key=lambda s: s.start):
            if piece.start != covered:
                raise ValueError(f"friction has a gap or an overlap at {piece.start:g} s")
            covered = piece.end
        if covered < self.horizon:
            raise ValueError(f"friction ends at {covered:g} s, before the horizon")
        if self.integrator == PAPER_SOLVER and self.wheel_speed_noise > 0.0:
            raise ValueError("wheel_speed_noise has no meaning with the paper's solver")
        if self.integrator == PAPER_SOLVER and (self.driver.slip_limit or self.rough):
            raise ValueError(
                "mu_std, grade_std and driver.slip_limit need samples: set integrator = 'ros3'"
            )
        return self

    @property
    def rough(self) -> bool:
        """Whether friction or grade change along the road."""
        return self.mu_std > 0.0 or self.grade_std > 0.0

    def lay_road(self, seed: int) -> npt.NDArray[np.float64]:
        """Return friction over that of the profile and grade [rad] on top of `road_grade`.

        Shape (n, 2), every `SPACING` metres; beyond the end the last values hold.
        """
        if not self.rough:
            return np.array([[1.0, 0.0], [1.0, 0.0]])
        points = int(_LONGEST_ROAD / SPACING)
        road = np.empty((points, 2))
        length = self.correlation_length
        road[:, 0] = np.exp(self.mu_std * smooth_noise(length, points, seed, "mu"))
        road[:, 1] = self.grade_std * smooth_noise(length, points, seed, "grade")
        return road
