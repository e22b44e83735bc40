"""The proposed observer: Li, Du & Li (2014), Section VI, eq. 23-29 and Figure 19.

Three stages without GPS: a velocity observer whose acceleration feedback has a high gain K_a
(eq. 24), a stiffness k = F/s that the balance of forces adapts with the gain K_e (eq. 28-29,
Figure 19), and the regression of eq. 11-15 on its forces.

Corrected here:

- Eq. 24: the argument of Sat must be R w_f - v_hat. With d = 0.1 m/s (eq. 25) the estimate sticks
  at R w - 0.1 although the true slip speed is some 0.02 m/s. Its limit for d to 0, the sign of
  the torque, replaces it: T Sat is then the signed torque.
- Eq. 27: its last term must not carry the velocity error; what remains shows that only the drag
  makes v_hat converge, with the rate 2 (1 + K_a) D_a v/m. An accelerometer bias b shifts v^2 by
  b m/D_a.
- Eq. 29: with an accelerometer, which reads v_dot - g sin(theta), no term of the gradient belongs
  in the balance.
- Figure 19's law k_dot = -K_e e is unstable for negative slip; here k_dot = -K_e sign(s) e.
- Eq. 28b: F_sr is F_zr.
- The observer is fed wheel accelerations. The paper's are those of its model, which no sensor
  gives: the variant `paper` declares them as idealised channels. By default they are differences
  of the measured wheel speeds behind a low-pass of `difference_time`, and K_a is small, because
  an error of the wheel acceleration of 1 rad/s^2 shifts v^2 by I/(R D_a) = 14 m^2/s^2 whatever
  the gain is; a small gain averages it.

Both stages are stiff (K_a = 8e5 has a pole of 5000/s at 10 m/s) and are stepped by backward Euler
in closed form.
"""

from __future__ import annotations

from math import expm1, sin, sqrt

import numpy as np

from gripbench.compilation import inlined
from gripbench.envs.vehicles import GRAVITY
from gripbench.methods.blocks.axle_friction import (
    AXLE_FRICTION_PARAMETERS,
    AXLE_FRICTION_STATE,
    AXLE_FRICTION_VEHICLE,
    PRINTED,
    RESISTANCE_PARAMETERS,
    axle_slips,
    estimate_friction,
    front_load,
    rear_load,
    start_friction,
    total_force,
    unread_tyre,
)
from gripbench.methods.contract import CompiledMethod, Parameter, Variant, compiled

SMALL_SLIP = 1e-5
"""Slip ratio below which the normalised law of the stiffness fades out."""


_NAMES = (
    "speed",
    "accel_x",
    "stiffness",
    "wheel_speed_front",
    "wheel_speed_rear",
    "wheel_acceleration",
    *AXLE_FRICTION_STATE,
)
STATE = np.dtype([(name, np.float64) for name in _NAMES])


@inlined
def observed_speed(
    speed, torque, wheel_acceleration, accel_x, mean_accel_x, grade, elapsed, params
):
    """Return v_hat [m/s] after one backward Euler step of eq. 24 (corrected).

    Parameters
    ----------
    speed
        v_hat before the step [m/s].
    torque
        Sum of the axle torques [N m], braking negative.
    wheel_acceleration
        Sum of the axles' angular accelerations [rad/s^2].
    accel_x, mean_accel_x
        Accelerometer reading at the end of the step, and its mean over the step [m/s^2].
    grade
        Road grade [rad], positive downhill.
    elapsed
        Length of the step [s].
    params
        Record of the method's parameters.
    """
    balance = (torque - params.wheel_inertia * wheel_acceleration) / (
        params.mass * params.wheel_radius
    ) - params.rolling_resistance * GRAVITY
    gain = 1.0 + params.velocity_gain
    linear = speed + elapsed * (mean_accel_x + GRAVITY * sin(grade) + gain * (balance - accel_x))
    quadratic = elapsed * gain * params.drag / params.mass
    if linear <= 0.0:
        return 0.0  # the drag term can only stop the vehicle, not reverse it
    return 2.0 * linear / (1.0 + sqrt(1.0 + 4.0 * quadratic * linear))


@inlined
def adapted_stiffness(stiffness, slip, force, elapsed, params):
    """Return k [N] after one backward Euler step of k_dot = -K_e sign(s) (k s - F).

    With `normalised` the error is taken over the slip, k_dot = -K_e (k - F/s): k then settles at
    the rate K_e whatever the slip.

    Parameters
    ----------
    stiffness
        k before the step [N].
    slip
        Load-weighted sum of the slip ratios, s_f + s_r F_zr/F_zf.
    force
        Total tyre force by eq. 8 [N].
    elapsed
        Length of the step [s].
    params
        Record of the method's parameters.
    """
    rate = elapsed * params.stiffness_gain
    if params.normalised > 0.5:
        spread = slip * slip + SMALL_SLIP * SMALL_SLIP
        share = slip * slip / spread
        return (stiffness + rate * force * slip / spread) / (1.0 + rate * share)
    sign = 1.0 if slip >= 0.0 else -1.0
    return (stiffness + rate * sign * force) / (1.0 + rate * abs(slip))


@compiled
def start(state, params):
    """Set the first stiffness, C_s, and the first covariances."""
    state.stiffness = params.longitudinal_stiffness
    start_friction(state, params)


@compiled
def _step(state, obs, wheel_acceleration, slip_speed, params, est):
    torque = obs.torque_front + obs.torque_rear
    if obs.first:
        state.speed = params.wheel_radius * obs.wheel_speed_front
    else:
        state.speed = observed_speed(
            state.speed,
            torque,
            wheel_acceleration,
            obs.accel_x,
            0.5 * (state.accel_x + obs.accel_x),
            obs.road_grade,
            obs.elapsed,
            params,
        )
    state.accel_x = obs.accel_x
    state.wheel_speed_front, state.wheel_speed_rear = obs.wheel_speed_front, obs.wheel_speed_rear
    speed = slip_speed if slip_speed >= 0.0 else state.speed
    slip_front, slip_rear = axle_slips(obs.wheel_speed_front, obs.wheel_speed_rear, speed, params)
    share = rear_load(params) / front_load(params)
    force = total_force(obs.accel_x, speed, params)
    state.stiffness = adapted_stiffness(
        state.stiffness, slip_front + share * slip_rear, force, obs.elapsed, params
    )
    est.speed_x = state.speed
    est.force_x_front = state.stiffness * slip_front
    est.force_x_rear = state.stiffness * share * slip_rear
    estimate_friction(state, est, slip_front, slip_rear, obs.elapsed, params)


@compiled
def step(state, obs, params, est):
    """Take one sample; the wheel accelerations are differences of the wheel speeds."""
    elapsed = obs.elapsed
    if elapsed > 0.0:
        rise = (obs.wheel_speed_front - state.wheel_speed_front) + (
            obs.wheel_speed_rear - state.wheel_speed_rear
        )
        share = 1.0
        if params.difference_time > 0.0:
            share = -expm1(-elapsed / params.difference_time)
        state.wheel_acceleration += share * (rise / elapsed - state.wheel_acceleration)
    _step(state, obs, state.wheel_acceleration, -1.0, params, est)


@compiled
def step_idealised(state, obs, params, est):
    """Take one sample with the model's own wheel accelerations, as the paper does."""
    acceleration = obs.wheel_acceleration_front + obs.wheel_acceleration_rear
    _step(state, obs, acceleration, -1.0, params, est)


@compiled
def step_gps(state, obs, params, est):
    """Take one sample with the GPS speed in the slip: the remark for a noisy accelerometer."""
    acceleration = obs.wheel_acceleration_front + obs.wheel_acceleration_rear
    _step(state, obs, acceleration, obs.speed_gps, params, est)


_SENSORS = (
    "wheel_speed_front",
    "wheel_speed_rear",
    "torque_front",
    "torque_rear",
    "accel_x",
    "road_grade",
)
_IDEALISED = (*_SENSORS, "wheel_acceleration_front", "wheel_acceleration_rear")
_PAPER = PRINTED | {"velocity_gain": 8e5, "stiffness_gain": 8e4, "difference_time": 0.0}


class ProposedObserver(CompiledMethod):
    """Velocity observer, adapted stiffness and regression, without GPS."""

    name = "proposed_observer"
    title = "Proposed observer"
    reference = "Li, Du & Li (2014), Section VI, eq. 23-29, Figure 19"
    sensors = _SENSORS
    estimates = ("speed_x", "force_x_front", "force_x_rear", "mu_front", "mu_rear")
    vehicle_parameters = (
        *AXLE_FRICTION_VEHICLE,
        *RESISTANCE_PARAMETERS,
        "wheel_radius",
        "wheel_inertia",
        "longitudinal_stiffness",
    )
    unread = staticmethod(unread_tyre)
    parameters = (
        *AXLE_FRICTION_PARAMETERS,
        Parameter("velocity_gain", 30.0, "-", "Gain K_a of eq. 24", 0.0),
        Parameter("stiffness_gain", 8e4, "1/s", "Gain K_e of Figure 19", 0.0),
        Parameter("normalised", False, "-", "The stiffness' error is taken over the slip"),
        Parameter("difference_time", 0.05, "s", "Low-pass of the differenced wheel speeds", 0.0),
    )
    variants = {
        "paper": Variant(_PAPER, _IDEALISED, step_idealised),
        "paper_noise": Variant(
            _PAPER | {"stiffness_gain": 140.0, "normalised": True},
            (*_IDEALISED, "speed_gps"),
            step_gps,
        ),
        "idealised": Variant({"velocity_gain": 8e5}, _IDEALISED, step_idealised),
    }
    state = STATE
    start = staticmethod(start)
    step = staticmethod(step)
