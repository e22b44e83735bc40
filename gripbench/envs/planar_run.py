"""Compiled run of the planar world: the same functions serve one sample and a whole recording."""

from __future__ import annotations

import math

import numba

from gripbench.envs import planar_plant as plant
from gripbench.envs.path_drivers import ASTRAY, OFFSET, command, find_on_path
from gripbench.envs.planar_truth import write_truth
from gripbench.envs.road import feel_road

GOES_ON, SPIN, ROLL_OVER, STOP, OFF_ROAD, DIVERGED = 0, 1, 2, 3, 4, 5

TERMINATIONS = ("", "spin", "roll_over", "stop", "off_road", "diverged")
"""Why a run ended, by code."""

_SPUN = math.radians(75.0)  # sideslip, or angle to the path, that nobody steers back from
_SPUN_SPEED = 2.0  # slower than this a vehicle turns on the spot without having spun


@numba.njit(cache=True, error_model="numpy", nogil=True)
def begin(
    speed, x, u, p, friction, profile, memory, action, heading, field, disturbance, wheels, work,
    truth, columns,
):  # type: ignore[no-untyped-def]  # fmt: skip
    """Put the vehicle at the origin of the track, rolling at a speed; write the first sample."""
    x[:] = 0.0
    u[:] = 0.0
    memory[:] = 0.0
    action[:] = 0.0
    x[plant.V_X] = speed
    for i in range(4):
        x[plant.WHEEL + i] = speed / p[0].wheel_radius
    feel_road(x, p[0], friction[0], profile, u)
    # The body has settled on a banked or inclined road: the tyres carry its weight's share.
    x[plant.LAGGED_X] = -u[plant.GRAVITY_X]
    x[plant.LAGGED_Y] = -u[plant.GRAVITY_Y]
    x[plant.ROLL] = -p[0].roll_gradient * u[plant.GRAVITY_Y]
    write_truth(
        0.0, x, u, p[0], heading, field, disturbance[0], wheels, work[0], truth[0], columns[0]
    )


@numba.njit(cache=True, error_model="numpy", nogil=True)
def decide(k, x, u, p, driver, planned, path, memory, action):  # type: ignore[no-untyped-def]
    """Write the driver's action from sample `k` to the next."""
    last = planned.shape[0] - 1
    command(
        k * driver[0].sample_time, x, u, p[0], driver[0], planned[min(k + 1, last)], path, memory,
        action,
    )  # fmt: skip


@numba.njit(cache=True, error_model="numpy", nogil=True)
def _end_of(x, wheels, path, memory, limits):  # type: ignore[no-untyped-def]
    """Return the code of the reason to end here, `GOES_ON` if there is none."""
    for j in range(plant.STATES):
        if not math.isfinite(x[j]):
            return DIVERGED
    speed = math.hypot(x[plant.V_X], x[plant.V_Y])
    if speed > _SPUN_SPEED:
        if abs(math.atan2(x[plant.V_Y], x[plant.V_X])) > _SPUN:
            return SPIN
        if path.shape[0] > 0 and abs(memory[ASTRAY]) > _SPUN:
            return SPIN
    lifted = plant.UNCLIPPED_LOAD
    if (wheels[0, lifted] < 0.0 and wheels[2, lifted] < 0.0) or (
        wheels[1, lifted] < 0.0 and wheels[3, lifted] < 0.0
    ):
        return ROLL_OVER
    if speed < limits[0]:
        return STOP
    if path.shape[0] > 0 and abs(memory[OFFSET]) > limits[1]:
        return OFF_ROAD
    return GOES_ON


@numba.njit(cache=True, error_model="numpy", nogil=True)
def act(
    k, parts, action, x, u, p, driver, friction, profile, path, memory, limits, heading, field,
    disturbance, wheels, work, truth, columns, at,
):  # type: ignore[no-untyped-def]  # fmt: skip
    """Hold an action up to sample `k`, write that sample into row `at`; return a code.

    A state that is not finite is not written: the row repeats nothing and does not count.
    """
    steer = min(max(action[0], -p[0].steer_limit), p[0].steer_limit)
    span = driver[0].sample_time
    rate = (steer - x[plant.STEER]) / span
    u[plant.STEER_RATE] = min(max(rate, -p[0].steer_rate_limit), p[0].steer_rate_limit)
    for i in range(4):
        u[plant.TORQUE + i] = action[1 + i]
    for _ in range(parts):
        plant.advance_step(x, u, p[0], wheels, work)
        feel_road(x, p[0], friction[0], profile, u)
    if path.shape[0] > 0:
        find_on_path(x, path, memory)
    write_truth(
        k * span, x, u, p[0], heading, field, disturbance[min(k, disturbance.shape[0] - 1)],
        wheels, work[0], truth[at], columns[at],
    )  # fmt: skip
    return _end_of(x, wheels, path, memory, limits)


@numba.njit(cache=True, error_model="numpy", nogil=True)
def roll_out(
    parts, x, u, p, driver, planned, friction, profile, path, memory, action, limits, heading,
    field, disturbance, wheels, work, truth, columns,
):  # type: ignore[no-untyped-def]  # fmt: skip
    """Run from the first sample to the end; return the number of samples and a code."""
    code = GOES_ON
    count = 1
    for k in range(1, truth.shape[0]):
        decide(k - 1, x, u, p, driver, planned, path, memory, action)
        code = act(
            k, parts, action, x, u, p, driver, friction, profile, path, memory, limits, heading,
            field, disturbance, wheels, work, truth, columns, k,
        )  # fmt: skip
        if code == DIVERGED:
            break
        count = k + 1
        if code != GOES_ON:
            break
    return count, code
