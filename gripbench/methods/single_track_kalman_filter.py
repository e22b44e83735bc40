"""Single-track Kalman filter on yaw rate and lateral acceleration.

The linear single-track model with the states v_y and r is driven by the steering angle, in exact
steps of the present speed; gyroscope and lateral accelerometer correct it,

    a_y = -(C_f + C_r)/(m v) v_y - (a C_f - b C_r)/(m v) r + C_f/m delta.

Rajamani, Vehicle Dynamics and Control, 2.3 and 8 (model), Best, Gordon & Dixon (2000), An extended
adaptive Kalman filter for real-time state estimation of vehicle handling dynamics, Vehicle System
Dynamics 34 (the two measurements). The speed is fused from wheel speeds, or measured.

Of its variance: the model is linear and so the variance depends on speed and noise, never on what
is measured: it is the same in a gentle bend and in a slide on ice. Stiffness, bank and offsets are
errors that last, counted as white noise.
"""

from __future__ import annotations

import numpy as np

from gripbench.compilation import compiled
from gripbench.methods.blocks.discretisation import exponential
from gripbench.methods.blocks.kalman import (
    correct_scalar,
    filter_type,
    innovation_variance,
    predict_covariance,
)
from gripbench.methods.blocks.single_track_filter import (
    INPUT_STATE,
    LATERAL_INNOVATIONS,
    SingleTrackFilter,
    read_inputs,
    write_lateral,
    write_no_innovations,
)

_STATE = np.dtype(
    [
        ("inputs", INPUT_STATE),
        ("filter", filter_type(2)),  # v_y, r
        ("model", np.float64, (3, 3)),  # states and steering angle: model, exponential, scratch
        ("held", np.float64, (3, 3)),
        ("work", np.float64, (3, 3)),
        ("key", np.float64, (2,)),  # step and speed that `held` belongs to
    ]
)


@compiled
def linear_model(model, speed, params):
    """Fill the (3, 3) continuous model of v_y, r and the held steering angle."""
    m, inertia = params.mass, params.yaw_inertia
    a, b = params.cg_to_front, params.cg_to_rear
    front, rear = params.cornering_stiffness_front, params.cornering_stiffness_rear
    model[:] = 0.0
    model[0, 0] = -(front + rear) / (m * speed)
    model[0, 1] = -(a * front - b * rear) / (m * speed) - speed
    model[0, 2] = front / m
    model[1, 0] = -(a * front - b * rear) / (inertia * speed)
    model[1, 1] = -(a * a * front + b * b * rear) / (inertia * speed)
    model[1, 2] = a * front / inertia


@compiled
def _step(state, obs, params, est):
    read_inputs(state.inputs, obs, params)
    filter, inputs = state.filter, state.inputs
    x, P, h = filter.x, filter.P, filter.h
    elapsed, speed = obs.elapsed, inputs.speed
    write_no_innovations(est)
    if obs.first:
        P[0, 0] = params.speed_y_std**2
        P[1, 1] = 1.0
    if elapsed > 0.0:
        if abs(elapsed - state.key[0]) > 1e-9 or abs(speed - state.key[1]) > 1e-3 * speed:
            state.key[0], state.key[1] = elapsed, speed
            linear_model(state.model, speed, params)
            for i in range(3):
                for j in range(3):
                    state.model[i, j] *= elapsed
            exponential(state.model, state.held, state.work)
        held = state.held
        steer = 0.5 * (inputs.last_steer + inputs.steer)
        speed_y, rate = x[0], x[1]
        for i in range(2):
            x[i] = held[i, 0] * speed_y + held[i, 1] * rate + held[i, 2] * steer
            for j in range(2):
                filter.F[i, j] = held[i, j]
        filter.Q[0, 0] = params.speed_y_walk**2 * elapsed
        filter.Q[1, 1] = params.yaw_rate_walk**2 * elapsed
        predict_covariance(filter)
    if elapsed > 0.0 or obs.first:
        span = elapsed if elapsed > 0.0 else 0.01
        if obs.yaw_rate == obs.yaw_rate:
            h[0], h[1] = 0.0, 1.0
            noise = params.gyro_noise**2 / span
            est.yaw_rate_innovation = obs.yaw_rate - x[1]
            est.yaw_rate_innovation_variance = innovation_variance(filter, noise)
            correct_scalar(filter, obs.yaw_rate - x[1], noise)
        if obs.accel_y == obs.accel_y:
            linear_model(state.model, speed, params)
            h[0], h[1] = state.model[0, 0], state.model[0, 1] + speed
            expected = h[0] * x[0] + h[1] * x[1] + state.model[0, 2] * inputs.steer
            noise = params.accel_y_noise**2 / span
            est.accel_y_innovation = obs.accel_y - expected
            est.accel_y_innovation_variance = innovation_variance(filter, noise)
            correct_scalar(filter, obs.accel_y - expected, noise)
    write_lateral(inputs, x[0], x[1], P[0, 0], est)


class SingleTrackKalmanFilter(SingleTrackFilter):
    """Linear single-track model corrected by yaw rate and lateral acceleration."""

    name = "single_track_kalman_filter"
    title = "Single-track Kalman filter"
    reference = "Rajamani, Vehicle Dynamics and Control, 2.3; Best, Gordon & Dixon (2000)"
    innovations = LATERAL_INNOVATIONS
    state = _STATE
    step = staticmethod(_step)
