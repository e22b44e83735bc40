"""Torques, wheel speeds and accelerometer in, tyre forces of both axles out, fast ones included.

The torque gives the force of an axle whose wheels follow the car; what passes faster is seen by the
wheel speeds, through the slope of the tyre, and by the accelerometer. Each counts by the share of
its power that both have in common (the gain of a Wiener filter; Papoulis, Probability, Random
Variables, and Stochastic Processes, chapter 13).
"""

from __future__ import annotations

from math import exp, expm1

import numpy as np

from gripbench.compilation import compiled, inlined
from gripbench.envs.tyres.longitudinal import magic_formula_slope
from gripbench.envs.vehicles import GRAVITY
from gripbench.methods.blocks.inverse_slip import inverse_slip
from gripbench.methods.settings import Parameter

FORCE_STATE = np.dtype(
    [
        (name, np.float64)
        for name in (
            "steady_front", "steady_rear", "slope_front", "slope_rear", "slow_newton",
            "slow_front", "slow_rear", "newton_power", "wheel_power", "common_power",
        )
    ]
)  # fmt: skip
"""Forces that the wheels' inertia takes [N] and slopes of force to slip [N], which the method sets;
slow parts and powers of what is fast."""

FORCE_PARAMETERS = (
    Parameter("spin_share", 0.25, "1/s", "Wheel acceleration over speed that spins", 0.0, 5.0),
    Parameter("fast_time", 0.02, "s", "Forces that pass faster are seen directly", 1e-3, 1.0),
    Parameter("power_time", 0.5, "s", "Time over which their power is taken", 1e-2, 10.0),
)
"""Parameters of these forces."""


@inlined
def steady_turn(turn, wheel, rate, params):
    """Return a wheel's acceleration [rad/s^2]: that of the car unless the wheel spins or locks."""
    rolling = rate / params.wheel_radius
    return turn if abs(turn - rolling) > 10.0 + params.spin_share * abs(wheel) else rolling


@compiled
def tyre_slope(speed, rolling, peak, stiffness, force, params):
    """Return the slope of an axle's force to its slip [N].

    Parameters
    ----------
    speed, rolling
        Speeds of the car and of the wheel [m/s].
    peak
        Largest force [N].
    stiffness
        Logarithm of the stiffness over that on paper.
    force
        Present force [N].
    params
        Record with the Magic Formula factors, `bend_slip` and `lowest_speed`.
    """
    slip = (rolling - speed) / max(rolling, speed, params.lowest_speed)
    if abs(slip) < params.bend_slip:
        slip, _ = inverse_slip(force / peak, params)
    else:
        slip *= exp(stiffness)
    _, slope = magic_formula_slope(slip, params.magic_b, params.magic_c, params.magic_e)
    return max(peak * exp(stiffness) * slope, 1.0)


@compiled
def write_forces(state, obs, speed, accel, ratio, params, est):
    """Write the longitudinal force of both axles.

    Parameters
    ----------
    state
        Record of `FORCE_STATE`.
    obs
        Record with torques, wheel speeds and the clock.
    speed
        Longitudinal speed [m/s].
    accel
        Specific force along x [m/s^2].
    ratio
        Mass over that on paper.
    params
        Record with `FORCE_PARAMETERS`, `lowest_speed` and the car on paper.
    """
    radius = params.wheel_radius
    front = obs.torque_front / radius + state.steady_front
    rear = obs.torque_rear / radius + state.steady_rear
    speed = max(speed, params.lowest_speed)
    mass = params.mass * ratio
    newton = mass * (accel + params.rolling_resistance * GRAVITY)
    newton += params.drag * speed * speed - front - rear
    ratio_front = radius * obs.wheel_speed_front / speed
    ratio_rear = radius * obs.wheel_speed_rear / speed
    share = -expm1(-obs.elapsed / params.fast_time)
    if obs.first or state.slope_front == 0.0 or state.slow_front == 0.0:
        share = 1.0
    state.slow_newton += share * (newton - state.slow_newton)
    state.slow_front += share * (ratio_front - state.slow_front)
    state.slow_rear += share * (ratio_rear - state.slow_rear)
    newton -= state.slow_newton
    # the slope moves with the friction: only what is left of the ratio is taken by it
    wheel_front = state.slope_front * (ratio_front - state.slow_front)
    wheel_rear = state.slope_rear * (ratio_rear - state.slow_rear)
    wheels = wheel_front + wheel_rear
    memory = -expm1(-obs.elapsed / params.power_time)
    state.newton_power += memory * (newton * newton - state.newton_power)
    state.wheel_power += memory * (wheels * wheels - state.wheel_power)
    state.common_power += memory * (newton * wheels - state.common_power)
    common = max(state.common_power, 0.0)
    trust_wheels = min(common / max(state.wheel_power, 1e-9), 1.0)
    trust_newton = min(common / max(state.newton_power, 1e-9), 1.0)
    rest = trust_newton * (newton - trust_wheels * wheels)
    squares = state.slope_front**2 + state.slope_rear**2
    part = state.slope_front**2 / squares if squares > 0.0 else 0.5
    est.force_x_front = front + trust_wheels * wheel_front + part * rest
    est.force_x_rear = rear + trust_wheels * wheel_rear + (1.0 - part) * rest
