"""The linear bicycle: two axles with linear lateral forces at a constant speed.

It is the plant of Anderson & Bevly (2004), equation 1, with sums and signs put right: the rear
force belongs to the rear axle, the moments turn about z and give I_z dr/dt, and a positive
stiffness gives a restoring force. Its steady state is what every four-wheel vehicle must show at
low lateral acceleration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import model_validator

from gripbench.compilation import compiled
from gripbench.envs.drivers.path_drivers import OFFSET, command, find_on_path, wrapped
from gripbench.envs.plants.driven import DrivenScenario
from gripbench.envs.plants.planar import plant
from gripbench.envs.plants.planar.run import (
    GOES_ON,
    HEADING,
    OFF_ROAD,
    ROADSIDE,
    SPIN,
    SPUN,
    TERMINATIONS,
    Run,
    allocate,
    to_earth,
)
from gripbench.envs.plants.simulation import Action, Simulation
from gripbench.envs.roads.road import SPACING as ROAD_SPACING
from gripbench.envs.roads.road import lay_road, stream
from gripbench.envs.signals import record_type
from gripbench.envs.vehicles import GRAVITY, CarOnRoad, Vehicle, require
from gripbench.errors import InputError

PARAMETERS = (
    "mass",
    "yaw_inertia",
    "cg_to_front",
    "cg_to_rear",
    "cornering_stiffness_front",
    "cornering_stiffness_rear",
    "steer_limit",
    "steer_rate_limit",
)
"""Vehicle parameters that the bicycle needs."""

TRUTH = record_type(
    (
        "time",
        "steer_angle",
        "accel_x",
        "accel_y",
        "yaw_rate",
        "velocity_north",
        "velocity_west",
        "velocity_up",
        "gps_time",
        "course",
        "speed_x",
        "speed_y",
        "speed_gps",
        "sideslip",
        "yaw",
        "position_x",
        "position_y",
        "road_bank",
        "force_y_front",
        "force_y_rear",
    )
)
"""Structured type of one sample of the truth."""


@dataclass(frozen=True)
class SteadyState:
    """Steady cornering of the linear bicycle.

    Attributes
    ----------
    understeer_gradient
        Steering angle beyond that of slow driving, over lateral acceleration [rad s^2/m].
    yaw_rate_gain
        Yaw rate over steering angle [1/s].
    sideslip_gain
        Sideslip angle over steering angle [-].
    """

    understeer_gradient: float
    yaw_rate_gain: float
    sideslip_gain: float


def steady_state(vehicle: dict[str, float], speed: float) -> SteadyState:
    """Return the steady cornering of a vehicle at a speed [m/s].

    Parameters
    ----------
    vehicle
        Parameters by name, SI units; those of `PARAMETERS` but the limits of steering.
    speed
        Speed along x [m/s], positive.
    """
    given = require(vehicle, PARAMETERS[:6], "the bicycle")
    a, b = given["cg_to_front"], given["cg_to_rear"]
    rear = given["mass"] * a / (a + b) / given["cornering_stiffness_rear"]
    front = given["mass"] * b / (a + b) / given["cornering_stiffness_front"]
    gain = speed / (a + b + (front - rear) * speed**2)
    return SteadyState(front - rear, gain, gain * (b / speed - rear * speed))


class BicycleScenario(DrivenScenario):
    """A scenario of the bicycle world: constant speed, road with bank but no friction limit."""

    world: Literal["bicycle"]

    @model_validator(mode="after")
    def _check_speed(self) -> Self:
        if self.speed < 1.0:
            raise ValueError(f"speed {self.speed:g} m/s: the linear bicycle needs 1 and above")
        if self.speed_wave.amplitude > 0.0 or self.driver.brake_at > 0.0:
            raise ValueError("a linear bicycle keeps its speed: no speed_wave, no driver.brake_at")
        return self


@compiled
def derivative(x, u, p, dx):
    """Fill `dx` with the time derivative of the state; return the axles' forces [N].

    State, inputs and parameters have the layout of `gripbench.envs.plants.planar.plant`.
    """
    speed = x[plant.V_X]
    slip_front = x[plant.STEER] - (x[plant.V_Y] + p.cg_to_front * x[plant.YAW_RATE]) / speed
    slip_rear = -(x[plant.V_Y] - p.cg_to_rear * x[plant.YAW_RATE]) / speed
    front = 2.0 * p.tyre_y_front * slip_front
    rear = 2.0 * p.tyre_y_rear * slip_rear
    dx[:] = 0.0
    dx[plant.V_Y] = (front + rear) / p.mass + u[plant.GRAVITY_Y] - speed * x[plant.YAW_RATE]
    dx[plant.YAW_RATE] = (p.cg_to_front * front - p.cg_to_rear * rear) / p.yaw_inertia
    dx[plant.YAW] = x[plant.YAW_RATE]
    cos_yaw = math.cos(x[plant.YAW])
    sin_yaw = math.sin(x[plant.YAW])
    dx[plant.X] = cos_yaw * speed - sin_yaw * x[plant.V_Y]
    dx[plant.Y] = sin_yaw * speed + cos_yaw * x[plant.V_Y]
    dx[plant.DISTANCE] = speed
    dx[plant.STEER] = u[plant.STEER_RATE]
    return front, rear


@compiled
def _feel_bank(run):
    place = min(max(run.state[plant.DISTANCE] / ROAD_SPACING, 0.0), run.profile.shape[0] - 2.000001)
    first = int(place)
    bank = run.profile[first, 0]
    bank += (place - first) * (run.profile[first + 1, 0] - bank)
    run.inputs[plant.BANK] = bank
    run.inputs[plant.GRAVITY_Y] = -GRAVITY * math.sin(bank)


@compiled
def _write(run, k, truth, at):
    x, p, row = run.state, run.plant[0], truth[at]
    front, rear = derivative(x, run.inputs, p, run.work[0])
    heading = run.site[HEADING]
    yaw = x[plant.YAW] + heading
    row.time = k * run.driver[0].sample_time
    row.gps_time = row.time
    row.steer_angle = x[plant.STEER]
    row.accel_x = -x[plant.YAW_RATE] * x[plant.V_Y]
    row.accel_y = (front + rear) / p.mass
    row.yaw_rate = x[plant.YAW_RATE]
    row.velocity_north = math.cos(yaw) * x[plant.V_X] - math.sin(yaw) * x[plant.V_Y]
    row.velocity_west = math.sin(yaw) * x[plant.V_X] + math.cos(yaw) * x[plant.V_Y]
    row.velocity_up = 0.0
    row.course = math.atan2(row.velocity_west, row.velocity_north)
    row.speed_x = x[plant.V_X]
    row.speed_y = x[plant.V_Y]
    row.speed_gps = x[plant.V_X]
    row.sideslip = math.atan2(x[plant.V_Y], x[plant.V_X])
    row.yaw = wrapped(yaw)
    row.position_x = math.cos(heading) * x[plant.X] - math.sin(heading) * x[plant.Y]
    row.position_y = math.sin(heading) * x[plant.X] + math.cos(heading) * x[plant.Y]
    row.road_bank = run.inputs[plant.BANK]
    row.force_y_front = front
    row.force_y_rear = rear


@compiled
def begin(run, speed, truth):
    """Put the vehicle at the origin of the track at a speed [m/s]; write the first sample."""
    run.state[plant.V_X] = speed
    run.inputs[plant.NORMAL] = GRAVITY
    run.inputs[plant.MU : plant.MU + 4] = 1e3  # no limit to what the driver may ask for
    _feel_bank(run)
    _write(run, 0, truth, 0)


@compiled
def decide(run, k):
    """Write the driver's steering from sample `k` to the next into the run."""
    planned = run.planned[min(k + 1, run.planned.shape[0] - 1)]
    command(
        0.0, run.state, run.inputs, run.plant[0], run.driver[0], planned, run.path, run.memory,
        run.action,
    )  # fmt: skip


@compiled
def act(run, k, parts, steer, truth, at):
    """Steer to an angle [rad] up to sample `k`, write that into row `at`; return a code."""
    x, u, p = run.state, run.inputs, run.plant[0]
    wanted = min(max(steer, -p.steer_limit), p.steer_limit)
    rate = (wanted - x[plant.STEER]) / run.driver[0].sample_time
    u[plant.STEER_RATE] = min(max(rate, -p.steer_rate_limit), p.steer_rate_limit)
    slope, total, trial = run.work[0], run.work[1], run.work[2]
    h = plant.STEP
    for _ in range(parts):
        derivative(x, u, p, slope)
        total[:] = slope
        trial[:] = x + 0.5 * h * slope
        derivative(trial, u, p, slope)
        total[:] += 2.0 * slope
        trial[:] = x + 0.5 * h * slope
        derivative(trial, u, p, slope)
        total[:] += 2.0 * slope
        trial[:] = x + h * slope
        derivative(trial, u, p, slope)
        x[:] += h / 6.0 * (total + slope)
        _feel_bank(run)
    if run.path.shape[0] > 0:
        find_on_path(x, run.path, run.memory)
    _write(run, k, truth, at)
    # Beyond the critical speed of an oversteering vehicle the linear equations grow for ever.
    if abs(math.atan2(x[plant.V_Y], x[plant.V_X])) > SPUN:
        return SPIN
    if run.path.shape[0] > 0 and abs(run.memory[OFFSET]) > run.site[ROADSIDE]:
        return OFF_ROAD
    return GOES_ON


@compiled
def roll_out(run, parts, truth):
    """Run from the first sample to the end; return the number of samples and a code."""
    for k in range(1, truth.shape[0]):
        decide(run, k - 1)
        code = act(run, k, parts, run.action[0], truth, k)
        if code != GOES_ON:
            return k + 1, code
    return truth.shape[0], GOES_ON


class BicycleSimulation(Simulation):
    """One run of the linear bicycle; see `Simulation`.

    Parameters
    ----------
    scenario
        What to run.
    vehicle
        Vehicle with every parameter of `PARAMETERS`.
    """

    actions: ClassVar[tuple[Action, ...]] = (
        Action("steer_angle", "rad", -1.2, 1.2, "Steering angle to reach at the end of the sample"),
    )
    truth_type: ClassVar[np.dtype[Any]] = TRUTH

    def __init__(self, scenario: BicycleScenario, vehicle: Vehicle | CarOnRoad) -> None:
        self._scenario = scenario
        self._vehicle = vehicle
        self.sample_time = scenario.sample_time
        self._parts = round(scenario.sample_time / plant.STEP)
        self._plant = _plant_record(vehicle)
        self._run: Any = None
        self._decided = -1

    def reset(self, seed: int) -> npt.NDArray[Any]:
        """Start a run; return its first sample, shape (1,)."""
        first = np.zeros(1, TRUTH)
        self._start(seed)
        begin(self._run, self._scenario.speed, first)
        return first

    def drive(self) -> npt.NDArray[np.float64]:
        """Return the driver's next action, shape (1,)."""
        # the driver's arms move once a sample, however often asked
        if self._decided != self._sample:
            decide(self._run, self._sample)
            self._decided = self._sample
        return self._run.action[:1].copy()

    def advance(self, action: npt.NDArray[np.float64]) -> npt.NDArray[Any]:
        """Steer to an angle within one sample time; return the sample at its end, shape (1,)."""
        if not np.isfinite(action).all():
            raise InputError(f"the action {action} is not finite")
        after = np.zeros(1, TRUTH)
        self._sample += 1
        code = act(self._run, self._sample, self._parts, float(action[0]), after, 0)
        self.termination = TERMINATIONS[code]
        return after

    def run(self, seed: int) -> npt.NDArray[Any]:
        """Run to the horizon or termination under the scenario's driver."""
        samples = np.zeros(self._scenario.steps + 1, TRUTH)
        self._start(seed)
        begin(self._run, self._scenario.speed, samples)
        count, code = roll_out(self._run, self._parts, samples)
        self.termination = TERMINATIONS[code]
        return samples[:count]

    def fresh(self) -> BicycleSimulation:
        """Return another simulation of the same scenario and vehicle, not started."""
        return BicycleSimulation(self._scenario, self._vehicle)

    def path(self) -> npt.NDArray[np.float64]:
        """Return the path, north and west [m], shape (n, 2)."""
        return to_earth(self._run.path[:, :2], float(self._run.site[HEADING]))

    def _start(self, seed: int) -> None:
        scenario = self._scenario
        self.termination = ""
        self._sample, self._decided = 0, -1
        path = scenario.lay_path(seed)
        heading = stream(seed, "heading").uniform(-math.pi, math.pi)
        ground = lay_road(scenario.road, path[:, 3], scenario.longest(), seed)
        self._run = Run(
            plant=self._plant,
            driver=scenario.driver_record(),
            friction=ground.friction,
            planned=scenario.plan(),
            profile=ground.profile,
            path=path,
            disturbance=np.zeros((1, 3)),
            site=np.array([heading, 0.0, 0.0, 0.0, scenario.off_road]),
            **allocate(),
        )


def _plant_record(vehicle: Vehicle | CarOnRoad) -> npt.NDArray[Any]:
    given = require(vehicle.values(), PARAMETERS, "the bicycle")
    base = given["cg_to_front"] + given["cg_to_rear"]
    record = np.zeros(1, plant.PLANT)
    for name in set(plant.PLANT.names or ()) & set(given):
        record[name] = given[name]
    record["mass_front"] = given["mass"] * given["cg_to_rear"] / base
    record["mass_rear"] = given["mass"] * given["cg_to_front"] / base
    record["tyre_y_front"] = 0.5 * given["cornering_stiffness_front"]
    record["tyre_y_rear"] = 0.5 * given["cornering_stiffness_rear"]
    return record
