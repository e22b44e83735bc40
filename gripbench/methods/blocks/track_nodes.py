"""Samples in, nodes of a smoother on the single-track model out: one for each window of time.

A node holds the state at the end of a window: v_y, r, ln C_f and ln C_r over the values on paper,
ln mu. Between two nodes stand the steering angles at both, the mean speed, and the means of yaw
rate and a_y, which are compared with the means of both ends.
"""

from __future__ import annotations

import numpy as np

from gripbench.compilation import compiled
from gripbench.methods.blocks.single_track_ekf import evaluate_track
from gripbench.methods.blocks.single_track_filter import INPUT_STATE, read_inputs

STATES = 5

NODE_STATE = np.dtype(
    [
        ("inputs", INPUT_STATE),
        ("x", np.float64, (STATES,)),  # at the present sample
        ("motion", np.float64, (2, 7)),
        ("variance", np.float64, (2,)),  # of v_y and ln mu
    ]
    + [(name, np.float64) for name in ("span", "count", "steer", "speed", "yaw_rate", "accel_y")]
)
"""What a method keeps for its nodes; the sums are those of the window so far."""

WINDOW = ("span", "speed", "steer_before", "steer", "yaw_rate", "accel_y")
"""What stands between two nodes: duration [s], mean speed [m/s], steering angles at both ends
[rad], mean yaw rate [rad/s] and mean a_y [m/s^2]."""


@compiled
def gather(states, observations, params):
    """Take a sample, and what the model makes of the last node; return whether a window is full.

    All records have shape (1,).
    """
    state, obs = states[0], observations[0]
    inputs, x, out = state.inputs, state.x, state.motion
    read_inputs(inputs, obs, params[0])
    if obs.first:
        state.steer = inputs.steer
        return False
    span = obs.elapsed
    evaluate_track(x, inputs.speed, inputs.steer, 0.0, params[0], out)
    x[0] += span * (out[0, 0] - inputs.speed * x[1])
    x[1] += span * out[1, 0]
    inputs.speed_y = x[0]
    state.span += span
    state.count += 1.0
    state.speed += inputs.speed
    state.yaw_rate += obs.yaw_rate
    state.accel_y += obs.accel_y
    return state.span >= params[0].window_time - 1e-9


@compiled
def take_window(states, window):
    """Fill `window`, shape (6,), with `WINDOW`, and begin the next one."""
    state = states[0]
    count = state.count
    window[0], window[1] = state.span, state.speed / count
    window[2], window[3] = state.steer, state.inputs.steer
    window[4], window[5] = state.yaw_rate / count, state.accel_y / count
    state.steer = state.inputs.steer
    state.span = state.count = state.speed = state.yaw_rate = state.accel_y = 0.0


@compiled
def _rate(x, speed, steer, params, out, rate):
    evaluate_track(x, speed, steer, 0.0, params, out)
    rate[0] = out[0, 0] - speed * x[1]
    rate[1] = out[1, 0]
    return out[0, 0]


@compiled
def between(before, after, window, params, residual):
    """Fill `residual` (7) with what two nodes leave open, over its standard deviations.

    Parameters
    ----------
    before, after
        States of the nodes, shape (5,).
    window
        As `take_window` fills it.
    params
        Record (1,) with the noise levels of the single-track filters and the car on paper.
    residual
        Motion (2, by one Runge-Kutta step), walks of the parameters (3), yaw rate, a_y.
    """
    par = params[0]
    span, speed, first, last = window[0], window[1], window[2], window[3]
    middle = 0.5 * (first + last)
    out = np.empty((2, 7))
    x, a, b, c, d = before.copy(), np.empty(2), np.empty(2), np.empty(2), np.empty(2)
    force = _rate(x, speed, first, par, out, a)
    x[:2] = before[:2] + 0.5 * span * a
    _rate(x, speed, middle, par, out, b)
    x[:2] = before[:2] + 0.5 * span * b
    _rate(x, speed, middle, par, out, c)
    x[:2] = before[:2] + span * c
    _rate(x, speed, last, par, out, d)
    root = np.sqrt(span)
    for i in range(2):
        moved = before[i] + span / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i])
        residual[i] = (after[i] - moved) / root
    residual[0] /= par.speed_y_walk
    residual[1] /= par.yaw_rate_walk
    for i in range(2, STATES):
        walk = par.stiffness_walk if i < 4 else par.friction_walk
        residual[i] = (after[i] - before[i]) / (root * max(walk, 1e-6))
    force = 0.5 * (force + _rate(after, speed, last, par, out, d))
    residual[5] = root * (window[4] - 0.5 * (before[1] + after[1])) / par.gyro_noise
    residual[6] = root * (window[5] - force) / par.accel_y_noise


@compiled
def between_slopes(before, after, window, params, residual, slopes):
    """Fill `residual` (7) as `between`, and `slopes` (7, 10) to both nodes by differences."""
    between(before, after, window, params, residual)
    high, low = np.empty(7), np.empty(7)
    ends = np.concatenate((before, after))
    for k in range(2 * STATES):
        step = 1e-5
        kept = ends[k]
        ends[k] = kept + step
        between(ends[:STATES], ends[STATES:], window, params, high)
        ends[k] = kept - step
        between(ends[:STATES], ends[STATES:], window, params, low)
        ends[k] = kept
        for i in range(7):
            slopes[i, k] = (high[i] - low[i]) / (2.0 * step)
