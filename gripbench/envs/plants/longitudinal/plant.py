"""The longitudinal plant: Li, Du & Li (2014), eq. 2-6, one function of state and inputs.

State: velocity v_x [m/s] and the angular velocities of the front and rear axle [rad/s].

Errata and departures: one signed torque serves eq. 2 (traction) and eq. 3 (braking); below
`HOLD_SPEED` the rolling resistance and the brake torque fade with speed, so that a vehicle comes
to rest instead of being pushed backwards by its brakes; above it the equations are the printed
ones. Table III's C_r = 1.5 is replaced in the vehicle's file.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import sin

import numpy as np

from gripbench.compilation import compiled, inlined
from gripbench.envs.tyres.combined import MAGIC_FORMULA, SHAPES, secant, tangent
from gripbench.envs.tyres.longitudinal import (
    magic_formula,
    magic_formula_slope,
    slip_ratio,
    slip_ratio_slopes,
)
from gripbench.envs.vehicles import GRAVITY, CarOnRoad, require

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

_DERIVED = (
    "load_front",
    "load_rear",
    "per_mass",
    "per_inertia",
    "radius_front",
    "radius_rear",
    "lever_front",
    "lever_rear",
    "peak_front",
    "peak_rear",
    "initial_slope",
)

PLANT_TYPE = np.dtype(
    [*((name, np.float64) for name in (*PLANT_PARAMETERS, *_DERIVED)), ("tyre", np.int64)]
)
"""What the compiled plant knows of the car on the road; its own friction over the road's is `peak`,
the slope of its force curve at zero slip over mu F_z is `initial_slope`."""

INPUT_TYPE = np.dtype(
    [
        (name, np.float64)
        for name in (
            "torque_front",
            "torque_rear",
            "mu_front",
            "mu_rear",
            "road_grade",
            "distance",
        )
    ]
)
"""What acts on the plant during one interval: axle torques [N m], friction, road grade [rad]; and
the distance [m] along the road at which it begins."""

TYRE_TYPE = np.dtype(
    [
        (name, np.float64)
        for name in ("front", "front_wheel", "front_speed", "rear", "rear_wheel", "rear_speed")
    ]
)
"""Force of each axle over its peak mu F_z, and its slopes to wheel speed and speed."""


def plant_record(
    vehicle: Mapping[str, float] | CarOnRoad, tyre: str = "magic_formula"
) -> np.ndarray:
    """Return the plant's parameters as a record array of length 1; static axle loads by eq. 6.

    Parameters
    ----------
    vehicle
        The car on the road, or its parameters alone.
    tyre
        Shape of its tyres' force curve, a key of `gripbench.envs.tyres.combined.SHAPES`. All have
        the slope B C at zero slip; `magic_formula` is the one with the car's own C and E.
    """
    car = vehicle if isinstance(vehicle, CarOnRoad) else CarOnRoad(dict(vehicle))
    given = require(car.values(), PLANT_PARAMETERS, "the longitudinal plant")
    plant = np.zeros(1, PLANT_TYPE)
    for name, value in given.items():
        plant[name] = value
    weight = given["mass"] * GRAVITY
    wheelbase = given["cg_to_front"] + given["cg_to_rear"]
    plant["load_front"] = weight * given["cg_to_rear"] / wheelbase
    plant["load_rear"] = weight * given["cg_to_front"] / wheelbase
    plant["per_mass"] = 1.0 / given["mass"]
    plant["per_inertia"] = 1.0 / given["wheel_inertia"]
    for axle in ("front", "rear"):
        radius = given["wheel_radius"] * getattr(car, f"radius_{axle}")
        plant[f"radius_{axle}"] = radius
        plant[f"lever_{axle}"] = radius / given["wheel_inertia"]
        plant[f"peak_{axle}"] = getattr(car, f"peak_{axle}")
    plant["initial_slope"] = given["magic_b"] * given["magic_c"]
    plant["tyre"] = SHAPES[tyre]
    return plant


@inlined
def _fade(speed):
    return max(-1.0, min(1.0, speed / HOLD_SPEED))


@inlined
def _fade_slope(speed):
    return 1.0 / HOLD_SPEED if abs(speed) < HOLD_SPEED else 0.0


@inlined
def _wheel_torque(torque, wheel_speed, radius):
    """Return the torque that acts: a brake (negative torque) only opposes the rotation."""
    return torque if torque >= 0.0 else torque * _fade(wheel_speed * radius)


@inlined
def _share_of_peak(slip, plant):
    """Return the tyre force over its peak mu F_z."""
    if plant.tyre == MAGIC_FORMULA:
        return magic_formula(slip, plant.magic_b, plant.magic_c, plant.magic_e)
    normalised = plant.initial_slope * slip
    return secant(plant.tyre, abs(normalised)) * normalised


@inlined
def tyre_force(wheel_speed, speed, mu, load, radius, plant):
    """Return the longitudinal tyre force of an axle [N], eq. 4-5."""
    return mu * load * _share_of_peak(slip_ratio(radius * wheel_speed, speed), plant)


@inlined
def gravity_along(inputs):
    """Return gravity's component along the road [m/s^2], positive downhill."""
    return GRAVITY * sin(inputs.road_grade)


@inlined
def rates(speed, front, rear, force_front, force_rear, gravity, inputs, plant):
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
    speed_rate = (
        (force_front + force_rear - plant.drag * speed * abs(speed)) * plant.per_mass
        - plant.rolling_resistance * GRAVITY * _fade(speed)
        + gravity
    )
    torque_front = _wheel_torque(inputs.torque_front, front, plant.radius_front)
    torque_rear = _wheel_torque(inputs.torque_rear, rear, plant.radius_rear)
    front_rate = torque_front * plant.per_inertia - force_front * plant.lever_front
    rear_rate = torque_rear * plant.per_inertia - force_rear * plant.lever_rear
    return speed_rate, front_rate, rear_rate


@inlined
def state_rates(speed, front, rear, gravity, inputs, plant):
    """Return the time derivative of the state, eq. 2-5; arguments as for `rates`."""
    force_front = tyre_force(
        front, speed, inputs.mu_front, plant.load_front, plant.radius_front, plant
    )
    force_rear = tyre_force(rear, speed, inputs.mu_rear, plant.load_rear, plant.radius_rear, plant)
    return rates(speed, front, rear, force_front, force_rear, gravity, inputs, plant)


@compiled
def derivatives(x, inputs, plant, dx):
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


@inlined
def _tyre_slopes(wheel_speed, speed, radius, plant):
    """Return an axle's force over its peak, and its slopes to wheel speed and speed."""
    rolling = radius * wheel_speed
    slip = slip_ratio(rolling, speed)
    if plant.tyre == MAGIC_FORMULA:
        share, slope = magic_formula_slope(slip, plant.magic_b, plant.magic_c, plant.magic_e)
    else:
        normalised = plant.initial_slope * slip
        share = secant(plant.tyre, abs(normalised)) * normalised
        slope = plant.initial_slope * tangent(plant.tyre, abs(normalised))
    to_rolling, to_speed = slip_ratio_slopes(rolling, speed)
    return share, slope * to_rolling * radius, slope * to_speed


@compiled
def evaluate_tyres(x, plant, tyres):
    """Write a record of `TYRE_TYPE`: the tyres at a state, whatever the friction."""
    tyres.front, tyres.front_wheel, tyres.front_speed = _tyre_slopes(
        x[1], x[0], plant.radius_front, plant
    )
    tyres.rear, tyres.rear_wheel, tyres.rear_speed = _tyre_slopes(
        x[2], x[0], plant.radius_rear, plant
    )


@inlined
def _torque_slope(torque, wheel_speed, radius):
    return 0.0 if torque >= 0.0 else torque * radius * _fade_slope(wheel_speed * radius)


@inlined
def jacobian(speed, front, rear, inputs, plant, tyres):
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
    drag_slope = 2.0 * plant.drag * abs(speed)
    brake_front = _torque_slope(inputs.torque_front, front, plant.radius_front)
    brake_rear = _torque_slope(inputs.torque_rear, rear, plant.radius_rear)
    return (
        (front_speed + rear_speed - drag_slope) * plant.per_mass
        - plant.rolling_resistance * GRAVITY * _fade_slope(speed),
        front_wheel * plant.per_mass,
        rear_wheel * plant.per_mass,
        -front_speed * plant.lever_front,
        brake_front * plant.per_inertia - front_wheel * plant.lever_front,
        -rear_speed * plant.lever_rear,
        brake_rear * plant.per_inertia - rear_wheel * plant.lever_rear,
    )
