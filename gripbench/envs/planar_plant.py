"""The planar vehicle: seven degrees of freedom, roll, lagged load transfer, steering.

State: v_x, v_y, yaw rate, four wheel speeds; suspension roll and its rate; the longitudinal and
lateral specific force that the wheel loads follow with a lag, which breaks the algebraic loop
between loads and forces; heading, position and distance in the axes of the track; steering angle.
Positions of the wheels follow the order front left, front right, rear left, rear right.

Nothing divides by a vanishing speed: the rolling speed in the slip is replaced below
`SLOW_ROLLING` by a parabola that meets it smoothly, brake torque and rolling resistance pass
through zero with the wheel's speed, and steps are cut into as many parts as the stiffest wheel
needs, so that a vehicle comes to rest without chatter.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from gripbench.envs.tyres_combined import combined_force

V_X, V_Y, YAW_RATE, WHEEL, ROLL, ROLL_RATE, LAGGED_X, LAGGED_Y = 0, 1, 2, 3, 7, 8, 9, 10
YAW, X, Y, DISTANCE, STEER, STATES = 11, 12, 13, 14, 15, 16

STEER_RATE, TORQUE, MU, GRAVITY_X, GRAVITY_Y, GRAVITY_Z = 0, 1, 5, 9, 10, 11
YAW_OFFSET, YAW_GAIN, ALONG_X, ALONG_Y, ACROSS_Y = 12, 13, 14, 15, 16
BANK, GRADE, BANK_RATE, GRADE_RATE, INPUTS = 17, 18, 19, 20, 21

FORCE_X, FORCE_Y, LOAD, LON_SPEED, LAT_SPEED, APPLIED_TORQUE, UNCLIPPED_LOAD = 0, 1, 2, 3, 4, 5, 6
WHEEL_COLUMNS = 7

STEP = 1e-3
"""Integration step [s]."""

SLOW_ROLLING = 1.0
"""Rolling speed [m/s] below which the denominator of the slip is regularised."""

SLOW_SPIN = 1.0
"""Wheel speed [rad/s] within which brake torque passes through zero."""

_STIFFEST = 1.5  # largest product of step and eigenvalue; fourth-order Runge-Kutta bears 2.78

PLANT = np.dtype(
    [
        (name, np.float64)
        for name in (
            "mass",
            "yaw_inertia",
            "cg_to_front",
            "cg_to_rear",
            "cg_height",
            "track_front",
            "track_rear",
            "wheel_radius",
            "spin_inertia",  # of one wheel
            "drag",
            "rolling_resistance",
            "tyre_x",  # longitudinal stiffness of one tyre at its static load
            "tyre_y_front",
            "tyre_y_rear",
            "load_exponent",
            "roll_gradient",
            "roll_frequency",
            "roll_damping",
            "roll_share_front",
            "pitch_gradient",
            "load_lag",
            "drive_share_front",
            "brake_share_front",
            "steer_limit",
            "steer_rate_limit",
        )
    ]
    + [("shape", np.int64)]
)
"""What the compiled plant knows of the vehicle."""


@numba.njit(cache=True, error_model="numpy", nogil=True)
def rolling_speed(speed):  # type: ignore[no-untyped-def]
    """Return |speed|, below `SLOW_ROLLING` a parabola with half of it as its least value."""
    size = abs(speed)
    if size >= SLOW_ROLLING:
        return size
    return 0.5 * (SLOW_ROLLING + size * size / SLOW_ROLLING)


@numba.njit(cache=True, error_model="numpy", nogil=True)
def wheel_forces(x, u, p, wheels):  # type: ignore[no-untyped-def]
    """Fill `wheels`, shape (4, WHEEL_COLUMNS): forces, loads and speeds in the wheels' axes."""
    base = p.cg_to_front + p.cg_to_rear
    transfer = p.mass * x[LAGGED_X] * p.cg_height / base
    weight = p.mass * u[GRAVITY_Z] / base
    moment = p.mass * x[LAGGED_Y] * p.cg_height
    cos_steer = math.cos(x[STEER])
    sin_steer = math.sin(x[STEER])
    for i in range(4):
        front = i < 2
        left = i % 2 == 0
        if front:
            axle = weight * p.cg_to_rear - transfer
            nominal = 0.5 * p.mass * 9.81 * p.cg_to_rear / base
            aside = moment * p.roll_share_front / p.track_front
            offset_x = p.cg_to_front
            offset_y = 0.5 * p.track_front
            stiffness = p.tyre_y_front
        else:
            axle = weight * p.cg_to_front + transfer
            nominal = 0.5 * p.mass * 9.81 * p.cg_to_front / base
            aside = moment * (1.0 - p.roll_share_front) / p.track_rear
            offset_x = -p.cg_to_rear
            offset_y = 0.5 * p.track_rear
            stiffness = p.tyre_y_rear
        if not left:
            aside = -aside
            offset_y = -offset_y
        axle = max(axle, 0.0)
        unclipped = 0.5 * axle - aside
        load = min(max(unclipped, 0.0), axle)
        speed_x = x[V_X] - x[YAW_RATE] * offset_y
        speed_y = x[V_Y] + x[YAW_RATE] * offset_x
        if front:
            turned = cos_steer * speed_x + sin_steer * speed_y
            speed_y = cos_steer * speed_y - sin_steer * speed_x
            speed_x = turned
        rolling = p.wheel_radius * x[WHEEL + i]
        inverse = 1.0 / rolling_speed(rolling)
        growth = (load / nominal) ** p.load_exponent
        force_x, force_y = combined_force(
            p.shape,
            (rolling - speed_x) * inverse,
            -speed_y * inverse,
            p.tyre_x * growth,
            stiffness * growth,
            u[MU + i] * load,
        )
        # A negative torque is a brake's: it opposes the wheel whichever way that turns.
        spin = x[WHEEL + i]
        sense = spin / math.sqrt(spin * spin + SLOW_SPIN * SLOW_SPIN)
        torque = u[TORQUE + i]
        if torque < 0.0:
            torque *= sense
        wheels[i, FORCE_X] = force_x
        wheels[i, FORCE_Y] = force_y
        wheels[i, LOAD] = load
        wheels[i, LON_SPEED] = speed_x
        wheels[i, LAT_SPEED] = speed_y
        wheels[i, APPLIED_TORQUE] = torque
        wheels[i, UNCLIPPED_LOAD] = unclipped


@numba.njit(cache=True, error_model="numpy", nogil=True)
def resultant(x, p, wheels):  # type: ignore[no-untyped-def]
    """Return the force along x and y [N], drag included, and the moment about z [N m]."""
    cos_steer = math.cos(x[STEER])
    sin_steer = math.sin(x[STEER])
    left_x = cos_steer * wheels[0, FORCE_X] - sin_steer * wheels[0, FORCE_Y]
    right_x = cos_steer * wheels[1, FORCE_X] - sin_steer * wheels[1, FORCE_Y]
    front_y = sin_steer * (wheels[0, FORCE_X] + wheels[1, FORCE_X]) + cos_steer * (
        wheels[0, FORCE_Y] + wheels[1, FORCE_Y]
    )
    rear_y = wheels[2, FORCE_Y] + wheels[3, FORCE_Y]
    force_x = left_x + right_x + wheels[2, FORCE_X] + wheels[3, FORCE_X]
    force_x -= p.drag * x[V_X] * abs(x[V_X])
    moment = (
        p.cg_to_front * front_y
        - p.cg_to_rear * rear_y
        + 0.5 * p.track_front * (right_x - left_x)
        + 0.5 * p.track_rear * (wheels[3, FORCE_X] - wheels[2, FORCE_X])
    )
    return force_x, front_y + rear_y, moment


@numba.njit(cache=True, error_model="numpy", nogil=True)
def derivative(x, u, p, wheels, dx):  # type: ignore[no-untyped-def]
    """Fill `dx` with the time derivative of the state under held inputs.

    Parameters
    ----------
    x, dx
        State and its derivative, shape (STATES,).
    u
        Inputs, shape (INPUTS,).
    p
        Record of type `PLANT`.
    wheels
        Work space, shape (4, WHEEL_COLUMNS).
    """
    wheel_forces(x, u, p, wheels)
    force_x, force_y, moment = resultant(x, p, wheels)
    specific_x = force_x / p.mass
    specific_y = force_y / p.mass
    dx[V_X] = specific_x + u[GRAVITY_X] + x[YAW_RATE] * x[V_Y]
    dx[V_Y] = specific_y + u[GRAVITY_Y] - x[YAW_RATE] * x[V_X]
    dx[YAW_RATE] = moment / p.yaw_inertia
    for i in range(4):
        spin = x[WHEEL + i]
        sense = spin / math.sqrt(spin * spin + SLOW_SPIN * SLOW_SPIN)
        resistance = p.rolling_resistance * wheels[i, LOAD] * sense
        dx[WHEEL + i] = (
            wheels[i, APPLIED_TORQUE] - p.wheel_radius * (wheels[i, FORCE_X] + resistance)
        ) / p.spin_inertia
    dx[ROLL] = x[ROLL_RATE]
    dx[ROLL_RATE] = p.roll_frequency * (
        p.roll_frequency * (p.roll_gradient * specific_y - x[ROLL])
        - 2.0 * p.roll_damping * x[ROLL_RATE]
    )
    dx[LAGGED_X] = (specific_x - x[LAGGED_X]) / p.load_lag
    dx[LAGGED_Y] = (specific_y - x[LAGGED_Y]) / p.load_lag
    dx[YAW] = u[YAW_GAIN] * x[YAW_RATE] + u[YAW_OFFSET]
    along = u[ALONG_X] * x[V_X] + u[ALONG_Y] * x[V_Y]
    across = u[ACROSS_Y] * x[V_Y]
    cos_yaw = math.cos(x[YAW])
    sin_yaw = math.sin(x[YAW])
    dx[X] = cos_yaw * along - sin_yaw * across
    dx[Y] = sin_yaw * along + cos_yaw * across
    dx[DISTANCE] = x[V_X]
    dx[STEER] = u[STEER_RATE]


@numba.njit(cache=True, error_model="numpy", nogil=True)
def parts_of_step(x, u, p):  # type: ignore[no-untyped-def]
    """Return into how many parts a step must be cut: more at walking pace, else 1."""
    tyre = p.tyre_x * p.wheel_radius * p.wheel_radius / rolling_speed(x[V_X])
    stiffest = tyre
    for i in range(4):
        spin = x[WHEEL + i]
        if abs(spin) < 10.0 * SLOW_SPIN:
            near = spin * spin + SLOW_SPIN * SLOW_SPIN
            stiffest = max(stiffest, tyre - min(u[TORQUE + i], 0.0) / (near * math.sqrt(near)))
    return int(min(math.ceil(stiffest / p.spin_inertia * STEP / _STIFFEST), 100.0))


@numba.njit(cache=True, error_model="numpy", nogil=True)
def advance_step(x, u, p, wheels, work):  # type: ignore[no-untyped-def]
    """Advance the state by `STEP` in place, by the classical Runge-Kutta method.

    Parameters
    ----------
    x
        State, shape (STATES,).
    u
        Inputs, held, shape (INPUTS,).
    p
        Record of type `PLANT`.
    wheels
        Work space, shape (4, WHEEL_COLUMNS).
    work
        Work space, shape (3, STATES).
    """
    slope = work[0]
    total = work[1]
    trial = work[2]
    parts = parts_of_step(x, u, p)
    h = STEP / parts
    for _ in range(parts):
        derivative(x, u, p, wheels, slope)
        for j in range(STATES):
            total[j] = slope[j]
            trial[j] = x[j] + 0.5 * h * slope[j]
        derivative(trial, u, p, wheels, slope)
        for j in range(STATES):
            total[j] += 2.0 * slope[j]
            trial[j] = x[j] + 0.5 * h * slope[j]
        derivative(trial, u, p, wheels, slope)
        for j in range(STATES):
            total[j] += 2.0 * slope[j]
            trial[j] = x[j] + h * slope[j]
        derivative(trial, u, p, wheels, slope)
        for j in range(STATES):
            x[j] += h / 6.0 * (total[j] + slope[j])
