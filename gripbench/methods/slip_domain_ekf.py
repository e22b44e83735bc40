"""Friction from wheel speeds, torques, accelerometer, GPS: an extended Kalman filter on the slip.

Gripbench's own estimator for straight driving; docs/estimator.md derives it. States: speed,
accelerometer bias, acceleration by the grade, 1/mu, radius error of each axle, logarithm of the
tyre's stiffness, mass, age of the GPS speed. Samples of 20 ms are taken as one; in them

- the balance of a wheel gives its tyre force from the torque, F = (T - I dw/dt)/R, whatever the
  wheel does in between;
- **slip**, R (1 + rho) w (1 - s) = v, with s = g(F / (mu F_z)) from the inverse of the tyre's
  curve, is linear in 1/mu where tyres are, so that errors of the speed do not pull the friction to
  one side as they do where a force is regressed on a noisy slip;
- where the curve bends over, the **force** over the load is compared with mu times the curve;
- **GPS** tells the speed of some time ago, and while coasting the radii;
- the sum of the forces over the accelerometer tells the **mass** (Newton).

A step of the friction is found by cumulated innovations (Page 1954; Gustafsson 1997), which opens
the variance of 1/mu again. What the tyre's stiffness on paper leaves open stays in the variance of
the friction; without excitation it returns to the prior.
"""

from __future__ import annotations

from math import exp, sqrt

import numpy as np

from gripbench.compilation import inlined
from gripbench.envs.tyres.longitudinal import magic_formula_slope
from gripbench.envs.vehicles import GRAVITY
from gripbench.methods.blocks.axle_friction import (
    AXLE_LOAD_PARAMETERS,
    RESISTANCE_PARAMETERS,
    TYRE_PARAMETERS,
    front_load,
    rear_load,
)
from gripbench.methods.blocks.change_detection import (
    CHANGE_STATE,
    chance_of_change,
    has_changed,
)
from gripbench.methods.blocks.fast_forces import (
    FORCE_PARAMETERS,
    FORCE_STATE,
    steady_turn,
    tyre_slope,
    write_forces,
)
from gripbench.methods.blocks.inverse_slip import inverse_slip
from gripbench.methods.blocks.kalman import correct_scalar, filter_type, predict_covariance
from gripbench.methods.contract import CompiledMethod, Parameter, Variant, compiled

SPEED, BIAS, GRADE, FLEX, RADIUS_FRONT, RADIUS_REAR, STIFFNESS, MASS, AGE = range(9)
STATES = 9

_SUMS = ("span", "count", "wheel_front", "wheel_rear", "torque_front", "torque_rear", "accel_x")
_STATE = np.dtype(
    [("filter", filter_type(STATES)), ("change", CHANGE_STATE), ("forces", FORCE_STATE)]
    + [(f"sum_{name}", np.float64) for name in _SUMS]
    + [
        (name, np.float64)
        for name in (
            "wheel_front", "wheel_rear", "started", "sum_gps", "sum_gps_time", "gps_count",
            "end_front", "end_rear",
        )
    ]
)  # fmt: skip


@inlined
def _clear(state):
    state.sum_span, state.sum_count = 0.0, 0.0
    state.sum_wheel_front, state.sum_wheel_rear = 0.0, 0.0
    state.sum_torque_front, state.sum_torque_rear = 0.0, 0.0
    state.sum_accel_x, state.sum_gps, state.sum_gps_time, state.gps_count = 0.0, 0.0, 0.0, 0.0


@compiled
def _start(state, params):
    x, P = state.filter.x, state.filter.P
    mean, ratio = params.friction_mean, params.friction_spread / params.friction_mean
    x[FLEX] = (1.0 + ratio * ratio) / mean
    P[FLEX, FLEX] = (ratio / mean) ** 2 * (1.0 + 3.0 * ratio * ratio)
    x[RADIUS_FRONT] = x[RADIUS_REAR] = params.radius_mean
    x[MASS] = 1.0 + params.payload_mean
    x[AGE] = params.gps_age
    P[BIAS, BIAS] = params.accel_bias_std**2
    P[GRADE, GRADE] = params.grade_std**2
    P[RADIUS_FRONT, RADIUS_FRONT] = P[RADIUS_REAR, RADIUS_REAR] = params.radius_std**2
    P[RADIUS_FRONT, RADIUS_REAR] = P[RADIUS_REAR, RADIUS_FRONT] = 0.6 * params.radius_std**2
    P[STIFFNESS, STIFFNESS] = params.stiffness_std**2
    P[MASS, MASS] = params.payload_std**2
    P[AGE, AGE] = params.gps_age_std**2


@compiled
def _predict(state, span, accel, params):
    filter = state.filter
    x, F, Q = filter.x, filter.F, filter.Q
    for i in range(STATES):
        F[i, i] = 1.0
    F[SPEED, BIAS], F[SPEED, GRADE] = -span, span
    Q[SPEED, SPEED] = params.accel_x_noise**2 * span
    Q[BIAS, BIAS] = params.accel_bias_walk**2 * span
    Q[GRADE, GRADE] = params.grade_walk**2 * span
    Q[FLEX, FLEX] = params.flex_walk**2 * span
    Q[RADIUS_FRONT, RADIUS_FRONT] = Q[RADIUS_REAR, RADIUS_REAR] = params.radius_walk**2 * span
    x[SPEED] += span * (accel - x[BIAS] + x[GRADE])
    predict_covariance(filter)


@compiled
def _gps(state, rate, params):
    """Take the mean of the new GPS speeds; `rate` is the rate of change of speed [m/s^2]."""
    if state.gps_count == 0.0:
        return
    filter = state.filter
    x, h = filter.x, filter.h
    h[:] = 0.0
    h[SPEED], h[AGE] = 1.0, -rate
    late = state.sum_span - state.sum_gps_time / state.gps_count + x[AGE]
    residual = state.sum_gps / state.gps_count - (x[SPEED] - rate * late)
    correct_scalar(filter, residual, params.gps_speed_noise**2 / state.gps_count)


@compiled
def _newton(state, span, force, accel, params):
    """Take the sum of the tyre forces [N] against mass and acceleration."""
    filter = state.filter
    x, h = filter.x, filter.h
    specific = accel - x[BIAS] + params.rolling_resistance * GRAVITY
    drag = params.drag * x[SPEED] ** 2 / params.mass
    h[:] = 0.0
    h[MASS], h[BIAS] = specific, -x[MASS]
    lasting = params.newton_error**2 + (params.torque_error * force / params.mass) ** 2
    residual = force / params.mass - drag - x[MASS] * specific
    correct_scalar(filter, residual, lasting * params.model_time / span)


@compiled
def _axle(state, front, span, rolling, force, load, rate, params):
    """Take one axle; return the innovation of 1/mu over its deviation, along the force.

    Parameters
    ----------
    rolling
        Rolling speed by the radius on paper [m/s], mean of the window.
    force
        Tyre force [N], mean of the window.
    load
        Axle load on paper [N].
    rate
        Rate of change of speed [m/s^2].
    """
    filter = state.filter
    x, h, P = filter.x, filter.h, filter.P
    radius = RADIUS_FRONT if front else RADIUS_REAR
    speed = x[SPEED] - 0.5 * rate * span
    if speed < params.lowest_speed:
        return 0.0
    if abs(force) < params.least_force and P[radius, radius] < params.radius_known**2:
        return 0.0  # neither friction nor radius can be told
    used = force / (load * x[MASS])
    share = used * x[FLEX]
    wheel = params.wheel_noise * params.wheel_radius
    slip = (rolling * (1.0 + x[RADIUS_FRONT if front else RADIUS_REAR]) - speed) / speed
    lasting = params.slip_error * speed
    h[:] = 0.0
    if abs(share) > 0.85 or abs(slip) > params.bend_slip:
        curve, slope = magic_formula_slope(
            slip * exp(x[STIFFNESS]) / (1.0 + max(slip, 0.0)),
            params.magic_b, params.magic_c, params.magic_e,
        )  # fmt: skip
        mu = 1.0 / x[FLEX]
        steep = mu * slope * exp(x[STIFFNESS])
        h[FLEX], h[STIFFNESS] = -mu * mu * curve, steep * slip
        h[SPEED], h[radius], h[MASS] = -steep / speed, steep, used / x[MASS]
        error = (0.3 * params.curve_error * mu) ** 2 * params.model_time
        variance = (error + (steep * wheel / speed) ** 2) / span
        residual = used - mu * curve
        along = 0.0
    else:
        model, slope = inverse_slip(share, params)
        soft = exp(-x[STIFFNESS])
        model *= soft
        slope *= soft
        if force >= 0.0:  # s = (R w - v) / (R w)
            moving, per_slip = speed / (1.0 - model), speed / (1.0 - model) ** 2
        else:  # s = (R w - v) / v
            moving, per_slip = speed * (1.0 + model), speed
        h[SPEED] = moving / speed
        h[radius] = -moving
        h[FLEX] = per_slip * slope * used
        h[STIFFNESS] = -per_slip * model
        h[MASS] = -per_slip * slope * share / x[MASS]
        lasting = lasting * lasting + (params.curve_error * per_slip * model) ** 2
        error = lasting * params.model_time
        error += (
            params.torque_noise / params.wheel_radius * per_slip * slope * x[FLEX] / load
        ) ** 2
        variance = (error + wheel * wheel) / span
        residual = rolling - moving * (1.0 - x[radius])
        along = 1.0 if force > 0.0 else -1.0
    spread = variance
    for i in range(STATES):
        for j in range(STATES):
            spread += h[i] * P[i, j] * h[j]
    correct_scalar(filter, residual, variance)
    return along * residual / sqrt(spread)  # of a curve that has bent over: 0


@compiled
def _window(state, params):
    """Take the samples of a window."""
    filter = state.filter
    x, P = filter.x, filter.P
    span, count = state.sum_span, state.sum_count
    accel = state.sum_accel_x / count
    rate = accel - x[BIAS] + x[GRADE]
    _predict(state, span, accel, params)
    _gps(state, rate, params)
    radius, inertia = params.wheel_radius, params.wheel_inertia
    turn_front = (state.wheel_front - state.end_front) / span
    turn_rear = (state.wheel_rear - state.end_rear) / span
    state.end_front, state.end_rear = state.wheel_front, state.wheel_rear
    force_front = (state.sum_torque_front / count - inertia * turn_front) / radius
    force_rear = (state.sum_torque_rear / count - inertia * turn_rear) / radius
    _newton(state, span, force_front + force_rear, accel, params)
    load_front, load_rear = front_load(params), rear_load(params)
    prior = (params.friction_spread / params.friction_mean**2) ** 2
    wheel_front, wheel_rear = radius * state.sum_wheel_front, radius * state.sum_wheel_rear
    evidence = _axle(state, True, span, wheel_front / count, force_front, load_front, rate, params)
    evidence += _axle(state, False, span, wheel_rear / count, force_rear, load_rear, rate, params)
    excited = abs(force_front) + abs(force_rear) > 2.0 * params.least_force
    if excited and has_changed(state.change, 0.7071 * evidence, params):
        P[FLEX, FLEX] += prior
    x[FLEX] = min(max(x[FLEX], 0.85), 15.0)
    x[MASS] = min(max(x[MASS], 0.7), 1.6)
    x[STIFFNESS] = min(max(x[STIFFNESS], -0.6), 0.6)
    if P[FLEX, FLEX] > 1.5 * prior:  # never less known than before the drive
        shrink = sqrt(1.5 * prior / P[FLEX, FLEX])
        for i in range(STATES):
            P[FLEX, i] *= shrink
            P[i, FLEX] *= shrink
    forces, taken, peak = state.forces, -inertia / radius, x[MASS] / x[FLEX]
    forces.steady_front = taken * steady_turn(turn_front, state.wheel_front, rate, params)
    forces.steady_rear = taken * steady_turn(turn_rear, state.wheel_rear, rate, params)
    front, soft = radius * state.wheel_front * (1.0 + x[RADIUS_FRONT]), x[STIFFNESS]
    rear = radius * state.wheel_rear * (1.0 + x[RADIUS_REAR])
    forces.slope_front = tyre_slope(x[SPEED], front, load_front * peak, soft, force_front, params)
    forces.slope_rear = tyre_slope(x[SPEED], rear, load_rear * peak, soft, force_rear, params)
    _clear(state)


@compiled
def _gather(state, obs, gps, gps_new, params):
    """Add a sample to the window; take the window when it is long enough."""
    state.wheel_front, state.wheel_rear = obs.wheel_speed_front, obs.wheel_speed_rear
    filter = state.filter
    if state.started == 0.0:
        state.started = 1.0
        rolling = 0.5 * params.wheel_radius * (obs.wheel_speed_front + obs.wheel_speed_rear)
        filter.x[SPEED] = rolling
        filter.P[SPEED, SPEED] = 0.04 + (0.02 * rolling) ** 2
        state.end_front, state.end_rear = obs.wheel_speed_front, obs.wheel_speed_rear
        _clear(state)
        return
    if not obs.elapsed > 0.0:
        return
    state.sum_span += min(obs.elapsed, 0.2)
    state.sum_count += 1.0
    state.sum_wheel_front += obs.wheel_speed_front
    state.sum_wheel_rear += obs.wheel_speed_rear
    state.sum_torque_front += obs.torque_front
    state.sum_torque_rear += obs.torque_rear
    state.sum_accel_x += obs.accel_x
    if gps_new:
        state.sum_gps += gps
        state.sum_gps_time += state.sum_span
        state.gps_count += 1.0
    if state.sum_span >= params.window_time - 1e-9:
        _window(state, params)


@compiled
def _write(state, obs, params, est):
    x, P = state.filter.x, state.filter.P
    mu = 1.0 / x[FLEX]
    ratio = min(P[FLEX, FLEX] / x[FLEX] ** 2, 0.25)
    est.mu_front = est.mu_rear = mu * (1.0 + ratio)
    variance = mu * mu * (ratio + params.shape_error**2)
    # what a change that has not been found yet would make of it
    changed = chance_of_change(state.change, params.change_odds, params)
    away = params.friction_mean - est.mu_front
    other = params.friction_spread**2 + away * away
    est.mu_front_variance = est.mu_rear_variance = variance + changed * (other - variance)
    rate = obs.accel_x - x[BIAS] + x[GRADE]
    est.speed_x = x[SPEED] + state.sum_span * rate
    est.speed_x_variance = P[SPEED, SPEED]
    write_forces(state.forces, obs, est.speed_x, obs.accel_x - x[BIAS], x[MASS], params, est)


@compiled
def _step(state, obs, params, est):
    _gather(state, obs, obs.speed_gps, obs.speed_gps_new > 0.0, params)
    _write(state, obs, params, est)


@compiled
def _step_production(state, obs, params, est):
    _gather(state, obs, 0.0, False, params)
    _write(state, obs, params, est)


_SENSORS = ("wheel_speed_front", "wheel_speed_rear", "torque_front", "torque_rear", "accel_x")


class SlipDomainEkf(CompiledMethod):
    """Friction, speed, radii, mass and biases from the slip.

    `production` has no GPS; `as_on_paper` trusts that the car is the one on paper.
    """

    name = "slip_domain_ekf"
    title = "Slip-domain EKF"
    reference = "gripbench, docs/estimator.md"
    sensors = (*_SENSORS, "speed_gps", "speed_gps_new")
    estimates = ("mu_front", "mu_rear", "force_x_front", "force_x_rear", "speed_x")
    variances = ("mu_front", "mu_rear", "speed_x")
    vehicle_parameters = (
        *AXLE_LOAD_PARAMETERS,
        *RESISTANCE_PARAMETERS,
        *TYRE_PARAMETERS,
        "wheel_radius",
        "wheel_inertia",
    )
    parameters = (
        Parameter("friction_mean", 0.75, "-", "Mean of the friction before the drive", 0.1, 1.2),
        Parameter("friction_spread", 0.25, "-", "Its standard deviation", 0.02, 1.0),
        Parameter("flex_walk", 0.02, "1/sqrt(s)", "Walk of 1/mu", 0.0, 1.0),
        Parameter("window_time", 0.02, "s", "Samples of this time are taken as one", 2e-3, 0.2),
        Parameter("wheel_noise", 2e-3, "rad/s/sqrt(Hz)", "Density of wheel speeds", 1e-5, 0.1),
        Parameter("torque_noise", 0.5, "N m/sqrt(Hz)", "Density of the torque's noise", 1e-3, 50.0),
        Parameter("torque_error", 0.03, "-", "Relative error of the torque", 1e-4, 0.3),
        Parameter("accel_x_noise", 0.01, "m/s^2/sqrt(Hz)", "Density of a_x's noise", 1e-5, 1.0),
        Parameter("accel_bias_std", 0.06, "m/s^2", "Bias of the accelerometer", 1e-4, 1.0),
        Parameter("accel_bias_walk", 0.002, "m/s^2/sqrt(s)", "Walk of that bias", 0.0, 0.1),
        Parameter("grade_std", 0.13, "m/s^2", "Acceleration by the grade", 1e-4, 2.0),
        Parameter("grade_walk", 0.03, "m/s^2/sqrt(s)", "Walk of that acceleration", 0.0, 1.0),
        Parameter("gps_speed_noise", 0.05, "m/s", "Noise of a GPS speed", 1e-4, 5.0),
        Parameter("gps_age", 0.05, "s", "Age of a GPS speed", 0.0, 1.0),
        Parameter("gps_age_std", 0.05, "s", "Its standard deviation", 1e-5, 1.0),
        Parameter("radius_mean", -0.004, "-", "Radius over that on paper, less 1", -0.02, 0.02),
        Parameter("radius_std", 0.005, "-", "Its standard deviation", 1e-5, 0.05),
        Parameter("radius_known", 0.0, "-", "Deviation at which a radius is known", 0.0, 0.01),
        Parameter("radius_walk", 2e-4, "1/sqrt(s)", "Walk of the radii", 0.0, 0.01),
        Parameter("stiffness_std", 0.14, "-", "Relative error of the tyre's stiffness", 1e-3, 0.5),
        Parameter("payload_mean", 0.08, "-", "Payload over the mass on paper", 0.0, 0.5),
        Parameter("payload_std", 0.06, "-", "Its standard deviation", 1e-4, 0.5),
        Parameter("newton_error", 0.03, "m/s^2", "Lasting error of the forces' sum", 1e-4, 1.0),
        Parameter("curve_error", 0.15, "-", "Relative error of the tyre's curve", 1e-4, 0.5),
        Parameter("slip_error", 2e-4, "-", "Lasting error of a slip", 0.0, 0.01),
        Parameter("model_time", 1.0, "s", "Correlation time of those errors", 1e-2, 10.0),
        Parameter("bend_slip", 0.04, "-", "Slip beyond which forces are compared", 0.005, 0.5),
        Parameter("shape_error", 0.05, "-", "Error of mu by the curve's shape", 0.0, 0.5),
        Parameter("change_odds", 0.02, "-", "Odds of a change not found yet", 0.0, 1.0),
        Parameter("drift", 0.6, "-", "Evidence of a window that counts as none", 0.0, 5.0),
        Parameter("threshold", 5.0, "-", "Evidence that is a change of friction", 0.5, 100.0),
        Parameter("least_force", 100.0, "N", "Force that tells of the friction", 0.0, 1e4),
        Parameter("lowest_speed", 0.5, "m/s", "Speed below which no slip is taken", 0.05, 10.0),
        *FORCE_PARAMETERS,
    )
    variants = {
        "as_on_paper": {
            "friction_mean": 0.8,
            "radius_mean": 0.0,
            "radius_std": 1e-5,
            "radius_walk": 0.0,
            "radius_known": 3e-4,
            "stiffness_std": 0.01,
            "payload_mean": 0.0,
            "payload_std": 0.005,
            "gps_age": 0.0,
            "gps_age_std": 1e-3,
            "gps_speed_noise": 0.002,
            "wheel_noise": 3e-4,
            "torque_noise": 0.1,
            "flex_walk": 0.01,
            "threshold": 6.0,
            "curve_error": 0.02,
            "shape_error": 0.01,
            "slip_error": 5e-5,
            "model_time": 0.1,
        },
        "production": Variant(sensors=_SENSORS, step=_step_production),
    }
    state = _STATE
    start = staticmethod(_start)
    step = staticmethod(_step)
