"""Scenarios with a driver: a path or open-loop steering, a speed, a road."""

from __future__ import annotations

import math
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator, model_validator

from gripbench.configuration import Configuration
from gripbench.envs.drivers.path_drivers import DRIVER, Driver, Steering, steering_angles
from gripbench.envs.plants.planar.plant import STEP
from gripbench.envs.roads.paths import Path, Turns, lay_path
from gripbench.envs.roads.road import Road
from gripbench.envs.scenarios import Scenario


class SpeedWave(Configuration):
    """A sine on top of the speed that the driver holds."""

    amplitude: float = Field(default=0.0, ge=0.0, description="[m/s]")
    frequency: float = Field(default=0.08, gt=0.0, description="[Hz]")


class DrivenScenario(Scenario):
    """A scenario with a driver; exactly one of `path` and `steering` is given.

    Attributes
    ----------
    speed
        Speed at the start, which the driver holds [m/s].
    speed_wave
        Sine on top of it.
    path
        Path that the driver follows.
    steering
        Open-loop steering.
    driver
        How the driver steers and holds the speed.
    road
        Friction, bank and grade.
    off_road
        The run ends so far beside the path [m].
    """

    integrator: Literal["rk4"] = "rk4"
    speed: float = Field(ge=0.0, le=100.0)
    speed_wave: SpeedWave = SpeedWave()
    path: Path | None = None
    steering: Steering | None = None
    driver: Driver = Driver()
    road: Road
    off_road: float = Field(default=15.0, gt=0.0)

    @field_validator("sample_time")
    @classmethod
    def _check_sample_time(cls, value: float) -> float:
        steps = value / STEP
        if steps < 1.0 - 1e-9 or abs(steps - round(steps)) > 1e-6:
            raise ValueError(f"must be a multiple of the integration step, {STEP:g} s")
        return value

    @model_validator(mode="after")
    def _check_manoeuvre(self) -> Self:
        if (self.path is None) == (self.steering is None):
            raise ValueError("give either 'path' or 'steering'")
        if self.speed_wave.amplitude > self.speed:
            raise ValueError("speed_wave.amplitude is larger than speed")
        if self.road.turn_bank > 0.0 and not isinstance(self.path, Turns):
            raise ValueError("road.turn_bank needs a path of kind 'turns'")
        return self

    def lay_path(self, seed: int) -> npt.NDArray[np.float64]:
        """Return the table of the path, shape (n, 4); no rows for open-loop steering."""
        return np.zeros((0, 4)) if self.path is None else lay_path(self.path, self.speed, seed)

    def plan(self) -> npt.NDArray[np.float64]:
        """Return open-loop steering angle [rad] and speed [m/s] at each sample, shape (n, 2)."""
        time = np.arange(self.steps + 1) * self.sample_time
        planned = np.zeros((self.steps + 1, 2))
        wave = np.sin(2.0 * math.pi * self.speed_wave.frequency * time)
        planned[:, 1] = self.speed + self.speed_wave.amplitude * wave
        if self.steering is not None:
            planned[:, 0] = steering_angles(self.steering, time)
        return planned

    def driver_record(self) -> npt.NDArray[Any]:
        """Return what the compiled loop knows of the driver, one record of `DRIVER`."""
        record = np.zeros(1, DRIVER)
        for name, value in self.driver.model_dump().items():
            record[name] = value
        record["sample_time"] = self.sample_time
        return record

    def longest(self) -> float:
        """Return the distance for which there must be a road [m]."""
        return (self.speed + self.speed_wave.amplitude) * self.horizon + 200.0
