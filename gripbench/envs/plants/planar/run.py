"""Compiled run of the planar world: the same functions serve one sample and a whole recording."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gripbench.compilation import compiled
from gripbench.envs.drivers.path_drivers import ASTRAY, MEMORY, OFFSET, command, find_on_path
from gripbench.envs.plants.planar import plant
from gripbench.envs.plants.planar.truth import write_truth
from gripbench.envs.roads.road import feel_road

GOES_ON, SPIN, ROLL_OVER, STOP, OFF_ROAD, DIVERGED = 0, 1, 2, 3, 4, 5

TERMINATIONS = ("", "spin", "roll_over", "stop", "off_road", "diverged")
"""Why a run ended, by code."""

HEADING, NORTH, UP, STOP_SPEED, ROADSIDE, SITE = 0, 1, 2, 3, 4, 5

SPUN = math.radians(60.0)
"""Sideslip, or angle to the path, from which nobody steers back [rad]."""

_SPUN_SPEED = 2.0  # slower than this a vehicle turns on the spot without having spun


class Run(NamedTuple):
    """Everything that the compiled functions need of one run.

    Attributes
    ----------
    plant, driver, friction
        One record each of `PLANT`, `DRIVER` and `GROUND`.
    planned
        Open-loop steering angle [rad] and speed to hold [m/s] at each sample, shape (n, 2).
    profile
        Bank, grade [rad] and friction over `mu` of the road over the distance, shape (m, 3).
    path
        Table of the path, shape (l, 4); no rows for open-loop steering.
    disturbance
        What disturbs the magnetic field at each sample [T], shape (n, 3).
    site
        Heading of the track [rad], Earth's field to the north and up [T], speed [m/s] and
        distance from the path [m] that end the run, shape (SITE,).
    state, inputs, memory, action
        What changes: the plant's state and inputs, the driver's memory and action.
    wheels, work
        Work space.
    """

    plant: npt.NDArray[Any]
    driver: npt.NDArray[Any]
    friction: npt.NDArray[Any]
    planned: npt.NDArray[np.float64]
    profile: npt.NDArray[np.float64]
    path: npt.NDArray[np.float64]
    disturbance: npt.NDArray[np.float64]
    site: npt.NDArray[np.float64]
    state: npt.NDArray[np.float64]
    inputs: npt.NDArray[np.float64]
    memory: npt.NDArray[np.float64]
    action: npt.NDArray[np.float64]
    wheels: npt.NDArray[np.float64]
    work: npt.NDArray[np.float64]


def allocate() -> dict[str, npt.NDArray[np.float64]]:
    """Return the arrays of a `Run` that change, by field."""
    return {
        "state": np.zeros(plant.STATES),
        "inputs": np.zeros(plant.INPUTS),
        "memory": np.zeros(MEMORY),
        "action": np.zeros(5),
        "wheels": np.zeros((4, plant.WHEEL_COLUMNS)),
        "work": np.zeros((3, plant.STATES)),
    }


def to_earth(points: npt.NDArray[np.float64], heading: float) -> npt.NDArray[np.float64]:
    """Return points of the track, shape (n, 2), as north and west; the track heads there [rad]."""
    sin, cos = math.sin(heading), math.cos(heading)
    return np.asarray(points @ np.array([[cos, sin], [-sin, cos]]))


@compiled
def begin(run, speed, truth, columns):
    """Put the vehicle at the origin of the track, rolling at a speed; write the first sample.

    Parameters
    ----------
    run
        The run, freshly allocated.
    speed
        Speed along the track [m/s].
    truth, columns
        Samples as records of `TRUTH` and, in the same memory, as a matrix.
    """
    x, u, p = run.state, run.inputs, run.plant[0]
    x[plant.V_X] = speed
    for i in range(4):
        x[plant.WHEEL + i] = speed / (p.radius_front if i < 2 else p.radius_rear)
    feel_road(x, p, run.friction[0], run.profile, u)
    # The body has settled on a banked or inclined road: the tyres carry its weight's share.
    x[plant.LAGGED_X] = -u[plant.GRAVITY_X]
    x[plant.LAGGED_Y] = -u[plant.GRAVITY_Y]
    x[plant.ROLL] = -p.roll_gradient * u[plant.GRAVITY_Y]
    plant.hold_stiffness(x, p, u)
    _write(run, 0, truth, columns, 0)


@compiled
def decide(run, k):
    """Write the driver's action from sample `k` to the next into the run."""
    time = k * run.driver[0].sample_time
    planned = run.planned[min(k + 1, run.planned.shape[0] - 1)]
    command(
        time, run.state, run.inputs, run.plant[0], run.driver[0], planned, run.path, run.memory,
        run.action,
    )  # fmt: skip


@compiled
def act(run, k, parts, action, truth, columns, at):
    """Hold an action up to sample `k`, write that sample into row `at`; return a code.

    A state that is not finite is not written.

    Parameters
    ----------
    run
        The run.
    k
        Number of the sample.
    parts
        Integration steps in a sample.
    action
        Steering angle to reach [rad] and four wheel torques [N m], shape (5,).
    truth, columns, at
        Samples, the same as a matrix, and the row to write.
    """
    x, u, p = run.state, run.inputs, run.plant[0]
    steer = min(max(action[0], -p.steer_limit), p.steer_limit)
    rate = (steer - x[plant.STEER]) / run.driver[0].sample_time
    u[plant.STEER_RATE] = min(max(rate, -p.steer_rate_limit), p.steer_rate_limit)
    for i in range(4):
        u[plant.TORQUE + i] = action[1 + i]
    for _ in range(parts):
        plant.advance_step(x, u, p, run.wheels, run.work)
        feel_road(x, p, run.friction[0], run.profile, u)
    for j in range(plant.STATES):
        if not math.isfinite(x[j]):
            return DIVERGED
    if run.path.shape[0] > 0:
        find_on_path(x, run.path, run.memory)
    _write(run, k, truth, columns, at)
    return _end_of(run)


@compiled
def roll_out(run, parts, truth, columns):
    """Run from the first sample to the end; return the number of samples and a code."""
    code = GOES_ON
    count = 1
    for k in range(1, truth.shape[0]):
        decide(run, k - 1)
        code = act(run, k, parts, run.action, truth, columns, k)
        if code == DIVERGED:
            break  # nothing was written
        count = k + 1
        if code != GOES_ON:
            break
    return count, code


@compiled
def _write(run, k, truth, columns, at):
    site = run.site
    write_truth(
        k * run.driver[0].sample_time, run.state, run.inputs, run.plant[0], site[HEADING],
        site[NORTH], site[UP], run.disturbance[min(k, run.disturbance.shape[0] - 1)], run.wheels,
        run.work[0], truth[at], columns[at],
    )  # fmt: skip


@compiled
def _end_of(run):
    """Return the code of the reason to end here, `GOES_ON` if there is none."""
    x, wheels = run.state, run.wheels
    on_path = run.path.shape[0] > 0
    speed = math.hypot(x[plant.V_X], x[plant.V_Y])
    if speed > _SPUN_SPEED:
        if math.atan2(abs(x[plant.V_Y]), abs(x[plant.V_X])) > SPUN:  # backwards is no spin
            return SPIN
        if on_path and abs(run.memory[ASTRAY]) > SPUN:
            return SPIN
    lifted = plant.UNCLIPPED_LOAD
    if (wheels[0, lifted] < 0.0 and wheels[2, lifted] < 0.0) or (
        wheels[1, lifted] < 0.0 and wheels[3, lifted] < 0.0
    ):
        return ROLL_OVER
    if speed < run.site[STOP_SPEED]:
        return STOP
    if on_path and abs(run.memory[OFFSET]) > run.site[ROADSIDE]:
        return OFF_ROAD
    return GOES_ON
