"""Wheel speeds, accelerometer, yaw rate and steering in, longitudinal speed with variance out.

A Kalman filter with the states v_x and accelerometer offset (bias and grade) integrates

    d v_x/dt = a_x - offset + r v_y,

and each wheel corrects it by the speed that it tells of the centre of gravity: its rolling speed,
less the slip that its share of m a_x makes on the tyre on paper, moved from the wheel to the
centre. What a wheel tells has an error that lasts (slip is no noise), so its variance is that of
an error with correlation time `slip_time`. A wheel that spins or locks differs from the integrated
speed by more than the gate and is weighted down by the square of the excess, so that the
accelerometer carries the speed through braking, traction and slides.

References
----------
U. Kiencke, L. Nielsen, Automotive Control Systems, 2nd ed., Springer 2005, section 9.3 (speed from
weighted wheel speeds and acceleration); P. J. Huber, Robust Statistics, Wiley 1981.
"""

from __future__ import annotations

from math import cos, sin, sqrt

import numpy as np

from gripbench.compilation import compiled
from gripbench.methods.blocks.kalman import correct_scalar, filter_type, predict_covariance
from gripbench.methods.settings import Parameter

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
SPEED_SENSORS = (
    *(f"wheel_speed_{wheel}" for wheel in WHEELS),
    "steer_angle",
    "yaw_rate",
    "accel_x",
)
"""Channels that the fusion reads."""

SPEED_VEHICLE = (
    "mass",
    "cg_to_front",
    "track_front",
    "track_rear",
    "wheel_radius",
    "longitudinal_stiffness",
    "drive_share_front",
    "brake_share_front",
)
"""Vehicle parameters of the fusion."""

SPEED_PARAMETERS = (
    Parameter("accel_x_noise", 0.02, "m/s^2/sqrt(Hz)", "Noise density of a_x", 1e-4, 1.0),
    Parameter("offset_walk", 0.03, "m/s^2/sqrt(s)", "Walk of the accelerometer's offset", 0.0, 1.0),
    Parameter("offset_std", 0.15, "m/s^2", "First standard deviation of that offset", 1e-3, 2.0),
    Parameter("wheel_noise", 0.02, "m/s", "Error of a wheel's rolling speed", 1e-3, 1.0),
    Parameter("radius_std", 0.006, "-", "Relative error of the wheel radius", 0.0, 0.05),
    Parameter("slip_share", 0.5, "-", "Error of the slip over the slip on paper", 0.0, 3.0),
    Parameter("slip_time", 0.2, "s", "Correlation time of a wheel's error", 1e-3, 5.0),
    Parameter("wheel_gate", 2.5, "-", "Deviations beyond which a wheel counts less", 0.5, 10.0),
)
"""Parameters of the fusion."""

SPEED_STATE = np.dtype(
    [
        ("filter", filter_type(2)),  # v_x, offset
        ("started", np.float64),
        ("accel_x", np.float64),  # last readings that were there
        ("yaw_rate", np.float64),
        ("steer_angle", np.float64),
    ]
)
"""State of the fusion; `filter.x` is v_x [m/s] and the accelerometer's offset [m/s^2]."""


@compiled
def _wheel(state, wheel_speed, front, side, speed_y, elapsed, params):
    """Take one wheel; `side` is +1 left and -1 right."""
    filter = state.filter
    accel = state.accel_x - filter.x[1]
    if front:
        ahead, offset, turn = params.cg_to_front, 0.5 * side * params.track_front, state.steer_angle
    else:
        ahead, offset, turn = 0.0, 0.5 * side * params.track_rear, 0.0
    share = params.drive_share_front if accel > 0.0 else params.brake_share_front
    if not front:
        share = 1.0 - share
    slip = share * params.mass * accel / params.longitudinal_stiffness
    slip = min(max(slip, -0.1), 0.1)
    rolling = params.wheel_radius * wheel_speed / (1.0 + slip)
    across = 0.0
    if front:
        across = (speed_y + ahead * state.yaw_rate) * sin(turn)
    measured = (rolling - across) / cos(turn) + state.yaw_rate * offset
    residual = measured - filter.x[0]
    lasting = (params.slip_share * slip * measured) ** 2 + (params.radius_std * measured) ** 2
    error = params.wheel_noise**2 + lasting
    spread = filter.P[0, 0] + error
    excess = abs(residual) / (params.wheel_gate * sqrt(spread))
    weight = 1.0 / max(1.0, excess * excess)
    variance = error * params.slip_time / elapsed / weight
    correct_scalar(filter, residual, variance)


@compiled
def advance_speed(state, obs, params, speed_y):
    """Take one sample.

    Parameters
    ----------
    state
        Record of `SPEED_STATE`.
    obs
        Record with `SPEED_SENSORS` and `elapsed`; what is NaN is left out.
    params
        Record with `SPEED_PARAMETERS` and `SPEED_VEHICLE`.
    speed_y
        Lateral velocity [m/s] as far as it is known.
    """
    filter = state.filter
    elapsed = obs.elapsed
    if obs.yaw_rate == obs.yaw_rate:
        state.yaw_rate = obs.yaw_rate
    if obs.steer_angle == obs.steer_angle:
        state.steer_angle = obs.steer_angle
    before = state.accel_x
    if obs.accel_x == obs.accel_x:
        state.accel_x = obs.accel_x
    speeds = (
        obs.wheel_speed_front_left,
        obs.wheel_speed_front_right,
        obs.wheel_speed_rear_left,
        obs.wheel_speed_rear_right,
    )
    if state.started == 0.0:
        total, count = 0.0, 0
        for speed in speeds:
            if speed == speed:
                total += speed
                count += 1
        if count == 0:
            return
        state.started = 1.0
        filter.x[0] = params.wheel_radius * total / count
        filter.P[0, 0] = 0.25 + (params.radius_std * filter.x[0]) ** 2
        filter.P[1, 1] = params.offset_std**2
        filter.F[0, 0] = filter.F[1, 1] = 1.0
        filter.h[0] = 1.0
        elapsed = 0.01
    elif elapsed > 0.0:
        filter.x[0] += elapsed * (
            0.5 * (before + state.accel_x) - filter.x[1] + state.yaw_rate * speed_y
        )
        filter.F[0, 1] = -elapsed
        filter.Q[0, 0] = params.accel_x_noise**2 * elapsed
        filter.Q[1, 1] = params.offset_walk**2 * elapsed
        predict_covariance(filter)
    else:
        return
    for i in range(4):
        if speeds[i] == speeds[i]:
            side = 1.0 if i % 2 == 0 else -1.0
            _wheel(state, speeds[i], i < 2, side, speed_y, elapsed, params)
