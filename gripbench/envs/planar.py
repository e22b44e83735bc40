"""The planar world: four wheels, combined slip, a road with bank and grade, and a driver."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator, model_validator

from gripbench.configuration import Configuration
from gripbench.envs import planar_plant as plant
from gripbench.envs.path_drivers import DRIVER, Driver, Steering, steering_angles
from gripbench.envs.paths import Path, Turns, lay_path
from gripbench.envs.planar_run import TERMINATIONS, Run, act, allocate, begin, decide, roll_out
from gripbench.envs.planar_truth import TRUTH
from gripbench.envs.road import MagneticField, Road, disturb_field, lay_road, stream
from gripbench.envs.scenarios import Scenario
from gripbench.envs.simulation import Action, Simulation
from gripbench.envs.vehicles import Vehicle

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")

_LARGEST_TORQUE = 6000.0


class SpeedWave(Configuration):
    """A sine on top of the speed that the driver holds."""

    amplitude: float = Field(default=0.0, ge=0.0, description="[m/s]")
    frequency: float = Field(default=0.08, gt=0.0, description="[Hz]")


class PlanarScenario(Scenario):
    """A scenario of the planar world; exactly one of `path` and `steering` is given.

    Attributes
    ----------
    tyre
        Shape of the tyre, see `gripbench.envs.tyres_combined`.
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
    road, magnetic
        The road, and the magnetic field over it.
    stop_speed
        The run ends below this speed [m/s]; 0: a stop does not end it.
    off_road
        The run ends so far beside the path [m].
    """

    world: Literal["planar"]
    integrator: Literal["rk4"] = "rk4"
    tyre: Literal["brush", "dugoff", "magic_formula"] = "brush"
    speed: float = Field(ge=0.0, le=100.0)
    speed_wave: SpeedWave = SpeedWave()
    path: Path | None = None
    steering: Steering | None = None
    driver: Driver = Driver()
    road: Road
    magnetic: MagneticField = MagneticField()
    stop_speed: float = Field(default=0.05, ge=0.0)
    off_road: float = Field(default=15.0, gt=0.0)

    @field_validator("sample_time")
    @classmethod
    def _check_sample_time(cls, value: float) -> float:
        steps = value / plant.STEP
        if steps < 1.0 - 1e-9 or abs(steps - round(steps)) > 1e-6:
            raise ValueError(f"must be a multiple of the integration step, {plant.STEP:g} s")
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


class PlanarSimulation(Simulation):
    """One run of the planar plant; see `Simulation`.

    Parameters
    ----------
    scenario
        What to run.
    vehicle
        Vehicle with every parameter of `gripbench.envs.planar_plant.PARAMETERS`.

    Raises
    ------
    InputError
        If the vehicle lacks a parameter or cannot roll over its own geometry.
    """

    actions: ClassVar[tuple[Action, ...]] = (
        Action("steer_angle", "rad", -1.2, 1.2, "Steering angle to reach at the end of the sample"),
        *(
            Action(
                f"torque_{wheel}",
                "N m",
                -_LARGEST_TORQUE,
                _LARGEST_TORQUE,
                "Drive torque, brake torque is negative",
            )
            for wheel in WHEELS
        ),
    )
    truth_type: ClassVar[np.dtype[Any]] = TRUTH

    def __init__(self, scenario: PlanarScenario, vehicle: Vehicle) -> None:
        self._scenario = scenario
        self.sample_time = scenario.sample_time
        self._plant = plant.plant_record(scenario.tyre, vehicle)
        self._driver = _driver_record(scenario)
        self._parts = round(scenario.sample_time / plant.STEP)
        self._sample = 0
        self._jump_time = math.nan
        time = np.arange(scenario.steps + 1) * scenario.sample_time
        wave = scenario.speed_wave
        self._planned = np.zeros((scenario.steps + 1, 2))
        self._planned[:, 1] = scenario.speed + wave.amplitude * np.sin(
            2.0 * math.pi * wave.frequency * time
        )
        if scenario.steering is not None:
            self._planned[:, 0] = steering_angles(scenario.steering, time)

    def reset(self, seed: int) -> npt.NDArray[Any]:
        """Start a run; return its first sample, shape (1,)."""
        first = np.zeros(1, TRUTH)
        self._start(seed)
        begin(self._run, self._scenario.speed, first, _as_matrix(first))
        return first

    def drive(self) -> npt.NDArray[np.float64]:
        """Return the driver's next action, shape (5,)."""
        decide(self._run, self._sample)
        return self._run.action.copy()

    def advance(self, action: npt.NDArray[np.float64]) -> npt.NDArray[Any]:
        """Hold an action for one sample time; return the sample at its end, shape (1,)."""
        after = np.zeros(1, TRUTH)
        self._sample += 1
        given = np.array(action, dtype=np.float64)
        code = act(self._run, self._sample, self._parts, given, after, _as_matrix(after), 0)
        self.termination = TERMINATIONS[code]
        return after

    def run(self, seed: int) -> npt.NDArray[Any]:
        """Run to the horizon or termination under the scenario's driver."""
        samples = np.zeros(self._scenario.steps + 1, TRUTH)
        columns = _as_matrix(samples)
        self._start(seed)
        begin(self._run, self._scenario.speed, samples, columns)
        count, code = roll_out(self._run, self._parts, samples, columns)
        self.termination = TERMINATIONS[code]
        truth = samples[:count]
        jumped = np.flatnonzero(truth["mu"] != truth["mu"][0])
        if self._scenario.road.mu_after > 0.0 and len(jumped):
            self._jump_time = float(truth["time"][jumped[0]])
        return truth

    def _start(self, seed: int) -> None:
        """Draw whatever is random in the run, and clear what changes."""
        scenario = self._scenario
        self.termination = ""
        self._sample = 0
        self._jump_time = math.nan
        path = np.zeros((0, 4))
        if scenario.path is not None:
            path = lay_path(scenario.path, scenario.speed, seed)
        fastest = scenario.speed + scenario.speed_wave.amplitude
        ground = lay_road(scenario.road, path[:, 3], fastest * scenario.horizon + 200.0, seed)
        field = scenario.magnetic
        heading = stream(seed, "heading").uniform(-math.pi, math.pi)
        self._run = Run(
            plant=self._plant,
            driver=self._driver,
            friction=ground.friction,
            planned=self._planned,
            profile=ground.profile,
            path=path,
            disturbance=disturb_field(field, scenario.sample_time, scenario.steps + 1, seed),
            site=np.array(
                [heading, field.horizontal, field.vertical, scenario.stop_speed, scenario.off_road]
            ),
            **allocate(),
        )

    def notes(self) -> dict[str, float]:
        """Return the time of the friction jump [s], if there was one."""
        return {} if math.isnan(self._jump_time) else {"mu_jump_time": self._jump_time}


def _driver_record(scenario: PlanarScenario) -> npt.NDArray[Any]:
    record = np.zeros(1, DRIVER)
    for name, value in scenario.driver.model_dump().items():
        record[name] = value
    record["sample_time"] = scenario.sample_time
    return record


def _as_matrix(samples: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    return samples.view(np.float64).reshape(len(samples), -1)
