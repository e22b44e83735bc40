"""Slip-slope Kalman filter with change detection: Gustafsson (1997).

F. Gustafsson, Slip-based tire-road friction estimation, Automatica 33 (1997), 1087-1099, eq. 8-12
(regression, Kalman filter) and section 4 (cumulated sums). The slip of the driven wheels over the
free-rolling ones is linear in the normalised traction force,

    s = w_d / w_n - 1 = mu_n / k + delta,   mu_n = F_d / N_d,

with the slip slope k and the offset delta, which is the relative difference of the effective
radii: a radius that is off by some per mille moves delta and not k, as in the rolling phases both
are separate. The Kalman filter of the state (1/k, delta), which walks, is linear because the noisy
slip stands alone on the left. Cumulated sums of its innovations open the variance of 1/k after a
change of the road.

Departures: any share of the torque between the axles, with mu_n that of the front axle less that of
the rear one; the axle forces come from the torque and the wheels' balance; samples of a window are
taken as one; windows with more slip than `largest_slip`, where the relation is no line, are left
out. The paper maps k to classes of roads by experience; here mu = k / (B C), the slope of the tyre
on paper (eq. 15 of Li, Du & Li 2014 without its offset), and `map_error` says how good that is.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from gripbench.methods.blocks.axle_friction import (
    AXLE_LOAD_PARAMETERS,
    front_load,
    rear_load,
)
from gripbench.methods.blocks.change_detection import (
    CHANGE_PARAMETERS,
    CHANGE_STATE,
    has_changed,
)
from gripbench.methods.blocks.kalman import correct_scalar, filter_type, predict_covariance
from gripbench.methods.contract import CompiledMethod, Parameter, compiled

FLEX, OFFSET = 0, 1  # B C / k, which is 1/mu, and delta

_SUMS = ("span", "count", "wheel_front", "wheel_rear", "torque_front", "torque_rear")
_STATE = np.dtype(
    [("filter", filter_type(2)), ("change", CHANGE_STATE)]
    + [(name, np.float64) for name in _SUMS]
    + [(name, np.float64) for name in ("end_front", "end_rear")]
)


@compiled
def _first_variance(params):
    return (params.friction_spread / params.friction_mean**2) ** 2


@compiled
def _start(state, params):
    filter = state.filter
    ratio = params.friction_spread / params.friction_mean
    filter.x[FLEX] = (1.0 + ratio * ratio) / params.friction_mean
    filter.P[FLEX, FLEX] = _first_variance(params)
    filter.P[OFFSET, OFFSET] = params.offset_std**2
    filter.F[0, 0] = filter.F[1, 1] = filter.h[OFFSET] = 1.0


@compiled
def _window(state, turn_front, turn_rear, params):
    """Take the means of a window; `turn_front` and `turn_rear` are its wheel accelerations."""
    filter, span, count = state.filter, state.span, state.count
    x, P, Q, h = filter.x, filter.P, filter.Q, filter.h
    front, rear = state.wheel_front / count, state.wheel_rear / count
    Q[FLEX, FLEX] = params.flex_walk**2 * span
    Q[OFFSET, OFFSET] = params.offset_walk**2 * span
    predict_covariance(filter)
    P[FLEX, FLEX] = min(P[FLEX, FLEX], 1.5 * _first_variance(params))
    if params.wheel_radius * min(front, rear) < params.lowest_speed:
        return
    slip = front / rear - 1.0
    if abs(slip) > params.largest_slip:
        return
    force_front = state.torque_front / count - params.wheel_inertia * turn_front
    force_rear = state.torque_rear / count - params.wheel_inertia * turn_rear
    used = force_front / front_load(params) - force_rear / rear_load(params)
    used /= params.wheel_radius
    h[FLEX] = used / (params.magic_b * params.magic_c)
    residual = slip - h[FLEX] * x[FLEX] - x[OFFSET]
    variance = params.slip_noise**2 / span + params.slip_error**2 * params.slip_time / span
    spread = variance + h[FLEX] ** 2 * P[FLEX, FLEX]
    spread += 2.0 * h[FLEX] * P[FLEX, OFFSET] + P[OFFSET, OFFSET]
    correct_scalar(filter, residual, variance)
    if abs(used) > params.least_share:
        along = 1.0 if used > 0.0 else -1.0
        if has_changed(state.change, along * residual / sqrt(spread), params):
            P[FLEX, FLEX] += _first_variance(params)
    x[FLEX] = min(max(x[FLEX], 0.7), 15.0)


@compiled
def _step(state, obs, params, est):
    if obs.first:
        state.end_front, state.end_rear = obs.wheel_speed_front, obs.wheel_speed_rear
    elif obs.elapsed > 0.0:
        state.span += obs.elapsed
        state.count += 1.0
        state.wheel_front += obs.wheel_speed_front
        state.wheel_rear += obs.wheel_speed_rear
        state.torque_front += obs.torque_front
        state.torque_rear += obs.torque_rear
        if state.span >= params.window_time - 1e-9:
            _window(
                state,
                (obs.wheel_speed_front - state.end_front) / state.span,
                (obs.wheel_speed_rear - state.end_rear) / state.span,
                params,
            )
            state.end_front, state.end_rear = obs.wheel_speed_front, obs.wheel_speed_rear
            state.span = state.count = state.wheel_front = state.wheel_rear = 0.0
            state.torque_front = state.torque_rear = 0.0
    flex, variance = state.filter.x[FLEX], state.filter.P[FLEX, FLEX]
    ratio = min(variance / flex**2, 0.25)
    mu = (1.0 + ratio) / flex
    est.mu_front = est.mu_rear = mu
    est.mu_front_variance = est.mu_rear_variance = mu * mu * (ratio + params.map_error**2)


class SlipSlopeKalmanFilter(CompiledMethod):
    """Slip slope and radius offset by a Kalman filter that opens where the road changes."""

    name = "slip_slope_kalman_filter"
    title = "Slip-slope Kalman filter"
    reference = "Gustafsson (1997), Automatica 33"
    sensors = ("wheel_speed_front", "wheel_speed_rear", "torque_front", "torque_rear")
    estimates = ("mu_front", "mu_rear")
    variances = ("mu_front", "mu_rear")
    vehicle_parameters = (
        *AXLE_LOAD_PARAMETERS,
        "magic_b",
        "magic_c",
        "wheel_radius",
        "wheel_inertia",
    )
    parameters = (
        Parameter("friction_mean", 0.75, "-", "Mean of the friction before the drive", 0.1, 1.2),
        Parameter("friction_spread", 0.25, "-", "Its standard deviation", 0.02, 1.0),
        Parameter("flex_walk", 0.02, "1/sqrt(s)", "Walk of 1/mu", 0.0, 1.0),
        Parameter("offset_std", 0.006, "-", "Relative difference of the radii", 1e-5, 0.05),
        Parameter("offset_walk", 1e-4, "1/sqrt(s)", "Walk of that difference", 0.0, 0.01),
        Parameter("window_time", 0.05, "s", "Samples of this time are taken as one", 2e-3, 1.0),
        Parameter("slip_noise", 1e-4, "sqrt(s)", "Density of the slip's noise", 1e-7, 0.1),
        Parameter("slip_error", 3e-4, "-", "Lasting error of the line", 0.0, 0.01),
        Parameter("slip_time", 1.0, "s", "Correlation time of that error", 1e-2, 10.0),
        Parameter("largest_slip", 0.015, "-", "Slip beyond which there is no line", 1e-3, 0.3),
        Parameter("lowest_speed", 1.0, "m/s", "Speed below which no slip is taken", 0.05, 10.0),
        Parameter("least_share", 0.02, "-", "Normalised force that tells of k", 0.0, 0.5),
        *CHANGE_PARAMETERS,
        Parameter("map_error", 0.15, "-", "Relative error of the map from k to mu", 0.0, 1.0),
    )
    state = _STATE
    start = staticmethod(_start)
    step = staticmethod(_step)
