"""Extended Kalman filter of Dakhlallah, Glaser, Mammar & Sebsadji (2008) on a Dugoff tyre.

The four-wheel model with the states v_x, v_y and yaw rate is driven by steering angle, wheel
speeds and the accelerations (for the wheel loads); longitudinal speed and yaw rate correct it. Out
come sideslip (eq. 17), tyre forces and the used friction of each wheel (eq. 16): what the wheel
draws from the road, not what the road has to offer.

Errata, corrected here; `gripbench.methods.printed.dakhlallah2008` has the printed forms:

- (1): psi is the yaw rate in the first two rows, its derivative in the third; the tyre forces of
  the front axle turn with the steering angle.
- (2), (4): 1 - |lambda|.
- (5): lambda compares the rolling speed with the speed in the plane of the wheel.
- (6): S_b is the full track. The text calls the 1.5 m of its table an axle length; read as half
  of that (`load_transfer_track` 0.5), the transfer doubles.
- (11): F is the Jacobian of f + g; that of f alone lacks the tyres.
- (12): the correction starts from the forecast x(k|k-1), printed is x(k-1|k-1) twice; H is the
  Jacobian of h, not of f.

One improvement on the paper: the prediction takes the midpoint rule over the mean of two samples'
inputs instead of forward Euler on the older ones.

The output v_x is a measurement of this filter, though none of the sensors that the paper lists
gives it; here it is the channel of an optical speed sensor.

Of its variance: the friction is assumed. On snow and ice the forces are wrong for as long as the
road is, and Q, white, stands for errors that pass from sample to sample.
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt

import numpy as np

from gripbench.envs.vehicles import GRAVITY
from gripbench.methods.blocks.dugoff_tyre import dugoff_force, dugoff_slips
from gripbench.methods.blocks.kalman import (
    correct_scalar,
    filter_type,
    innovation_variance,
    predict_covariance,
)
from gripbench.methods.contract import CompiledMethod, Parameter, compiled

DUGOFF_STATE = np.dtype(
    [
        ("filter", filter_type(3)),  # v_x, v_y, yaw rate
        ("time", np.float64),
        ("samples", np.float64),
        ("rate", np.float64, (3,)),  # f(x, u), time derivative of the states
        ("slope", np.float64, (3, 3)),  # df/dx
        ("wheels", np.float64, (4, 3)),  # forces along and across the wheel, load [N]
        ("rolling", np.float64, (4,)),  # wheel radius times wheel speed [m/s]
        ("steer_angle", np.float64),
        ("accel_x", np.float64),
        ("accel_y", np.float64),
    ]
)
"""State of the filter with the model's last evaluation; wheels fl, fr, rl, rr."""

_FIRST_SAMPLE = 0.01
"""Time [s] over which the first reading counts, which has no predecessor."""

DUGOFF_PARAMETERS = (
    Parameter("friction", 0.8, "-", "Friction coefficient that the tyre model assumes", 0.01, 2.0),
    Parameter("speed_x_walk", 2e-2, "m^2/s^3", "Process noise of v_x", 0.0),
    Parameter("speed_y_walk", 0.15, "m^2/s^3", "Process noise of v_y", 0.0),
    Parameter("yaw_rate_walk", 1e-2, "rad^2/s^3", "Process noise of the yaw rate", 0.0),
    Parameter("speed_x_noise", 5e-3, "m/s/sqrt(Hz)", "Density of the speed sensor's noise", 1e-9),
    Parameter("yaw_rate_noise", 1.745e-4, "rad/s/sqrt(Hz)", "Density of the gyro's noise", 1e-9),
    Parameter("speed_y_std", 0.1, "m/s", "Standard deviation of v_y at the start", 0.0),
    Parameter("lowest_speed", 2.0, "m/s", "Speed below which the slips are held at it", 0.1),
    Parameter("correction", True, "-", "Measurements correct the model; else it runs open loop"),
    Parameter("load_transfer_track", 1.0, "-", "Share of the track in eq. 6", 0.1, 2.0),
)


@compiled
def evaluate(state, params):
    """Evaluate the model at the state and the inputs in `state`: rate, slope and wheels."""
    x = state.filter.x
    rate, slope, wheels = state.rate, state.slope, state.wheels
    base = params.cg_to_front + params.cg_to_rear
    half = 0.5 * params.mass / base
    pitch = half * params.cg_height * state.accel_x
    stiffness_x = 0.5 * params.longitudinal_stiffness
    front_c, front_s = cos(state.steer_angle), sin(state.steer_angle)
    rate[0], rate[1], rate[2] = x[2] * x[1], -x[2] * x[0], 0.0
    slope[0, 0], slope[0, 1], slope[0, 2] = 0.0, x[2], x[1]
    slope[1, 0], slope[1, 1], slope[1, 2] = -x[2], 0.0, -x[0]
    slope[2, 0], slope[2, 1], slope[2, 2] = 0.0, 0.0, 0.0
    for i in range(4):
        front = i < 2
        if front:
            track, lx, other = params.track_front, params.cg_to_front, params.cg_to_rear
            c, s = front_c, front_s
            stiffness_y = 0.5 * params.cornering_stiffness_front
            load = half * other * GRAVITY - pitch
        else:
            track, lx, other = params.track_rear, -params.cg_to_rear, params.cg_to_front
            c, s = 1.0, 0.0
            stiffness_y = 0.5 * params.cornering_stiffness_rear
            load = half * other * GRAVITY + pitch
        side = 1.0 if i % 2 == 0 else -1.0  # left, right
        arm = params.load_transfer_track * track
        load -= side * 2.0 * half * other * params.cg_height * state.accel_y / arm
        load = max(load, 0.0)
        ly = side * 0.5 * track
        along_r, across_r = s * lx - c * ly, c * lx + s * ly
        along = c * x[0] + s * x[1] + along_r * x[2]
        across = c * x[1] - s * x[0] + across_r * x[2]
        moving = 1.0 if along > params.lowest_speed else 0.0
        along = max(along, params.lowest_speed)
        rolling = max(state.rolling[i], 0.05 * along)  # a locked wheel has no finite slip
        slip_x, slip_y, d_along, d_mixed, d_across = dugoff_slips(rolling, along, across)
        force_x, force_y, xx, xy, yy = dugoff_force(
            stiffness_x * slip_x, stiffness_y * slip_y, params.friction * load
        )
        wheels[i, 0], wheels[i, 1], wheels[i, 2] = force_x, force_y, load
        body_x, body_y = c * force_x - s * force_y, s * force_x + c * force_y
        rate[0] += body_x / params.mass
        rate[1] += body_y / params.mass
        rate[2] += (lx * body_y - ly * body_x) / params.yaw_inertia
        d_along *= moving * stiffness_x
        d_mixed *= moving * stiffness_y
        d_across *= stiffness_y
        x_along, x_across = xx * d_along + xy * d_mixed, xy * d_across
        y_along, y_across = xy * d_along + yy * d_mixed, yy * d_across
        for j in range(3):
            if j == 0:
                u, v = c, -s
            elif j == 1:
                u, v = s, c
            else:
                u, v = along_r, across_r
            dx, dy = x_along * u + x_across * v, y_along * u + y_across * v
            body_x, body_y = c * dx - s * dy, s * dx + c * dy
            slope[0, j] += body_x / params.mass
            slope[1, j] += body_y / params.mass
            slope[2, j] += (lx * body_y - ly * body_x) / params.yaw_inertia


@compiled
def _read_inputs(state, obs, params, share):
    """Move the inputs by a share of the way to those of a sample."""
    state.steer_angle += share * (obs.steer_angle - state.steer_angle)
    state.accel_x += share * (obs.accel_x - state.accel_x)
    state.accel_y += share * (obs.accel_y - state.accel_y)
    rolling, radius = state.rolling, params.wheel_radius
    rolling[0] += share * (radius * obs.wheel_speed_front_left - rolling[0])
    rolling[1] += share * (radius * obs.wheel_speed_front_right - rolling[1])
    rolling[2] += share * (radius * obs.wheel_speed_rear_left - rolling[2])
    rolling[3] += share * (radius * obs.wheel_speed_rear_right - rolling[3])


@compiled
def transition(state, elapsed):
    """Write the transition matrix of eq. 11 from the model's last evaluation."""
    for i in range(3):
        for j in range(3):
            state.filter.F[i, j] = (1.0 if i == j else 0.0) + elapsed * state.slope[i, j]


@compiled
def advance(state, obs, params, elapsed):
    """Advance the states to a sample by the midpoint rule, eq. 11."""
    x = state.filter.x
    speed_x, speed_y, yaw_rate = x[0], x[1], x[2]
    for i in range(3):
        x[i] += 0.5 * elapsed * state.rate[i]
    _read_inputs(state, obs, params, 0.5)
    evaluate(state, params)
    x[0] = speed_x + elapsed * state.rate[0]
    x[1] = speed_y + elapsed * state.rate[1]
    x[2] = yaw_rate + elapsed * state.rate[2]


@compiled
def _predict(state, obs, params):
    elapsed = obs.time - state.time
    filter = state.filter
    transition(state, elapsed)
    filter.Q[0, 0] = params.speed_x_walk * elapsed
    filter.Q[1, 1] = params.speed_y_walk * elapsed
    filter.Q[2, 2] = params.yaw_rate_walk * elapsed
    predict_covariance(filter)
    advance(state, obs, params, elapsed)


@compiled
def _correct(state, obs, params, est):
    # Noise densities: a reading that is held over several samples counts as one.
    filter = state.filter
    x, h = filter.x, filter.h
    elapsed = max(obs.time - state.time, 1e-6)
    h[0], h[1], h[2] = 1.0, 0.0, 0.0
    noise = params.speed_x_noise**2 / elapsed
    est.speed_x_innovation = obs.speed_x - x[0]
    est.speed_x_innovation_variance = innovation_variance(filter, noise)
    correct_scalar(filter, obs.speed_x - x[0], noise)
    h[0], h[1], h[2] = 0.0, 0.0, 1.0
    noise = params.yaw_rate_noise**2 / elapsed
    est.yaw_rate_innovation = obs.yaw_rate - x[2]
    est.yaw_rate_innovation_variance = innovation_variance(filter, noise)
    correct_scalar(filter, obs.yaw_rate - x[2], noise)


@compiled
def _used(wheels, i):
    """Return the used friction of a wheel, 0 for one in the air."""
    if wheels[i, 2] <= 0.0:
        return 0.0
    return sqrt(wheels[i, 0] ** 2 + wheels[i, 1] ** 2) / wheels[i, 2]


@compiled
def _step(state, obs, params, est):
    filter = state.filter
    x, P, wheels = filter.x, filter.P, state.wheels
    est.speed_x_innovation, est.speed_x_innovation_variance = 0.0, 0.0
    est.yaw_rate_innovation, est.yaw_rate_innovation_variance = 0.0, 0.0
    if state.samples == 0.0:
        x[0], x[2] = obs.speed_x, obs.yaw_rate
        P[0, 0] = params.speed_x_noise**2 / _FIRST_SAMPLE
        P[1, 1] = params.speed_y_std**2
        P[2, 2] = params.yaw_rate_noise**2 / _FIRST_SAMPLE
    else:
        _predict(state, obs, params)
        if params.correction > 0.0:
            _correct(state, obs, params, est)
    state.samples += 1.0
    state.time = obs.time
    _read_inputs(state, obs, params, 1.0)
    evaluate(state, params)

    forward = max(x[0], params.lowest_speed)
    square = forward * forward + x[1] * x[1]
    est.speed_x, est.speed_y, est.yaw_rate = x[0], x[1], x[2]
    est.sideslip = atan2(x[1], forward)
    est.speed_x_variance, est.speed_y_variance, est.yaw_rate_variance = P[0, 0], P[1, 1], P[2, 2]
    est.sideslip_variance = (
        x[1] * x[1] * P[0, 0] - 2.0 * x[1] * forward * P[0, 1] + forward * forward * P[1, 1]
    ) / (square * square)
    est.force_x_front_left, est.force_y_front_left = wheels[0, 0], wheels[0, 1]
    est.force_x_front_right, est.force_y_front_right = wheels[1, 0], wheels[1, 1]
    est.force_x_rear_left, est.force_y_rear_left = wheels[2, 0], wheels[2, 1]
    est.force_x_rear_right, est.force_y_rear_right = wheels[3, 0], wheels[3, 1]
    est.force_z_front_left, est.force_z_front_right = wheels[0, 2], wheels[1, 2]
    est.force_z_rear_left, est.force_z_rear_right = wheels[2, 2], wheels[3, 2]
    est.mu_used_front_left = _used(wheels, 0)
    est.mu_used_front_right = _used(wheels, 1)
    est.mu_used_rear_left = _used(wheels, 2)
    est.mu_used_rear_right = _used(wheels, 3)
    est.mu_used = 0.25 * (
        est.mu_used_front_left
        + est.mu_used_front_right
        + est.mu_used_rear_left
        + est.mu_used_rear_right
    )


_WHEELS = ("front_left", "front_right", "rear_left", "rear_right")


class DugoffEkf(CompiledMethod):
    """Extended Kalman filter over the four-wheel model with Dugoff tyres."""

    name = "dugoff_ekf"
    title = "Dugoff EKF"
    reference = "Dakhlallah, Glaser, Mammar & Sebsadji 2008, eq. 1-12, 16 and 17"
    sensors = (
        "speed_x",
        "yaw_rate",
        "steer_angle",
        "accel_x",
        "accel_y",
        *(f"wheel_speed_{wheel}" for wheel in _WHEELS),
    )
    estimates = (
        "sideslip",
        "speed_x",
        "speed_y",
        "yaw_rate",
        *(f"force_x_{wheel}" for wheel in _WHEELS),
        *(f"force_y_{wheel}" for wheel in _WHEELS),
        *(f"force_z_{wheel}" for wheel in _WHEELS),
        *(f"mu_used_{wheel}" for wheel in _WHEELS),
        "mu_used",
    )
    variances = ("sideslip", "speed_x", "speed_y", "yaw_rate")
    innovations = ("speed_x", "yaw_rate")
    vehicle_parameters = (
        "mass",
        "yaw_inertia",
        "cg_to_front",
        "cg_to_rear",
        "cg_height",
        "track_front",
        "track_rear",
        "wheel_radius",
        "longitudinal_stiffness",
        "cornering_stiffness_front",
        "cornering_stiffness_rear",
    )
    parameters = DUGOFF_PARAMETERS
    variants = {"open_loop": {"correction": False}}
    printed = "gripbench.methods.printed.dakhlallah2008"
    state = DUGOFF_STATE
    step = staticmethod(_step)
