"""The longitudinal plant: Li, Du & Li (2014), eq. 2-6, one function of state and inputs.

State: velocity v_x [m/s] and the angular velocities of the front and rear axle [rad/s].

Errata and departures: one signed torque serves eq. 2 (traction) and eq. 3 (braking); below
`HOLD_SPEED` the rolling resistance and the brake torque fade with speed, so that a vehicle comes
to rest instead of being pushed backwards by its brakes; above it the equations are the printed
ones. Table III's C_r = 1.5 is replaced in the vehicle's file.
"""

from __future__ import annotations

from math import sin

import numba
import numpy as np

from gripbench.envs.tyres.longitudinal import (
    magic_formula,
    magic_formula_slope,
    slip_ratio,
    slip_ratio_slopes,
)
from gripbench.envs.vehicles import GRAVITY, require

HOLD_SPEED = 0.05
"""Speed [m/s] below which resistances that oppose the motion fade to zero."""

PLANT_PARAMETERS = (
    "mass",
    "cg_to_front",
    "cg_to_rear",
    "wheel_radius",
    "wheel_inertia",
    "drag",
    "rolling_resistance",
    "magic_b",
    "magic_c",
    "magic_e",
)

_RECIPROCALS = ("per_mass", "per_inertia", "lever")

PLANT_TYPE = np.dtype(
    [(name, np.float64) for name in (*PLANT_PARAMETERS, "load_front", "load_rear", *_RECIPROCALS)]
)

INPUT_TYPE = np.dtype(
    [
        (name, np.float64)
        for name in ("torque_front", "torque_rear", "mu_front", "mu_rear", "road_grade")
    ]
)
"""What acts on the plant during one interval: axle torques [N m], friction, road grade [rad]."""

TYRE_TYPE = np.dtype(
    [
        (name, np.float64)
        for name in ("front", "front_wheel", "front_speed", "rear", "rear_wheel", "rear_speed")
    ]
)
"""Force of each axle over its peak mu F_z, and its slopes to wheel speed and speed."""

compiled = numba.njit(cache=True, error_model="numpy", nogil=True)
_inline = numba.njit(inline="always", error_model="numpy")


def plant_record(vehicle: dict[str, float]) -> np.ndarray:
    """Return the plant's parameters as a record array of length 1; static axle loads by eq. 6."""
    given = require(vehicle, PLANT_PARAMETERS, "the longitudinal plant")
    plant = np.zeros(1, PLANT_TYPE)
    for name, value in given.items():
        plant[name] = value
    weight = given["mass"] * GRAVITY
    wheelbase = given["cg_to_front"] + given["cg_to_rear"]
    plant["load_front"] = weight * given["cg_to_rear"] / wheelbase
    plant["load_rear"] = weight * given["cg_to_front"] / wheelbase
    plant["per_mass"] = 1.0 / given["mass"]
    plant["per_inertia"] = 1.0 / given["wheel_inertia"]
    plant["lever"] = given["wheel_radius"] / given["wheel_inertia"]
    return plant


@_inline
def _fade(speed):  # type: ignore[no-untyped-def]
    return max(-1.0, min(1.0, speed / HOLD_SPEED))


@_inline
def _fade_slope(speed):  # type: ignore[no-untyped-def]
    return 1.0 / HOLD_SPEED if abs(speed) < HOLD_SPEED else 0.0


@_inline
def _wheel_torque(torque, wheel_speed, radius):  # type: ignore[no-untyped-def]
    """Return the torque that acts: a brake (negative torque) only opposes the rotation."""
    return torque if torque >= 0.0 else torque * _fade(wheel_speed * radius)


@_inline
def tyre_force(wheel_speed, speed, mu, load, plant):  # type: ignore[no-untyped-def]
    """Return the longitudinal tyre force of an axle [N], eq. 4-5."""
    slip = slip_ratio(plant.wheel_radius * wheel_speed, speed)
    return mu * load * magic_formula(slip, plant.magic_b, plant.magic_c, plant.magic_e)


@_inline
def gravity_along(inputs):  # type: ignore[no-untyped-def]
    """Return gravity's component along the road [m/s^2], positive downhill."""
    return GRAVITY * sin(inputs.road_grade)


@_inline
def rates(speed, front, rear, force_front, force_rear, gravity, inputs, plant):  # type: ignore[no-untyped-def]
    """Return the time derivative of the state for given tyre forces, eq. 2-3.

    Parameters
    ----------
    speed, front, rear
        The state: velocity [m/s] and the axles' angular velocities [rad/s].
    force_front, force_rear
        Longitudinal tyre forces [N].
    gravity
        Gravity's component along the road [m/s^2], see `gravity_along`.
    inputs, plant
        Records of `INPUT_TYPE` and `PLANT_TYPE`.
    """
    radius = plant.wheel_radius
    speed_rate = (
        (force_front + force_rear - plant.drag * speed * abs(speed)) * plant.per_mass
        - plant.rolling_resistance * GRAVITY * _fade(speed)
        + gravity
    )
    torque_front = _wheel_torque(inputs.torque_front, front, radius)
    torque_rear = _wheel_torque(inputs.torque_rear, rear, radius)
    front_rate = torque_front * plant.per_inertia - force_front * plant.lever
    rear_rate = torque_rear * plant.per_inertia - force_rear * plant.lever
    return speed_rate, front_rate, rear_rate


@_inline
def state_rates(speed, front, rear, gravity, inputs, plant):  # type: ignore[no-untyped-def]
    """Return the time derivative of the state, eq. 2-5; arguments as for `rates`."""
    force_front = tyre_force(front, speed, inputs.mu_front, plant.load_front, plant)
    force_rear = tyre_force(rear, speed, inputs.mu_rear, plant.load_rear, plant)
    return rates(speed, front, rear, force_front, force_rear, gravity, inputs, plant)


@compiled
def derivatives(x, inputs, plant, dx):  # type: ignore[no-untyped-def]
    """Write the time derivative of the state, eq. 2-5.

    Parameters
    ----------
    x
        State, shape (3,).
    inputs
        Record of `INPUT_TYPE`.
    plant
        Record of `PLANT_TYPE`.
    dx
        Output, shape (3,).
    """
    dx[0], dx[1], dx[2] = state_rates(x[0], x[1], x[2], gravity_along(inputs), inputs, plant)


@_inline
def _tyre_slopes(wheel_speed, speed, plant):  # type: ignore[no-untyped-def]
    """Return an axle's force over its peak, and its slopes to wheel speed and speed."""
    rolling = plant.wheel_radius * wheel_speed
    slip = slip_ratio(rolling, speed)
    share, slope = magic_formula_slope(slip, plant.magic_b, plant.magic_c, plant.magic_e)
    to_rolling, to_speed = slip_ratio_slopes(rolling, speed)
    return share, slope * to_rolling * plant.wheel_radius, slope * to_speed


@compiled
def evaluate_tyres(x, plant, tyres):  # type: ignore[no-untyped-def]
    """Write a record of `TYRE_TYPE`: the tyres at a state, whatever the friction."""
    tyres.front, tyres.front_wheel, tyres.front_speed = _tyre_slopes(x[1], x[0], plant)
    tyres.rear, tyres.rear_wheel, tyres.rear_speed = _tyre_slopes(x[2], x[0], plant)


@_inline
def _torque_slope(torque, wheel_speed, radius):  # type: ignore[no-untyped-def]
    return 0.0 if torque >= 0.0 else torque * radius * _fade_slope(wheel_speed * radius)


@_inline
def jacobian(speed, front, rear, inputs, plant, tyres):  # type: ignore[no-untyped-def]
    """Return the Jacobian of the time derivative: an arrow, because the axles do not couple.

    Parameters
    ----------
    speed, front, rear
        The state.
    inputs, plant
        Records of `INPUT_TYPE` and `PLANT_TYPE`.
    tyres
        Record of `TYRE_TYPE` that belongs to the state.

    Returns
    -------
    The elements (0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (2, 0) and (2, 2); the others are zero.
    """
    peak_front = inputs.mu_front * plant.load_front
    peak_rear = inputs.mu_rear * plant.load_rear
    front_wheel, front_speed = peak_front * tyres.front_wheel, peak_front * tyres.front_speed
    rear_wheel, rear_speed = peak_rear * tyres.rear_wheel, peak_rear * tyres.rear_speed
    radius = plant.wheel_radius
    drag_slope = 2.0 * plant.drag * abs(speed)
    brake_front = _torque_slope(inputs.torque_front, front, radius)
    brake_rear = _torque_slope(inputs.torque_rear, rear, radius)
    return (
        (front_speed + rear_speed - drag_slope) * plant.per_mass
        - plant.rolling_resistance * GRAVITY * _fade_slope(speed),
        front_wheel * plant.per_mass,
        rear_wheel * plant.per_mass,
        -front_speed * plant.lever,
        brake_front * plant.per_inertia - front_wheel * plant.lever,
        -rear_speed * plant.lever,
        brake_rear * plant.per_inertia - rear_wheel * plant.lever,
    )
