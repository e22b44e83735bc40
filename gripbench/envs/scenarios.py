"""Scenarios: one TOML file each, checked against the model of its world."""

from __future__ import annotations

from typing import Self

from pydantic import Field, field_validator, model_validator

from gripbench.configuration import Configuration
from gripbench.envs.instruments.sensors import Sensor, load_sensor_suite
from gripbench.envs.signals import signal
from gripbench.errors import GripbenchError

LEVELS = (0, 1, 2)
"""Levels of spread: none, as in production, wide."""

_MOST_SAMPLES = 5e7  # of one run; a longitudinal one takes 144 bytes a sample


class Scenario(Configuration):
    """What the scenarios of every world have in common.

    Attributes
    ----------
    name
        Unique name; the file has the same.
    environment
        Versioned id of its Gymnasium environment, such as `gripbench/ConstantMu-v0`; the version
        rises when results would change. Empty: none, because its integrator chooses the samples.
    description
        One sentence.
    world
        Which plant simulates it, see `gripbench.envs.worlds`.
    vehicle
        Name or path of the vehicle's file.
    horizon
        Duration [s].
    sample_time
        Time [s] from one sample to the next, also the period of the driver's commands.
    integrator
        Named choice of the plant's integrator.
    sensor_suite
        Name of the file with the sensors; empty: only those of `sensors`.
    sensors
        Sensors that differ from the suite's, or come on top.
    score_from
        Samples before this time [s] do not count in any score.
    faults
        Faults of the instruments, as `NAME:SEVERITY` or `NAME:SEVERITY:CHANNEL`; they stand
        behind the scenario's name, each after a `+`.
    population
        Name or path of the population from which a seed draws a car, a road, a drive and
        instruments; empty: the scenario has one car only.
    level
        How far the draws spread: 0 not at all, 1 as in production, 2 wide. The name of a scenario
        at a level above 0 ends with `@` and the level.
    """

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*(@[1-9])?(\+[a-z0-9_:]+)*$")
    environment: str = Field(default="", pattern=r"^(gripbench/[A-Z][A-Za-z0-9]*-v[0-9]+)?$")
    description: str
    world: str
    vehicle: str
    horizon: float = Field(gt=0.0, le=36000.0)
    sample_time: float = Field(default=0.001, ge=1e-5, le=0.1)
    integrator: str
    sensor_suite: str
    sensors: dict[str, Sensor] = {}
    score_from: float = Field(default=0.0, ge=0.0)
    faults: tuple[str, ...] = ()
    population: str = ""
    level: int = Field(default=0, ge=0, le=LEVELS[-1])

    @field_validator("sensors")
    @classmethod
    def _check_channels(cls, value: dict[str, Sensor]) -> dict[str, Sensor]:
        for channel in value:
            try:
                signal(channel)
            except GripbenchError as error:
                raise ValueError(str(error)) from None
        return value

    @model_validator(mode="after")
    def _check_level(self) -> Self:
        _, _, level = self.name.partition("+")[0].partition("@")
        if int(level or 0) != self.level:
            raise ValueError(f"name {self.name!r} does not say level {self.level}")
        return self

    @model_validator(mode="after")
    def _check_horizon(self) -> Self:
        if self.horizon < self.sample_time:
            raise ValueError(f"horizon {self.horizon:g} s is shorter than one sample")
        if self.score_from >= self.horizon:
            raise ValueError(f"score_from {self.score_from:g} s is not before the horizon")
        return self

    @model_validator(mode="after")
    def _check_samples(self) -> Self:
        samples = self.horizon / self.sample_time
        if samples > _MOST_SAMPLES:
            raise ValueError(
                f"horizon {self.horizon:g} s holds {samples:.3g} samples of {self.sample_time:g} s;"
                f" allowed are {_MOST_SAMPLES:.0f}"
            )
        if abs(samples - self.steps) > 1e-6:
            raise ValueError(
                f"horizon {self.horizon!r} s is not a whole number of samples of "
                f"{self.sample_time!r} s"
            )
        return self

    @property
    def steps(self) -> int:
        """Number of sample intervals up to the horizon."""
        return round(self.horizon / self.sample_time)

    def all_sensors(self) -> dict[str, Sensor]:
        """Return the sensors by channel: the suite's, then this scenario's own on top."""
        suite = load_sensor_suite(self.sensor_suite) if self.sensor_suite else {}
        return suite | dict(self.sensors)
