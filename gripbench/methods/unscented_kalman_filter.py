"""Unscented Kalman filter on the single-track model with brush tyres: friction as a state.

Antonov, Fehn & Kugi (2011), Unscented Kalman filter for vehicle state estimation, Vehicle System
Dynamics 49, with the friction as a state as in Wielitzka, Dagen & Ortmaier (2014), State estimation
of vehicle's lateral dynamics using unscented Kalman filter, IEEE Conf. Decision and Control.
States, noise and measurements are those of `joint_ekf`: v_y, r, ln C_f and ln C_r over the values
on paper, ln mu; yaw rate and a_y. Where a tyre saturates, its slope changes within the spread of
the estimate, which the points see and a Jacobian does not.

Departures: the points have equal weights (`blocks.unscented`), since a negative weight of the mean
makes the covariance indefinite in a slide; and they are drawn again after the prediction, so that
they hold its noise.
"""

from __future__ import annotations

from math import log

import numpy as np

from gripbench.methods.blocks.single_track_ekf import evaluate_track
from gripbench.methods.blocks.single_track_filter import (
    ADAPTIVE_PARAMETERS,
    INPUT_STATE,
    LATERAL_ESTIMATES,
    LATERAL_VARIANCES,
    SingleTrackFilter,
    read_inputs,
    start_adaptive,
    start_lateral,
    write_friction,
    write_lateral,
)
from gripbench.methods.blocks.unscented import correct, draw, gather, unscented_type
from gripbench.methods.contract import compiled

_STATE = np.dtype(
    [
        ("inputs", INPUT_STATE),
        ("filter", unscented_type(5, 2)),
        ("motion", np.float64, (2, 7)),
        ("measured", np.float64, (2,)),
    ]
)
_LEAST, _LARGEST = log(0.05), log(1.4)


@compiled
def _advance(state, span, yaw_rate, accel_y, params):
    filter, inputs, out = state.filter, state.inputs, state.motion
    x, Q, R, points = filter.x, filter.Q, filter.R, filter.points
    Q[0, 0] = params.speed_y_walk**2 * span
    Q[1, 1] = params.yaw_rate_walk**2 * span
    Q[2, 2] = Q[3, 3] = params.stiffness_walk**2 * span
    Q[4, 4] = params.friction_walk**2 * span
    draw(filter)
    for k in range(points.shape[0]):
        point = points[k]
        evaluate_track(point, inputs.speed, inputs.steer, 0.0, params, out)
        point[0] += span * (out[0, 0] - inputs.speed * point[1])
        point[1] += span * out[1, 0]
    gather(filter)
    draw(filter)
    for k in range(points.shape[0]):
        evaluate_track(points[k], inputs.speed, inputs.steer, 0.0, params, out)
        filter.outputs[k, 0], filter.outputs[k, 1] = points[k, 1], out[0, 0]
    R[0, 0], R[1, 1] = params.gyro_noise**2 / span, params.accel_y_noise**2 / span
    state.measured[0], state.measured[1] = yaw_rate, accel_y
    correct(filter, state.measured)
    x[2], x[3] = min(max(x[2], -1.0), 1.0), min(max(x[3], -1.0), 1.0)
    x[4] = min(max(x[4], _LEAST), _LARGEST)


@compiled
def _step(state, obs, params, est):
    read_inputs(state.inputs, obs, params)
    filter = state.filter
    if obs.first:
        start_lateral(filter, obs, params)
        start_adaptive(filter.x, filter.P, 2, params)
    elif obs.elapsed > 0.0:
        _advance(state, obs.elapsed, obs.yaw_rate, obs.accel_y, params)
    write_lateral(state.inputs, filter.x[0], filter.x[1], filter.P[0, 0], est)
    write_friction(filter.x[4], filter.P[4, 4], est)


class UnscentedKalmanFilter(SingleTrackFilter):
    """Lateral velocity, yaw rate, both stiffnesses and the friction by sigma points."""

    name = "unscented_kalman_filter"
    title = "Unscented Kalman filter"
    reference = "Antonov, Fehn & Kugi (2011); Wielitzka, Dagen & Ortmaier (2014)"
    estimates = (*LATERAL_ESTIMATES, "mu")
    variances = (*LATERAL_VARIANCES, "mu")
    parameters = ADAPTIVE_PARAMETERS
    state = _STATE
    step = staticmethod(_step)
