"""Sideslip and friction from production sensors: kinematics and tyres, weighed by what each tells.

Gripbench's own estimator for turns; docs/estimator.md derives it. Every hypothesis is a class of
friction with a filter of its own over

    v_y, r, accelerometer offset, ln C_f, ln C_r (relative to paper), steering offset, ln mu.

- The lateral velocity is *integrated from the accelerometer*, d v_y/dt = a_y - offset - r v_x, so
  that no tyre model is needed where the tyres slide; the body's roll on its springs is taken off.
- The tyres enter as *measurements* of a_y and of the yaw acceleration. Where they slide, the
  Jacobian to v_y is zero by itself and kinematics carry the estimate; where they do not, it is
  steep and removes the drift of the integration.
- Errors of a tyre model last, so its measurement has the variance of an error with a correlation
  time; likelihoods inherit that, and the weights do not become certain of noise.
- One more hypothesis is a *bank of the road that changes*: its tyres grip, its friction is that of
  the prior, and its accelerometer offset walks fast. Without it a bank is a slide on ice.
- Classes of friction are Markovian (`blocks.hypotheses`) and return to the prior where nothing is
  excited: the variance of the friction then says that it is not known.
- The longitudinal speed comes from `blocks.speed_fusion`; braking and traction take their share of
  the friction ellipse and move the load.

Of its variance: offset, stiffness and steering zero are states, so it is nearly consistent for the
sideslip. The friction's is too small where a bank of the road is explained by a slide, and under
uneven friction left and right, which is no hypothesis.
"""

from __future__ import annotations

from math import atan2, exp, log, sqrt

import numpy as np

from gripbench.envs.vehicles import GRAVITY
from gripbench.methods.blocks.hypotheses import (
    bank_type,
    mix,
    moments,
    put,
    score_of,
    take,
    weigh,
)
from gripbench.methods.blocks.kalman import correct_scalar, filter_type, predict_covariance
from gripbench.methods.blocks.single_track import (
    LOWEST_SPEED,
    SINGLE_TRACK_VEHICLE,
    axle_loads,
    motion,
)
from gripbench.methods.blocks.speed_fusion import (
    SPEED_PARAMETERS,
    SPEED_SENSORS,
    SPEED_STATE,
    SPEED_VEHICLE,
    advance_speed,
)
from gripbench.methods.contract import CompiledMethod, Parameter, compiled

V_Y, RATE, OFFSET, FRONT, REAR, STEER, MU = range(7)
STATES = 7
CLASSES = 8
BANKING = CLASSES  # the hypothesis behind the classes: the bank of the road changes
GRIP = 1.0  # friction at which its tyres do not slide
_LEAST_CLASS, _LARGEST_CLASS = log(0.1), log(1.1)
_WIDTH = (_LARGEST_CLASS - _LEAST_CLASS) / (CLASSES - 1)

_SUMS = ("count", "span", "steer", "speed", "accel_x", "accel_y", "accels", "rate", "rates")
_STATE = np.dtype(
    [
        ("speed", SPEED_STATE),
        ("filter", filter_type(STATES)),
        ("bank", bank_type(CLASSES + 1, STATES)),
        ("center", np.float64, (CLASSES + 1,)),  # ln mu to which a hypothesis returns
        ("width", np.float64, (CLASSES + 1,)),  # its standard deviation there
        ("motion", np.float64, (2, 7)),
        ("roll", np.float64),
        ("roll_rate", np.float64),
        ("accel_y", np.float64),  # last specific force along y, less roll
        ("rate", np.float64),
        ("started", np.float64),
        ("speed_y", np.float64),
    ]
    + [(f"sum_{name}", np.float64) for name in _SUMS]
)


@compiled
def _start(state, params):
    """Set every hypothesis to the same first state, and weights by the prior of the friction."""
    bank = state.bank
    total, first, second = 0.0, 0.0, 0.0
    for j in range(CLASSES):
        center = _LEAST_CLASS + j * _WIDTH
        mu = exp(center)
        away = (mu - params.friction_mean) / params.friction_spread
        bank.prior[j] = mu * exp(-0.5 * away * away) + 1e-4  # a class is as wide as its mu
        total += bank.prior[j]
        first += bank.prior[j] * center
        second += bank.prior[j] * center * center
        state.center[j], state.width[j] = center, params.class_width * _WIDTH
    for j in range(CLASSES):
        bank.prior[j] *= (1.0 - params.banking_share) / total
    bank.prior[BANKING] = params.banking_share
    state.center[BANKING] = first / total
    state.width[BANKING] = sqrt(second / total - (first / total) ** 2)
    for j in range(CLASSES + 1):
        bank.weight[j] = bank.prior[j]
        bank.x[j, MU] = state.center[j]
        bank.P[j, V_Y, V_Y] = params.speed_y_std**2
        bank.P[j, RATE, RATE] = 0.01
        bank.P[j, OFFSET, OFFSET] = params.offset_y_std**2
        bank.P[j, FRONT, FRONT] = params.stiffness_std**2
        bank.P[j, REAR, REAR] = params.stiffness_std**2
        bank.P[j, STEER, STEER] = params.steer_offset_std**2
        bank.P[j, MU, MU] = state.width[j] ** 2


@compiled
def _unrolled(state, obs, params):
    """Return the specific force along y [m/s^2] without the share of g that the roll adds."""
    accel = obs.accel_y - GRAVITY * state.roll
    if accel != accel:
        accel = state.accel_y
    h = min(obs.elapsed, 0.02)
    w = params.roll_frequency
    state.roll_rate += h * (
        w * w * (params.roll_gradient * accel - state.roll)
        - 2.0 * params.roll_damping * w * state.roll_rate
    )
    state.roll += h * state.roll_rate
    state.accel_y = accel
    return accel


@compiled
def _limits(mu, accel_x, params):
    """Return what braking or traction leaves of the axles' friction across [N]."""
    load_front, load_rear = axle_loads(accel_x, params)
    share = params.drive_share_front if accel_x > 0.0 else params.brake_share_front
    along_front = share * params.mass * accel_x
    along_rear = (1.0 - share) * params.mass * accel_x
    front, rear = mu * load_front, mu * load_rear
    left_front = max(front * front - along_front * along_front, 0.16 * front * front)
    left_rear = max(rear * rear - along_rear * along_rear, 0.16 * rear * rear)
    return sqrt(left_front), sqrt(left_rear)


@compiled
def _evaluate(state, j, x, steer, speed, accel_x, params):
    front, rear = _limits(GRIP if j == BANKING else exp(x[MU]), accel_x, params)
    motion(
        speed, x, steer + x[STEER],
        params.cornering_stiffness_front * exp(x[FRONT]),
        params.cornering_stiffness_rear * exp(x[REAR]),
        front, rear, params, state.motion,
    )  # fmt: skip


@compiled
def _row(state, j, row, h):
    """Copy a row of the motion's slopes into the order of the states."""
    out = state.motion
    h[V_Y], h[RATE], h[OFFSET] = out[row, 1], out[row, 2], 0.0
    h[FRONT], h[REAR], h[STEER] = out[row, 4], out[row, 5], out[row, 6]
    h[MU] = 0.0 if j == BANKING else out[row, 3]


@compiled
def _predict(state, j, span, steer, speed, accel_x, accel_y, params):
    """Advance a hypothesis: kinematics for v_y, tyres for the yaw rate.

    Returns the log-likelihood of a sideslip that is usual.
    """
    filter = state.filter
    x, F, Q, h = filter.x, filter.F, filter.Q, filter.h
    _evaluate(state, j, x, steer, speed, accel_x, params)
    _row(state, j, 1, h)
    stiffness = params.cornering_stiffness_front * exp(x[FRONT])
    stiffness += params.cornering_stiffness_rear * exp(x[REAR])
    # share of the linear tyres' slope that is left: 1 where they grip, 0 where both slide
    gripping = min(max(-state.motion[0, 1] * params.mass * speed / stiffness, 0.0), 1.0)
    changing = params.banking_walk if j == BANKING else params.bank_walk
    walk = params.offset_y_walk + changing * gripping
    center, width = state.center[j], state.width[j]
    kept = exp(-span / params.class_time)
    for i in range(STATES):
        for k in range(STATES):
            F[i, k] = 1.0 if i == k else 0.0
            Q[i, k] = 0.0
        F[RATE, i] += span * h[i]
    F[V_Y, RATE] = -span * speed
    F[V_Y, OFFSET] = -span
    F[MU, MU] = kept
    x[V_Y] += span * (accel_y - x[OFFSET] - x[RATE] * speed)
    x[RATE] += span * state.motion[1, 0]
    x[MU] = center + kept * (x[MU] - center)
    # a slide is rare: a car moves within some angle of where it points
    usual = (params.usual_sideslip * speed) ** 2 / span
    h[:] = 0.0
    h[V_Y] = 1.0
    lever = params.mass * params.cg_to_front / params.yaw_inertia
    unsure = (params.model_error * accel_y * lever) ** 2 + (params.brake_moment * accel_x) ** 2
    unsure *= params.model_time
    Q[V_Y, V_Y] = (params.accel_y_noise**2 + (params.roll_error * accel_y) ** 2) * span
    Q[RATE, RATE] = (params.yaw_rate_walk**2 + unsure) * span
    Q[OFFSET, OFFSET] = walk * walk * span
    Q[FRONT, FRONT] = Q[REAR, REAR] = params.stiffness_walk**2 * span
    Q[MU, MU] = (1.0 - kept * kept) * width * width
    predict_covariance(filter)
    score = score_of(correct_scalar(filter, -x[V_Y], usual), filter.P[V_Y, V_Y] + usual)
    if j == BANKING:  # so is a steep bank
        usual = params.usual_bank**2 / span
        h[V_Y], h[OFFSET] = 0.0, 1.0
        score += score_of(
            correct_scalar(filter, -x[OFFSET], usual), filter.P[OFFSET, OFFSET] + usual
        )
        score -= score_of(0.0, usual)  # its constant, which the other hypotheses do not have
    return score


@compiled
def _correct(state, j, span, steer, speed, accel_x, accel_y, rate, params):
    """Take yaw rate and lateral force where they are known; return the log-likelihood."""
    filter = state.filter
    x, h = filter.x, filter.h
    score = 0.0
    if rate == rate:
        h[:] = 0.0
        h[RATE] = 1.0
        variance = params.gyro_noise**2 / span
        spread = filter.P[RATE, RATE] + variance
        score += score_of(correct_scalar(filter, rate - x[RATE], variance), spread)
    if accel_y == accel_y:
        _evaluate(state, j, x, steer, speed, accel_x, params)
        _row(state, j, 0, h)
        lasting = params.model_floor**2 + (params.model_error * accel_y) ** 2
        variance = lasting * params.model_time / span
        spread = lasting
        for i in range(STATES):
            for k in range(STATES):
                spread += h[i] * filter.P[i, k] * h[k]
        residual = accel_y - state.motion[0, 0]
        score += score_of(residual * residual / spread, spread)
        correct_scalar(filter, residual, variance)
    x[FRONT] = min(max(x[FRONT], -0.7), 0.7)
    x[REAR] = min(max(x[REAR], -0.7), 0.7)
    x[MU] = min(max(x[MU], log(0.08)), log(1.4))
    return score * min(span / params.model_time, 1.0)  # an error that lasts counts once


@compiled
def _advance(state, params):
    """Take the mean of the samples of a window."""
    span, count = state.sum_span, state.sum_count
    steer, speed = state.sum_steer / count, state.sum_speed / count
    accel_x = state.sum_accel_x / count
    accel_y = state.sum_accel_y / state.sum_accels if state.sum_accels > 0.0 else np.nan
    rate = state.sum_rate / state.sum_rates if state.sum_rates > 0.0 else np.nan
    bank, filter = state.bank, state.filter
    mix(bank, -np.expm1(-params.change_rate * span), params.copied_share)
    for j in range(CLASSES + 1):
        take(bank, j, filter)
        used = accel_y if accel_y == accel_y else state.accel_y
        bank.score[j] = _predict(state, j, span, steer, speed, accel_x, used, params)
        bank.score[j] += _correct(state, j, span, steer, speed, accel_x, accel_y, rate, params)
        put(bank, j, filter)
    weigh(bank)


@compiled
def _gather(state, obs, params):
    """Add a sample to the window; take the window when it is long enough."""
    advance_speed(state.speed, obs, params, state.speed_y)
    fusion = state.speed
    accel_y = _unrolled(state, obs, params)
    if obs.yaw_rate == obs.yaw_rate:
        state.rate = obs.yaw_rate
    if state.started == 0.0:
        if obs.yaw_rate == obs.yaw_rate:
            state.started = 1.0
            for j in range(CLASSES + 1):
                state.bank.x[j, RATE] = obs.yaw_rate
        return
    if not obs.elapsed > 0.0:
        return
    state.sum_count += 1.0
    state.sum_span += min(obs.elapsed, 0.1)
    state.sum_steer += fusion.steer_angle
    state.sum_speed += max(fusion.filter.x[0], LOWEST_SPEED)
    state.sum_accel_x += fusion.accel_x
    if obs.accel_y == obs.accel_y:
        state.sum_accel_y += accel_y
        state.sum_accels += 1.0
    if obs.yaw_rate == obs.yaw_rate:
        state.sum_rate += obs.yaw_rate
        state.sum_rates += 1.0
    if state.sum_span >= params.window_time - 1e-9:
        _advance(state, params)
        state.sum_count, state.sum_span, state.sum_steer, state.sum_speed = 0.0, 0.0, 0.0, 0.0
        state.sum_accel_x, state.sum_accel_y, state.sum_accels = 0.0, 0.0, 0.0
        state.sum_rate, state.sum_rates = 0.0, 0.0


@compiled
def _step(state, obs, params, est):
    _gather(state, obs, params)
    bank = state.bank
    forward = max(state.speed.filter.x[0], LOWEST_SPEED)
    speed_y, variance = moments(bank, V_Y)
    state.speed_y = speed_y
    mean, square = 0.0, 0.0
    for j in range(CLASSES + 1):
        spread = bank.P[j, MU, MU]
        mu = exp(bank.x[j, MU] + 0.5 * spread)
        mean += bank.weight[j] * mu
        square += bank.weight[j] * mu * mu * exp(spread)
    est.sideslip = atan2(speed_y, forward)
    est.speed_x, est.speed_y = state.speed.filter.x[0], speed_y
    est.yaw_rate = moments(bank, RATE)[0]
    est.mu = mean
    square_speed = forward * forward + speed_y * speed_y
    est.sideslip_variance = variance * (forward / square_speed) ** 2
    est.speed_x_variance = (
        state.speed.filter.P[0, 0] + (params.radius_std * state.speed.filter.x[0]) ** 2
    )
    est.speed_y_variance = variance
    est.mu_variance = max(square - mean * mean, 1e-6)


class SideslipFrictionBank(CompiledMethod):
    """Kinematics and tyres under classes of friction, from production sensors."""

    name = "sideslip_friction_bank"
    title = "Sideslip and friction bank"
    reference = "gripbench, docs/estimator.md"
    sensors = (*SPEED_SENSORS, "accel_y")
    estimates = ("sideslip", "mu", "speed_x", "speed_y", "yaw_rate")
    variances = ("sideslip", "mu", "speed_x", "speed_y")
    vehicle_parameters = tuple(
        dict.fromkeys(
            (
                *SINGLE_TRACK_VEHICLE,
                *SPEED_VEHICLE,
                "cg_height",
                "roll_gradient",
                "roll_frequency",
                "roll_damping",
            )
        )
    )
    parameters = (
        *SPEED_PARAMETERS,
        Parameter("friction_mean", 0.45, "-", "Mean of the friction before the drive", 0.1, 1.2),
        Parameter("friction_spread", 0.35, "-", "Its standard deviation", 0.02, 2.0),
        Parameter("change_rate", 0.03, "1/s", "Rate at which the friction changes", 1e-4, 5.0),
        Parameter("copied_share", 0.0, "-", "Changes that bring their state along", 0.0, 1.0),
        Parameter("class_width", 0.4, "-", "Standard deviation of ln mu in a class", 0.05, 2.0),
        Parameter("class_time", 2.0, "s", "Time in which ln mu returns to its class", 0.05, 60.0),
        Parameter("window_time", 0.01, "s", "Samples of this time are taken as one", 1e-3, 0.1),
        Parameter("accel_y_noise", 0.02, "m/s^2/sqrt(Hz)", "Density of a_y's noise", 1e-4, 1.0),
        Parameter("roll_error", 0.02, "sqrt(s)", "Density of the roll's error over a_y", 0.0, 0.5),
        Parameter("gyro_noise", 5e-4, "rad/s/sqrt(Hz)", "Density of the gyro's noise", 1e-6, 0.1),
        Parameter("yaw_rate_walk", 0.03, "rad/s^2/sqrt(Hz)", "Noise of the yaw model", 1e-4, 5.0),
        Parameter(
            "brake_moment", 0.1, "1/m", "Yaw acceleration of uneven braking over a_x", 0.0, 2.0
        ),
        Parameter("model_floor", 0.1, "m/s^2", "Error of the tyre model at no force", 1e-3, 2.0),
        Parameter("model_error", 0.06, "-", "Error of the tyre model over the force", 0.0, 0.5),
        Parameter("model_time", 0.1, "s", "Correlation time of those errors", 1e-3, 2.0),
        Parameter("offset_y_std", 0.13, "m/s^2", "Bias and bank at the start", 1e-3, 2.0),
        Parameter("offset_y_walk", 0.03, "m/s^2/sqrt(s)", "Walk of bias and bank", 0.0, 1.0),
        Parameter(
            "bank_walk", 0.15, "m/s^2/sqrt(s)", "Walk of the bank while tyres grip", 0.0, 3.0
        ),
        Parameter("banking_share", 0.1, "-", "Prior of a bank that changes", 1e-6, 0.9),
        Parameter(
            "banking_walk", 0.8, "m/s^2/sqrt(s)", "Walk of the bank where it changes", 0.0, 5.0
        ),
        Parameter("stiffness_std", 0.12, "-", "Relative error of the stiffness", 1e-3, 0.5),
        Parameter("stiffness_walk", 0.003, "1/sqrt(s)", "Walk of the stiffness", 0.0, 0.2),
        Parameter("steer_offset_std", 2e-3, "rad", "Error of the steering angle's zero", 1e-5, 0.1),
        Parameter("usual_sideslip", 0.05, "rad sqrt(s)", "Sideslip that is usual", 0.01, 10.0),
        Parameter("usual_bank", 1.0, "m/s^2 sqrt(s)", "Share of g by a usual bank", 0.1, 10.0),
        Parameter("speed_y_std", 0.2, "m/s", "Lateral velocity at the start", 1e-3, 5.0),
    )
    state = _STATE
    start = staticmethod(_start)
    step = staticmethod(_step)
