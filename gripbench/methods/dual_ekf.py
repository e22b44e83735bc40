"""Dual extended Kalman filter: one filter for the states, one for stiffness and friction.

Wenzel, Burnham, Blundell & Williams (2006), Dual extended Kalman filter for vehicle state and
parameter estimation, Vehicle System Dynamics 44: in each step the parameter filter predicts, the
state filter predicts and is corrected with those parameters, and the parameter filter is corrected
by the same measurement of a_y with the new states. The cross covariance of states and parameters
is left out, as in the paper; `joint_ekf` keeps it.

Of its variance: each filter takes what the other estimates for known. What that leaves out adds to
what the joint filter leaves out.
"""

from __future__ import annotations

from math import log

from gripbench.compilation import compiled
from gripbench.methods.blocks.kalman import correct_scalar, filter_type
from gripbench.methods.blocks.single_track_ekf import (
    correct_track,
    evaluate_track,
    predict_track,
)
from gripbench.methods.blocks.single_track_filter import (
    ADAPTIVE_PARAMETERS,
    LATERAL_ESTIMATES,
    LATERAL_INNOVATIONS,
    LATERAL_VARIANCES,
    SingleTrackFilter,
    read_inputs,
    start_adaptive,
    start_lateral,
    track_state,
    write_friction,
    write_innovations,
    write_lateral,
    write_no_innovations,
)


@compiled
def _step(state, obs, params, est):
    read_inputs(state.inputs, obs, params)
    filter, parameter, inputs = state.filter, state.parameter, state.inputs
    x, P, y, h = filter.x, filter.P, parameter.x, parameter.h
    span = obs.elapsed
    write_no_innovations(est)
    if obs.first:
        start_lateral(filter, obs, params)
        start_adaptive(y, parameter.P, 0, params)
        for i in range(3):
            x[2 + i] = y[i]
    elif span > 0.0:
        parameter.P[0, 0] += params.stiffness_walk**2 * span
        parameter.P[1, 1] += params.stiffness_walk**2 * span
        parameter.P[2, 2] += params.friction_walk**2 * span
        predict_track(filter, span, inputs.speed, inputs.steer, 0.0, params, state.motion)
        rate, accel = correct_track(
            filter, span, inputs.speed, inputs.steer, 0.0, obs.yaw_rate, obs.accel_y, params,
            state.motion,
        )  # fmt: skip
        write_innovations(rate, accel, est)
        out = state.motion
        evaluate_track(x, inputs.speed, inputs.steer, 0.0, params, out)
        h[0], h[1], h[2] = out[0, 4], out[0, 5], out[0, 3]
        noise = params.accel_y_noise**2 / span + out[0, 1] ** 2 * P[0, 0]
        correct_scalar(parameter, obs.accel_y - out[0, 0], noise)
        y[0], y[1] = min(max(y[0], -1.0), 1.0), min(max(y[1], -1.0), 1.0)
        y[2] = min(max(y[2], log(0.05)), log(1.4))
        for i in range(3):
            x[2 + i] = y[i]
    write_lateral(inputs, x[0], x[1], P[0, 0], est)
    write_friction(y[2], parameter.P[2, 2], est)


class DualEkf(SingleTrackFilter):
    """A filter for the states beside one for stiffness and friction."""

    name = "dual_ekf"
    title = "Dual EKF"
    reference = "Wenzel, Burnham, Blundell & Williams (2006)"
    estimates = (*LATERAL_ESTIMATES, "mu")
    variances = (*LATERAL_VARIANCES, "mu")
    innovations = LATERAL_INNOVATIONS
    parameters = ADAPTIVE_PARAMETERS
    state = track_state(5, ("parameter", filter_type(3)))  # five: parameters held as known
    step = staticmethod(_step)
