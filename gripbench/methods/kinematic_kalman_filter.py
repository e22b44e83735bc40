"""Kinematic Kalman filter of Anderson & Bevly (2004), eq. 2-4 and 6: sideslip without a model.

Straight ahead the GPS course is the heading, which calibrates the yaw rate gyroscope; in a turn
the gyroscope is integrated and the course less the integrated heading is the sideslip angle. A
turn is a smoothed yaw rate above a threshold, and lasts for a hold time after it; the threshold
is wider by two standard deviations of the bias, or a large bias would pass for a turn and never
be learnt.

Errata: (4) prints the noise of a step as T^2 for both states, which suits white gyro noise given
for a sample but makes the walk of the bias depend on the sample rate; spectral densities times
the elapsed time do not. Its R has a second row for a measurement that does not exist.
`gripbench.methods.printed.anderson2004` has the printed forms, with the forward Euler step of (3).

Beyond the paper: the scale factor of the gyroscope can be a state (`gyro_scale_std` above 0,
variant `scale_factor`). The course before and after a turn then shows it, from the covariance
that heading and scale factor build up in the turn. A late GPS sample is compared with the heading
of its own time; a repeated or out-of-order one is left out.

Of its variance: outside turns the course is taken for the heading, as if a car that does not turn
had no sideslip; on ice it has. A scale factor of the gyroscope (known unless `gyro_scale_std` is
set), the roll of the body and a bank turn the heading in a curve, and are not modelled.
"""

from __future__ import annotations

import numpy as np

from gripbench.methods.blocks.course_history import (
    HISTORY,
    change_since,
    is_usable,
    remember,
    wrapped,
)
from gripbench.methods.blocks.kalman import (
    correct_scalar,
    filter_type,
    innovation_variance,
    predict_covariance,
)
from gripbench.methods.contract import CompiledMethod, Parameter, compiled

KINEMATIC_STATE = np.dtype(
    [
        ("filter", filter_type(3)),  # heading, gyro bias, gyro scale factor
        ("history", HISTORY),
        ("time", np.float64),
        ("samples", np.float64),
        ("located", np.float64),  # 1 once the first course has set the heading
        ("rate", np.float64),  # last reading of the gyroscope
        ("smooth_rate", np.float64),
        ("turn_until", np.float64),
        ("integrated", np.float64),  # integral of the corrected yaw rate
        ("sideslip", np.float64),
        ("sideslip_variance", np.float64),
        ("speed", np.float64),
        ("course_innovation", np.float64),
        ("course_innovation_variance", np.float64),  # 0 where no course was taken
    ]
)
"""State of the kinematic filter; `filter.x` is heading [rad], bias [rad/s] and scale factor."""

KINEMATIC_SENSORS = ("yaw_rate", "course", "course_new", "speed_gps", "gps_time")

KINEMATIC_PARAMETERS = (
    Parameter("gyro_noise", 5.236e-4, "rad/s/sqrt(Hz)", "Density of the gyroscope's noise", 0.0),
    Parameter("bias_walk", 1.745e-5, "rad/s/sqrt(s)", "Walk of the gyroscope's bias", 0.0),
    Parameter("gps_speed_noise", 0.05, "m/s", "Noise of the GPS velocity across the course", 1e-6),
    Parameter("bias_std", 1.745e-2, "rad/s", "Standard deviation of the bias at the start", 0.0),
    Parameter("gyro_scale", 1.0, "-", "Scale factor of the gyroscope, as far as known", 0.5, 2.0),
    Parameter("gyro_scale_std", 0.0, "-", "Standard deviation of that scale factor", 0.0, 0.5),
    Parameter("turn_rate", 1.745e-2, "rad/s", "Smoothed yaw rate that is a turn", 0.0),
    Parameter("turn_hold", 2.0, "s", "How long a turn lasts after the yaw rate has fallen", 0.0),
    Parameter("turn_smoothing", 0.3, "s", "Time constant of the turn detection", 1e-3),
    Parameter("lowest_speed", 2.0, "m/s", "Below it the course is left out", 0.1),
)


@compiled
def start_kinematic(state, params):
    """Set the first values of a kinematic filter."""
    filter = state.filter
    filter.x[2] = params.gyro_scale
    filter.P[1, 1] = params.bias_std**2
    filter.P[2, 2] = params.gyro_scale_std**2
    for i in range(3):
        filter.F[i, i] = 1.0
    filter.h[0] = 1.0
    state.turn_until = -np.inf


@compiled
def held_rate(before, now):
    """Return the yaw rate that counts between two readings [rad/s], eq. 3: their mean."""
    return 0.5 * (before + now)


@compiled
def walk_time(elapsed):
    """Return what the variance of the bias grows with, eq. 4: the time [s]."""
    return elapsed


@compiled
def advance_kinematic(state, obs, params):
    """Take one sample; return whether it brought a course that was used."""
    filter = state.filter
    x = filter.x
    elapsed = obs.time - state.time if state.samples > 0.0 else 0.0
    state.course_innovation, state.course_innovation_variance = 0.0, 0.0
    if state.samples == 0.0:
        state.rate = obs.yaw_rate
    corrected = (held_rate(state.rate, obs.yaw_rate) - x[1]) / x[2]
    state.integrated += elapsed * corrected
    x[0] += elapsed * corrected
    filter.F[0, 1] = -elapsed / x[2]
    filter.F[0, 2] = -elapsed * corrected / x[2]
    filter.Q[0, 0] = params.gyro_noise**2 * elapsed / x[2] ** 2
    filter.Q[1, 1] = params.bias_walk**2 * walk_time(elapsed)
    predict_covariance(filter)

    share = -np.expm1(-elapsed / params.turn_smoothing)
    state.smooth_rate += share * (obs.yaw_rate - state.smooth_rate)
    if abs(state.smooth_rate - x[1]) > params.turn_rate + 2.0 * np.sqrt(filter.P[1, 1]):
        state.turn_until = obs.time + params.turn_hold
    remember(state.history, obs.time, state.integrated)
    state.rate = obs.yaw_rate
    state.time = obs.time
    state.samples += 1.0
    if obs.course_new == 0.0 or obs.speed_gps < params.lowest_speed:
        return False
    if not is_usable(state.history, obs.gps_time):
        return False
    state.speed = obs.speed_gps
    late = obs.time - obs.gps_time
    variance = (params.gps_speed_noise / obs.speed_gps) ** 2 + params.gyro_noise**2 * late
    turned = change_since(state.history, obs.gps_time)
    if state.located == 0.0:
        state.located = 1.0
        x[0] = obs.course + turned
        filter.P[0, 0] = variance
        for i in range(1, 3):  # what the bias did to a heading that is no more
            filter.P[0, i] = 0.0
            filter.P[i, 0] = 0.0
    elif obs.time >= state.turn_until:
        state.course_innovation = wrapped(obs.course - (x[0] - turned))
        state.course_innovation_variance = innovation_variance(filter, variance)
        correct_scalar(filter, state.course_innovation, variance)
    state.sideslip = wrapped(obs.course - (x[0] - turned))
    state.sideslip_variance = filter.P[0, 0] + variance
    return True


@compiled
def _step(state, obs, params, est):
    advance_kinematic(state, obs, params)
    filter = state.filter
    est.sideslip = state.sideslip
    est.yaw = wrapped(filter.x[0])
    est.yaw_rate = (obs.yaw_rate - filter.x[1]) / filter.x[2]
    est.gyro_bias = filter.x[1]
    est.gyro_scale = filter.x[2]
    est.course_innovation = state.course_innovation
    est.course_innovation_variance = state.course_innovation_variance
    est.sideslip_variance = state.sideslip_variance
    est.yaw_variance = filter.P[0, 0]
    est.gyro_bias_variance = filter.P[1, 1]
    est.gyro_scale_variance = filter.P[2, 2]


class KinematicKalmanFilter(CompiledMethod):
    """Kinematic Kalman filter: gyroscope and GPS course, no vehicle model."""

    name = "kinematic_kalman_filter"
    title = "Kinematic Kalman filter"
    reference = "Anderson & Bevly 2004, eq. 2-4 and 6"
    sensors = KINEMATIC_SENSORS
    estimates = ("sideslip", "yaw", "yaw_rate", "gyro_bias", "gyro_scale")
    variances = ("sideslip", "yaw", "gyro_bias", "gyro_scale")
    innovations = ("course",)
    parameters = KINEMATIC_PARAMETERS
    variants = {"scale_factor": {"gyro_scale_std": 0.02}}
    printed = "gripbench.methods.printed.anderson2004"
    state = KINEMATIC_STATE
    start = staticmethod(start_kinematic)
    step = staticmethod(_step)
