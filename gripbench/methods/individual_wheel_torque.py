"""Individual wheel estimation, algorithm 1: Li, Du & Li (2014), eq. 21 ("Method 2").

An observer of each axle's wheel dynamics with the torque as input; the tyre force is a state that
the error of the wheel speed drives::

    I w_hat_dot = T - R F_hat + l (w - w_hat)
    F_hat_dot   = eta (w_hat - w)

Its poles have the natural frequency sqrt(eta R / I). The step is the implicit trapezoid, which is
stable for every gain and sample time.

Corrected here: the paper gives no gains. Its tables fit a natural frequency of 5.5 rad/s (variant
`paper`), which lags by a fifth of a second; the default is 50 rad/s.
"""

from __future__ import annotations

import numpy as np

from gripbench.compilation import inlined
from gripbench.methods.blocks.axle_friction import (
    AXLE_FRICTION_PARAMETERS,
    AXLE_FRICTION_STATE,
    AXLE_FRICTION_VEHICLE,
    MAGIC_FORMULA,
    PRINTED,
    axle_slips,
    estimate_friction,
    start_friction,
    unread_tyre,
)
from gripbench.methods.contract import CompiledMethod, Parameter, compiled

_AXLE = ("wheel_speed", "force", "measured", "torque")
STATE = np.dtype(
    [(f"{name}_{axle}", np.float64) for axle in ("front", "rear") for name in _AXLE]
    + [(name, np.float64) for name in AXLE_FRICTION_STATE]
)


@inlined
def observer(wheel_speed, force, measured, torque, elapsed, params):
    """Return wheel speed and force of an axle after one trapezoidal step of eq. 21.

    Parameters
    ----------
    wheel_speed, force
        Estimates before the step [rad/s, N].
    measured, torque
        Measured wheel speed [rad/s] and torque [N m], means over the step.
    elapsed
        Length of the step [s].
    params
        Record with `wheel_radius`, `wheel_inertia`, `wheel_gain` and `force_gain`.
    """
    half = 0.5 * elapsed
    damping = params.wheel_gain / params.wheel_inertia
    lever = params.wheel_radius / params.wheel_inertia
    drive = 2.0 * half * (damping * measured + torque / params.wheel_inertia)
    right_wheel = (1.0 - half * damping) * wheel_speed - half * lever * force + drive
    right_force = force + half * params.force_gain * (wheel_speed - 2.0 * measured)
    determinant = 1.0 + half * damping + half * half * lever * params.force_gain
    wheel_speed = (right_wheel - half * lever * right_force) / determinant
    return wheel_speed, right_force + half * params.force_gain * wheel_speed


@compiled
def start(state, params):
    """Set the first covariances."""
    start_friction(state, params)


@compiled
def step(state, obs, params, est):
    """Take one sample: forces by eq. 21, slip by eq. 5, friction by eq. 11-15."""
    elapsed = obs.elapsed
    if obs.first:
        state.wheel_speed_front = obs.wheel_speed_front
        state.wheel_speed_rear = obs.wheel_speed_rear
    else:
        state.wheel_speed_front, state.force_front = observer(
            state.wheel_speed_front,
            state.force_front,
            0.5 * (state.measured_front + obs.wheel_speed_front),
            0.5 * (state.torque_front + obs.torque_front),
            elapsed,
            params,
        )
        state.wheel_speed_rear, state.force_rear = observer(
            state.wheel_speed_rear,
            state.force_rear,
            0.5 * (state.measured_rear + obs.wheel_speed_rear),
            0.5 * (state.torque_rear + obs.torque_rear),
            elapsed,
            params,
        )
    state.measured_front, state.measured_rear = obs.wheel_speed_front, obs.wheel_speed_rear
    state.torque_front, state.torque_rear = obs.torque_front, obs.torque_rear
    slip_front, slip_rear = axle_slips(
        obs.wheel_speed_front, obs.wheel_speed_rear, obs.speed_gps, params
    )
    est.force_x_front = state.force_front
    est.force_x_rear = state.force_rear
    estimate_friction(state, est, slip_front, slip_rear, elapsed, params)


class IndividualWheelTorque(CompiledMethod):
    """Tyre force of each axle by an observer of the wheel dynamics."""

    name = "individual_wheel_torque"
    title = "Individual wheel, algorithm 1 (Method 2)"
    reference = "Li, Du & Li (2014), Section III.C, eq. 21"
    sensors = ("wheel_speed_front", "wheel_speed_rear", "torque_front", "torque_rear", "speed_gps")
    estimates = ("force_x_front", "force_x_rear", "mu_front", "mu_rear")
    vehicle_parameters = (*AXLE_FRICTION_VEHICLE, "wheel_radius", "wheel_inertia")
    unread = staticmethod(unread_tyre)
    parameters = (
        *AXLE_FRICTION_PARAMETERS,
        Parameter("wheel_gain", 210.0, "N m s", "Gain l of eq. 21", 0.0),
        Parameter("force_gain", 15000.0, "N/rad", "Gain eta of eq. 21", 0.0),
    )
    variants = {
        "paper": PRINTED | {"wheel_gain": 23.0, "force_gain": 180.0},
        "magic_formula": MAGIC_FORMULA,
    }
    state = STATE
    start = staticmethod(start)
    step = staticmethod(step)
