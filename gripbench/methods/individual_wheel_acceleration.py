"""Individual wheel estimation, algorithm 2: Li, Du & Li (2014), eq. 22 ("Method 3").

Three equations for three unknowns, the two axle forces and the total torque. With equal shares of
the torque, c = d = 1/2, the torque drops out::

    F_f + F_r = m a_x + C_r m g + D_a v^2
    F_f - F_r = I (w_r_dot - w_f_dot) / R

Corrected here: `a_x` is the accelerometer's reading, so the gradient's term goes; the difference
of the wheel accelerations, which the paper takes raw, passes a low-pass of `difference_time`,
because jumps of the wheel speed of 0.01 rad/s in a millisecond are 30 N otherwise.
"""

from __future__ import annotations

from math import expm1

import numpy as np

from gripbench.methods.blocks.axle_friction import (
    AXLE_FRICTION_PARAMETERS,
    AXLE_FRICTION_STATE,
    AXLE_FRICTION_VEHICLE,
    MAGIC_FORMULA,
    PRINTED,
    RESISTANCE_PARAMETERS,
    axle_slips,
    estimate_friction,
    start_friction,
    total_force,
    unread_tyre,
)
from gripbench.methods.contract import CompiledMethod, Parameter, compiled

_NAMES = (
    "wheel_speed_front",
    "wheel_speed_rear",
    "difference",
    *AXLE_FRICTION_STATE,
)
STATE = np.dtype([(name, np.float64) for name in _NAMES])


@compiled
def start(state, params):
    """Set the first covariances."""
    start_friction(state, params)


@compiled
def step(state, obs, params, est):
    """Take one sample: forces by eq. 22, slip by eq. 5, friction by eq. 11-15."""
    elapsed = obs.elapsed
    if elapsed > 0.0:
        raw = (obs.wheel_speed_rear - state.wheel_speed_rear) - (
            obs.wheel_speed_front - state.wheel_speed_front
        )
        share = 1.0
        if params.difference_time > 0.0:
            share = -expm1(-elapsed / params.difference_time)
        state.difference += share * (raw / elapsed - state.difference)
    state.wheel_speed_front, state.wheel_speed_rear = obs.wheel_speed_front, obs.wheel_speed_rear
    half_total = 0.5 * total_force(obs.accel_x, obs.speed_gps, params)
    half_difference = 0.5 * params.wheel_inertia * state.difference / params.wheel_radius
    est.force_x_front = half_total + half_difference
    est.force_x_rear = half_total - half_difference
    slip_front, slip_rear = axle_slips(
        obs.wheel_speed_front, obs.wheel_speed_rear, obs.speed_gps, params
    )
    estimate_friction(state, est, slip_front, slip_rear, elapsed, params)


class IndividualWheelAcceleration(CompiledMethod):
    """Tyre force of each axle from the accelerometer and differenced wheel speeds."""

    name = "individual_wheel_acceleration"
    title = "Individual wheel, algorithm 2 (Method 3)"
    reference = "Li, Du & Li (2014), Section III.C, eq. 22"
    sensors = ("wheel_speed_front", "wheel_speed_rear", "accel_x", "speed_gps")
    estimates = ("force_x_front", "force_x_rear", "mu_front", "mu_rear")
    vehicle_parameters = (
        *AXLE_FRICTION_VEHICLE,
        *RESISTANCE_PARAMETERS,
        "wheel_radius",
        "wheel_inertia",
    )
    unread = staticmethod(unread_tyre)
    parameters = (
        *AXLE_FRICTION_PARAMETERS,
        Parameter("difference_time", 0.1, "s", "Low-pass of the differenced wheel speeds", 0.0),
    )
    variants = {
        "paper": PRINTED | {"difference_time": 0.0},
        "magic_formula": MAGIC_FORMULA,
    }
    state = STATE
    start = staticmethod(start)
    step = staticmethod(step)
