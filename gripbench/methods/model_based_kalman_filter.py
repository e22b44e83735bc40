"""Model-based Kalman filter of Anderson & Bevly (2004), eq. 1, 2, 5, 7 and 8.

The linear single-track model with the states sideslip, yaw rate, heading and gyro bias is driven
by the steering angle; every gyroscope sample and every GPS course corrects it.

Errata, corrected here:

- (1): the yaw equation is sum M_z = I_z r', and forces restore: F = -C alpha for positive C.
- (5): A22 = -(a^2 C_f + b^2 C_r)/(I_z V); printed without the sign the model is unstable.
  R22 is the variance of the course, and the second row of C reads beta + psi.
- (3)-(5): process noise as spectral densities. The steering noise is that of the sampled angle,
  held over a step like the angle itself, so its covariance goes through the same input matrix.
- (5) lacks the bank of (1): with the variant `bank`, g sin(bank)/V enters the sideslip row.
- (8): the variance of the course innovation is H P H' + R, which includes the covariance of
  sideslip and heading (no state depends on it); `gripbench.methods.printed.anderson2004` has the
  printed sum.

A late GPS sample is compared with the course that was predicted for its own time; a repeated or
out-of-order one is left out.

Of its variance: it knows the white noise of gyroscope, steering and GPS and nothing else. That the
tyres saturate, that mass and stiffness are not those on paper, that the road banks, are errors
that last for seconds and have no part in Q, so it is far too small on another car than the one on
paper.
"""

from __future__ import annotations

import numpy as np

from gripbench.envs.vehicles import GRAVITY
from gripbench.methods.blocks.course_history import (
    HISTORY,
    change_since,
    is_usable,
    remember,
    wrapped,
)
from gripbench.methods.blocks.discretisation import exponential
from gripbench.methods.blocks.kalman import correct_scalar, filter_type, predict_covariance
from gripbench.methods.contract import CompiledMethod, Parameter, Variant, compiled

MODEL_BASED_STATE = np.dtype(
    [
        ("filter", filter_type(4)),  # sideslip, yaw rate, heading, gyro bias
        ("history", HISTORY),
        ("time", np.float64),
        ("samples", np.float64),
        ("located", np.float64),  # 1 once the first course has set the heading
        ("speed", np.float64),
        ("steer_angle", np.float64),
        ("road_bank", np.float64),
        # sideslip, yaw rate, heading, steering angle, bank: model, its exponential, scratch
        ("model", np.float64, (5, 5)),
        ("held", np.float64, (5, 5)),
        ("work", np.float64, (5, 5)),
        ("key", np.float64, (4,)),  # step, speed and stiffness that `held` belongs to
        ("predicted_course", np.float64),  # sum of the predicted changes of course
        ("course_innovation", np.float64),
        ("course_innovation_variance", np.float64),
        ("yaw_rate_innovation", np.float64),
        ("yaw_rate_innovation_variance", np.float64),
    ]
)
"""State of the model-based filter; `filter.x` is sideslip, yaw rate, heading and gyro bias."""

MODEL_BASED_SENSORS = ("yaw_rate", "steer_angle", "course", "course_new", "speed_gps", "gps_time")
SINGLE_TRACK = (
    "mass",
    "yaw_inertia",
    "cg_to_front",
    "cg_to_rear",
    "cornering_stiffness_front",
    "cornering_stiffness_rear",
)
"""Vehicle parameters of the linear single-track model."""

MODEL_BASED_PARAMETERS = (
    Parameter("gyro_noise", 5.236e-4, "rad/s/sqrt(Hz)", "Density of the gyroscope's noise", 1e-9),
    Parameter("steer_noise", 1.745e-4, "rad/sqrt(Hz)", "Density of the steering noise", 0.0),
    Parameter("bias_walk", 1.745e-5, "rad/s/sqrt(s)", "Walk of the gyroscope's bias", 0.0),
    Parameter("gps_speed_noise", 0.05, "m/s", "Noise of the GPS velocity across the course", 1e-6),
    Parameter("bias_std", 1.745e-2, "rad/s", "Standard deviation of the bias at the start", 0.0),
    Parameter("sideslip_std", 1.745e-2, "rad", "Standard deviation of sideslip at the start", 0.0),
    Parameter("lowest_speed", 3.0, "m/s", "Speed below which the model is held at it", 0.5),
)


@compiled
def start_model_based(state, params):
    """Set the first values of a model-based filter."""
    P = state.filter.P
    P[0, 0] = params.sideslip_std**2
    P[1, 1] = params.gyro_noise**2 * 100.0 + params.bias_std**2
    P[3, 3] = params.bias_std**2


@compiled
def single_track(model, mass, inertia, a, b, front, rear, speed):
    """Fill the continuous model of sideslip, yaw rate, heading under steering and bank.

    Parameters
    ----------
    model
        Matrix (5, 5) of zeros, filled: eq. 5 with the signs corrected, its input and the bank.
    mass, inertia
        Mass [kg] and moment of inertia about z [kg m^2].
    a, b
        Distance of front and rear axle from the centre of gravity [m].
    front, rear
        Cornering stiffness of the axles [N/rad].
    speed
        Speed [m/s].
    """
    model[0, 0] = -(front + rear) / (mass * speed)
    model[0, 1] = (b * rear - a * front) / (mass * speed * speed) - 1.0
    model[1, 0] = (b * rear - a * front) / inertia
    model[1, 1] = -(a * a * front + b * b * rear) / (inertia * speed)
    model[2, 1] = 1.0
    model[0, 3] = front / (mass * speed)
    model[1, 3] = a * front / inertia
    model[0, 4] = -GRAVITY / speed  # left side up (positive bank): gravity pulls to the right


@compiled
def course_variance(P, variance):
    """Return the variance of the course innovation [rad^2], eq. 8, from that of the course."""
    return P[0, 0] + P[2, 2] + variance + 2.0 * P[0, 2]


@compiled
def advance_model_based(state, obs, params, bank, front, rear):
    """Take one sample with the given bank [rad] and stiffness; return whether a course was used."""
    filter = state.filter
    x, h = filter.x, filter.h
    elapsed = obs.time - state.time if state.samples > 0.0 else 0.0
    if state.samples == 0.0:
        x[1] = obs.yaw_rate
        state.steer_angle = obs.steer_angle
        state.road_bank = bank
    if obs.speed_gps > 0.0:
        state.speed = obs.speed_gps
    speed = max(state.speed, params.lowest_speed)
    key = state.key
    if (
        abs(elapsed - key[0]) > 1e-9
        or speed != key[1]
        or front != key[2]
        or rear != key[3]
        or state.samples == 0.0
    ):
        key[0], key[1], key[2], key[3] = elapsed, speed, front, rear
        state.model[:] = 0.0
        single_track(
            state.model,
            params.mass,
            params.yaw_inertia,
            params.cg_to_front,
            params.cg_to_rear,
            front,
            rear,
            speed,
        )
        for i in range(5):
            for j in range(5):
                state.model[i, j] *= elapsed
        exponential(state.model, state.held, state.work)
    # Inputs and Q go by the mean of two readings: the angle moves steadily between samples.
    steer = 0.5 * (state.steer_angle + obs.steer_angle)
    lean = np.sin(0.5 * (state.road_bank + bank))
    course = x[0] + x[2]
    beta, rate, held = x[0], x[1], state.held
    noise = params.steer_noise**2 / elapsed if elapsed > 0.0 else 0.0
    for i in range(3):
        for j in range(3):
            filter.F[i, j] = held[i, j]
            filter.Q[i, j] = held[i, 3] * noise * held[j, 3]
    filter.F[3, 3] = 1.0
    filter.Q[3, 3] = params.bias_walk**2 * elapsed
    x[0] = held[0, 0] * beta + held[0, 1] * rate + held[0, 3] * steer + held[0, 4] * lean
    x[1] = held[1, 0] * beta + held[1, 1] * rate + held[1, 3] * steer + held[1, 4] * lean
    x[2] += held[2, 0] * beta + held[2, 1] * rate + held[2, 3] * steer + held[2, 4] * lean
    predict_covariance(filter)
    state.predicted_course += x[0] + x[2] - course
    remember(state.history, obs.time, state.predicted_course)
    state.steer_angle = obs.steer_angle
    state.road_bank = bank
    state.time = obs.time
    state.samples += 1.0

    used = False
    if obs.course_new != 0.0 and obs.speed_gps >= params.lowest_speed:
        used = is_usable(state.history, obs.gps_time)
    if used:
        turned = change_since(state.history, obs.gps_time)
        variance = (params.gps_speed_noise / obs.speed_gps) ** 2
        h[0], h[1], h[2], h[3] = 1.0, 0.0, 1.0, 0.0
        if state.located == 0.0:
            state.located = 1.0
            x[2] = obs.course + turned - x[0]
            filter.P[2, 2] = variance + filter.P[0, 0]
            for i in range(4):  # heading is the course less the sideslip: errors are opposite
                if i != 2:
                    filter.P[2, i] = -filter.P[0, i]
                    filter.P[i, 2] = filter.P[2, i]
        else:
            state.course_innovation = wrapped(obs.course - (x[0] + x[2] - turned))
            state.course_innovation_variance = course_variance(filter.P, variance)
            correct_scalar(filter, state.course_innovation, variance)
    # The noise of a sample goes with the sample rate; the first sample has no elapsed time yet.
    variance = params.gyro_noise**2 / (elapsed if elapsed > 0.0 else 0.01)
    h[0], h[1], h[2], h[3] = 0.0, 1.0, 0.0, 1.0
    state.yaw_rate_innovation = obs.yaw_rate - x[1] - x[3]
    state.yaw_rate_innovation_variance = (
        filter.P[1, 1] + 2.0 * filter.P[1, 3] + filter.P[3, 3] + variance
    )
    correct_scalar(filter, state.yaw_rate_innovation, variance)
    return used


@compiled
def report_model_based(state, est, params, front, rear):
    """Write the estimates of a model-based filter."""
    x, P = state.filter.x, state.filter.P
    speed = max(state.speed, params.lowest_speed)
    est.sideslip = x[0]
    est.yaw_rate = x[1]
    est.yaw = wrapped(x[2])
    est.gyro_bias = x[3]
    est.force_y_front = front * (state.steer_angle - x[0] - params.cg_to_front * x[1] / speed)
    est.force_y_rear = rear * (params.cg_to_rear * x[1] / speed - x[0])
    est.course_innovation = state.course_innovation
    est.yaw_rate_innovation = state.yaw_rate_innovation
    est.sideslip_variance = P[0, 0]
    est.yaw_rate_variance = P[1, 1]
    est.yaw_variance = P[2, 2]
    est.gyro_bias_variance = P[3, 3]
    est.course_innovation_variance = state.course_innovation_variance
    est.yaw_rate_innovation_variance = state.yaw_rate_innovation_variance


MODEL_BASED_ESTIMATES = (
    "sideslip",
    "yaw_rate",
    "yaw",
    "gyro_bias",
    "force_y_front",
    "force_y_rear",
)
MODEL_BASED_VARIANCES = ("sideslip", "yaw_rate", "yaw", "gyro_bias")
MODEL_BASED_INNOVATIONS = ("course", "yaw_rate")


@compiled
def _step(state, obs, params, est):
    front, rear = params.cornering_stiffness_front, params.cornering_stiffness_rear
    advance_model_based(state, obs, params, 0.0, front, rear)
    report_model_based(state, est, params, front, rear)


@compiled
def _step_with_bank(state, obs, params, est):
    front, rear = params.cornering_stiffness_front, params.cornering_stiffness_rear
    advance_model_based(state, obs, params, obs.road_bank, front, rear)
    report_model_based(state, est, params, front, rear)


class ModelBasedKalmanFilter(CompiledMethod):
    """Single-track Kalman filter with gyro bias; the variant `bank` knows the road's bank."""

    name = "model_based_kalman_filter"
    title = "Model-based Kalman filter"
    reference = "Anderson & Bevly 2004, eq. 1-3, 5 and 8"
    sensors = MODEL_BASED_SENSORS
    estimates = MODEL_BASED_ESTIMATES
    variances = MODEL_BASED_VARIANCES
    innovations = MODEL_BASED_INNOVATIONS
    vehicle_parameters = SINGLE_TRACK
    parameters = MODEL_BASED_PARAMETERS
    variants = {
        "bank": Variant(sensors=(*MODEL_BASED_SENSORS, "road_bank"), step=_step_with_bank),
    }
    printed = "gripbench.methods.printed.anderson2004"
    state = MODEL_BASED_STATE
    start = staticmethod(start_model_based)
    step = staticmethod(_step)
