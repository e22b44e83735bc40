"""The planar world: four wheels, combined slip, a road with bank and grade, and a driver."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from gripbench.envs.plants.driven import DrivenScenario
from gripbench.envs.plants.planar import plant
from gripbench.envs.plants.planar.run import (
    HEADING,
    TERMINATIONS,
    Run,
    act,
    allocate,
    begin,
    decide,
    roll_out,
    to_earth,
)
from gripbench.envs.plants.planar.truth import TRUTH
from gripbench.envs.plants.simulation import Action, Simulation
from gripbench.envs.roads.road import MagneticField, disturb_field, lay_road, stream
from gripbench.envs.vehicles import CarOnRoad, Vehicle
from gripbench.errors import InputError

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")

_LARGEST_TORQUE = 6000.0


class PlanarScenario(DrivenScenario):
    """A scenario of the planar world.

    Attributes
    ----------
    tyre
        Shape of the tyre, see `gripbench.envs.tyres.combined`.
    magnetic
        The magnetic field over the road.
    stop_speed
        The run ends below this speed [m/s]; 0: a stop does not end it.
    """

    world: Literal["planar"]
    tyre: Literal["brush", "dugoff", "magic_formula", "fitted_curve"] = "brush"
    magnetic: MagneticField = MagneticField()
    stop_speed: float = Field(default=0.05, ge=0.0)


class PlanarSimulation(Simulation):
    """One run of the planar plant; see `Simulation`.

    Parameters
    ----------
    scenario
        What to run.
    vehicle
        Vehicle with every parameter of `gripbench.envs.plants.planar.plant.PARAMETERS`.

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

    def __init__(self, scenario: PlanarScenario, vehicle: Vehicle | CarOnRoad) -> None:
        self._scenario = scenario
        self._vehicle = vehicle
        self.sample_time = scenario.sample_time
        self._plant = plant.plant_record(scenario.tyre, vehicle)
        self._driver = scenario.driver_record()
        self._parts = round(scenario.sample_time / plant.STEP)
        self._sample, self._decided = 0, -1
        self._jump_time = math.nan
        self._planned = scenario.plan()

    def reset(self, seed: int) -> npt.NDArray[Any]:
        """Start a run; return its first sample, shape (1,)."""
        first = np.zeros(1, TRUTH)
        self._start(seed)
        begin(self._run, self._scenario.speed, first, _as_matrix(first))
        return first

    def drive(self) -> npt.NDArray[np.float64]:
        """Return the driver's next action, shape (5,)."""
        if (
            self._decided != self._sample
        ):  # the driver's arms move once a sample, however often asked
            decide(self._run, self._sample)
            self._decided = self._sample
        return self._run.action.copy()

    def advance(self, action: npt.NDArray[np.float64]) -> npt.NDArray[Any]:
        """Hold an action for one sample time; return the sample at its end, shape (1,)."""
        if not np.isfinite(action).all():
            raise InputError(f"the action {action} is not finite")
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
        road = self._scenario.road
        if road.mu_after > 0.0:
            if road.mu_std > 0.0 or road.surfaces:  # the friction changes all the time
                travelled = np.cumsum(truth["speed_x"]) * self._scenario.sample_time
                jumped = np.flatnonzero(travelled >= road.mu_jump_at)
            else:
                jumped = np.flatnonzero(truth["mu"] != truth["mu"][0])
            if len(jumped):
                self._jump_time = float(truth["time"][jumped[0]])
        return truth

    def fresh(self) -> PlanarSimulation:
        """Return another simulation of the same scenario and vehicle, not started."""
        return PlanarSimulation(self._scenario, self._vehicle)

    def path(self) -> npt.NDArray[np.float64]:
        """Return the path, north and west [m], shape (n, 2)."""
        return to_earth(self._run.path[:, :2], float(self._run.site[HEADING]))

    def _start(self, seed: int) -> None:
        """Draw whatever is random in the run, and clear what changes."""
        scenario = self._scenario
        self.termination = ""
        self._sample, self._decided = 0, -1
        self._jump_time = math.nan
        path = scenario.lay_path(seed)
        ground = lay_road(scenario.road, path[:, 3], scenario.longest(), seed)
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


def _as_matrix(samples: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    return samples.view(np.float64).reshape(len(samples), -1)
