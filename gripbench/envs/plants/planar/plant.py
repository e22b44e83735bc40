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

import numpy as np
import numpy.typing as npt

from gripbench.compilation import compiled
from gripbench.envs.tyres.combined import SHAPES, combined_force
from gripbench.envs.vehicles import GRAVITY, CarOnRoad, Vehicle, on_road, require
from gripbench.errors import InputError

V_X, V_Y, YAW_RATE, WHEEL, ROLL, ROLL_RATE, LAGGED_X, LAGGED_Y = 0, 1, 2, 3, 7, 8, 9, 10
YAW, X, Y, DISTANCE, STEER, STATES = 11, 12, 13, 14, 15, 16

STEER_RATE, TORQUE, MU, GRAVITY_X, GRAVITY_Y, NORMAL = 0, 1, 5, 9, 10, 11
YAW_OFFSET, YAW_GAIN, ALONG_X, ALONG_Y, ACROSS_Y = 12, 13, 14, 15, 16
BANK, GRADE, BANK_RATE, GRADE_RATE, GROWTH, INPUTS = 17, 18, 19, 20, 21, 25

FORCE_X, FORCE_Y, LOAD, LON_SPEED, LAT_SPEED, APPLIED_TORQUE = 0, 1, 2, 3, 4, 5
UNCLIPPED_LOAD, RESISTANCE, WHEEL_COLUMNS = 6, 7, 8

STEP = 1e-3
"""Integration step [s]."""

SLOW_ROLLING = 1.0
"""Rolling speed [m/s] below which the denominator of the slip is regularised."""

SLOW_SPIN = 0.2
"""Wheel speed [rad/s] within which brake torque passes through zero."""

_MOST_PARTS = 100  # of a step
_STIFFEST = 1.5  # largest product of step and eigenvalue; fourth-order Runge-Kutta bears 2.78

PLANT = np.dtype(
    [
        (name, np.float64)
        for name in (
            "mass",
            "yaw_inertia",
            "cg_to_front",
            "cg_to_rear",
            "mass_front",  # that the front axle carries at rest
            "mass_rear",
            "transfer_x",  # load from the front to the rear axle over specific force
            "transfer_front",  # load from the left to the right wheel over specific force
            "transfer_rear",
            "inverse_mass",
            "inverse_yaw_inertia",
            "inverse_spin_inertia",
            "inverse_load_lag",
            "track_front",
            "track_rear",
            "wheel_radius",
            "radius_front",  # of the axle's own tyres
            "radius_rear",
            "peak_front",  # friction that the axle's tyres find over the road's
            "peak_rear",
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
            "pitch_gradient",
            "drive_share_front",
            "brake_share_front",
            "steer_limit",
            "steer_rate_limit",
        )
    ]
    + [("shape", np.int64)]
)
"""What the compiled plant knows of the vehicle."""


PARAMETERS = (
    "mass",
    "yaw_inertia",
    "cg_to_front",
    "cg_to_rear",
    "cg_height",
    "track_front",
    "track_rear",
    "wheel_radius",
    "wheel_inertia",
    "drag",
    "rolling_resistance",
    "longitudinal_stiffness",
    "cornering_stiffness_front",
    "cornering_stiffness_rear",
    "stiffness_load_exponent",
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
"""Vehicle parameters that the planar plant needs."""


def plant_record(tyre: str, vehicle: Vehicle | CarOnRoad) -> npt.NDArray[np.void]:
    """Return what the compiled plant needs of a vehicle, one record of `PLANT`.

    Parameters
    ----------
    tyre
        Name of the tyre's shape, a key of `SHAPES`.
    vehicle
        The car on the road, with every parameter of `PARAMETERS`.

    Raises
    ------
    InputError
        If the vehicle lacks a parameter, or its wheels are too light for the step.
    """
    car = on_road(vehicle)
    given = require(car.values(), PARAMETERS, "the planar plant")
    record = np.zeros(1, PLANT)
    for name in set(PLANT.names or ()) & set(given):
        record[name] = given[name]
    for axle in ("front", "rear"):
        record[f"radius_{axle}"] = given["wheel_radius"] * getattr(car, f"radius_{axle}")
        record[f"peak_{axle}"] = getattr(car, f"peak_{axle}")
    mass, height = given["mass"], given["cg_height"]
    base = given["cg_to_front"] + given["cg_to_rear"]
    share = given["roll_share_front"]
    record["mass_front"] = mass * given["cg_to_rear"] / base
    record["mass_rear"] = mass * given["cg_to_front"] / base
    record["transfer_x"] = mass * height / base
    record["transfer_front"] = mass * height * share / given["track_front"]
    record["transfer_rear"] = mass * height * (1.0 - share) / given["track_rear"]
    record["inverse_mass"] = 1.0 / mass
    record["inverse_yaw_inertia"] = 1.0 / given["yaw_inertia"]
    record["inverse_load_lag"] = 1.0 / given["load_lag"]
    record["spin_inertia"] = 0.5 * given["wheel_inertia"]
    record["inverse_spin_inertia"] = 2.0 / given["wheel_inertia"]
    record["tyre_x"] = 0.5 * given["longitudinal_stiffness"]
    record["tyre_y_front"] = 0.5 * given["cornering_stiffness_front"]
    record["tyre_y_rear"] = 0.5 * given["cornering_stiffness_rear"]
    record["load_exponent"] = given["stiffness_load_exponent"]
    record["shape"] = SHAPES[tyre]
    tyre_rate = given["longitudinal_stiffness"] * given["wheel_radius"] ** 2
    lightest = tyre_rate * STEP / (0.5 * SLOW_ROLLING * _STIFFEST * _MOST_PARTS)
    if given["wheel_inertia"] < lightest:
        raise InputError(
            f"vehicle parameter 'wheel_inertia' is {given['wheel_inertia']:g} kg m^2: too small "
            f"for its tyres' stiffness; allowed is {lightest:.3g} and above"
        )
    return record


@compiled
def rolling_speed(speed):
    """Return |speed|, below `SLOW_ROLLING` a parabola with half of it as its least value."""
    size = abs(speed)
    if size >= SLOW_ROLLING:
        return size
    return 0.5 * (SLOW_ROLLING + size * size / SLOW_ROLLING)


@compiled
def wheel_forces(x, u, p, wheels):
    """Fill `wheels`, shape (4, WHEEL_COLUMNS); return force along x and y [N], moment [N m].

    The force along x includes the wind's drag, not gravity.
    """
    transfer = x[LAGGED_X] * p.transfer_x
    cos_steer = math.cos(x[STEER])
    sin_steer = math.sin(x[STEER])
    total_x = -p.drag * x[V_X] * abs(x[V_X])
    total_y = 0.0
    moment = 0.0
    for i in range(4):
        if i < 2:
            axle = u[NORMAL] * p.mass_front - transfer
            aside = x[LAGGED_Y] * p.transfer_front
            offset_x = p.cg_to_front
            offset_y = 0.5 * p.track_front
            stiffness = p.tyre_y_front
            radius = p.radius_front
        else:
            axle = u[NORMAL] * p.mass_rear + transfer
            aside = x[LAGGED_Y] * p.transfer_rear
            offset_x = -p.cg_to_rear
            offset_y = 0.5 * p.track_rear
            stiffness = p.tyre_y_rear
            radius = p.radius_rear
        if i % 2 == 1:
            aside = -aside
            offset_y = -offset_y
        axle = max(axle, 0.0)
        unclipped = 0.5 * axle - aside
        load = min(max(unclipped, 0.0), axle)
        speed_x = x[V_X] - x[YAW_RATE] * offset_y
        speed_y = x[V_Y] + x[YAW_RATE] * offset_x
        if i < 2:
            turned = cos_steer * speed_x + sin_steer * speed_y
            speed_y = cos_steer * speed_y - sin_steer * speed_x
            speed_x = turned
        spin = x[WHEEL + i]
        rolling = radius * spin
        inverse = 1.0 / rolling_speed(rolling)
        force_x, force_y = combined_force(
            p.shape,
            (rolling - speed_x) * inverse,
            -speed_y * inverse,
            p.tyre_x * u[GROWTH + i],
            stiffness * u[GROWTH + i],
            u[MU + i] * load,
        )
        # A negative torque is a brake's: it opposes the wheel whichever way that turns.
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
        wheels[i, RESISTANCE] = p.rolling_resistance * load * sense
        if i < 2:
            turned = cos_steer * force_x - sin_steer * force_y
            force_y = sin_steer * force_x + cos_steer * force_y
            force_x = turned
        total_x += force_x
        total_y += force_y
        moment += offset_x * force_y - offset_y * force_x
    return total_x, total_y, moment


@compiled
def hold_stiffness(x, p, u):
    """Write the stiffness of each tyre under its present load, over that at its static load.

    It changes as slowly as the lagged loads and is an input that is held for a step.
    """
    transfer = x[LAGGED_X] * p.transfer_x
    for i in range(4):
        if i < 2:
            axle = u[NORMAL] * p.mass_front - transfer
            aside = x[LAGGED_Y] * p.transfer_front
            nominal = 0.5 * GRAVITY * p.mass_front
        else:
            axle = u[NORMAL] * p.mass_rear + transfer
            aside = x[LAGGED_Y] * p.transfer_rear
            nominal = 0.5 * GRAVITY * p.mass_rear
        if i % 2 == 1:
            aside = -aside
        axle = max(axle, 0.0)
        load = min(max(0.5 * axle - aside, 0.0), axle)
        u[GROWTH + i] = (load / nominal) ** p.load_exponent


@compiled
def derivative(x, u, p, wheels, dx):
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
    force_x, force_y, moment = wheel_forces(x, u, p, wheels)
    specific_x = force_x * p.inverse_mass
    specific_y = force_y * p.inverse_mass
    dx[V_X] = specific_x + u[GRAVITY_X] + x[YAW_RATE] * x[V_Y]
    dx[V_Y] = specific_y + u[GRAVITY_Y] - x[YAW_RATE] * x[V_X]
    dx[YAW_RATE] = moment * p.inverse_yaw_inertia
    for i in range(4):
        radius = p.radius_front if i < 2 else p.radius_rear
        braking = radius * (wheels[i, FORCE_X] + wheels[i, RESISTANCE])
        dx[WHEEL + i] = (wheels[i, APPLIED_TORQUE] - braking) * p.inverse_spin_inertia
    dx[ROLL] = x[ROLL_RATE]
    dx[ROLL_RATE] = p.roll_frequency * (
        p.roll_frequency * (p.roll_gradient * specific_y - x[ROLL])
        - 2.0 * p.roll_damping * x[ROLL_RATE]
    )
    dx[LAGGED_X] = (specific_x - x[LAGGED_X]) * p.inverse_load_lag
    dx[LAGGED_Y] = (specific_y - x[LAGGED_Y]) * p.inverse_load_lag
    dx[YAW] = u[YAW_GAIN] * x[YAW_RATE] + u[YAW_OFFSET]
    along = u[ALONG_X] * x[V_X] + u[ALONG_Y] * x[V_Y]
    across = u[ACROSS_Y] * x[V_Y]
    cos_yaw = math.cos(x[YAW])
    sin_yaw = math.sin(x[YAW])
    dx[X] = cos_yaw * along - sin_yaw * across
    dx[Y] = sin_yaw * along + cos_yaw * across
    dx[DISTANCE] = x[V_X]
    dx[STEER] = u[STEER_RATE]


@compiled
def parts_of_step(x, u, p):
    """Return into how many parts a step must be cut: more at walking pace, else 1."""
    tyre = p.tyre_x * p.wheel_radius * p.wheel_radius / rolling_speed(x[V_X])
    stiffest = tyre
    for i in range(4):
        spin = x[WHEEL + i]
        if abs(spin) < 10.0 * SLOW_SPIN:
            near = spin * spin + SLOW_SPIN * SLOW_SPIN
            steepness = SLOW_SPIN * SLOW_SPIN / (near * math.sqrt(near))
            stiffest = max(stiffest, tyre - min(u[TORQUE + i], 0.0) * steepness)
    return int(min(math.ceil(stiffest / p.spin_inertia * STEP / _STIFFEST), _MOST_PARTS))


@compiled
def advance_step(x, u, p, wheels, work):
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
