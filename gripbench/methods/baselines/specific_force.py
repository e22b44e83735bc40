"""Specific force held: the accelerometer in, |a|/g out, smoothed, as the friction that is used.

No road gives less friction than what a tyre has drawn from it, so the largest |a|/g so far is held
as the friction that is available.
"""

from __future__ import annotations

from math import expm1, hypot

import numpy as np

from gripbench.envs.vehicles import GRAVITY
from gripbench.methods.contract import CompiledMethod, Parameter, Variant, compiled


@compiled
def _advance(state, accel_x, accel_y, obs, params, est):
    share = -expm1(-obs.elapsed / params.smoothing_time)
    if accel_x == accel_x:  # a missing sample changes nothing
        state.accel_x += share * (accel_x - state.accel_x)
    if accel_y == accel_y:
        state.accel_y += share * (accel_y - state.accel_y)
    used = hypot(state.accel_x, state.accel_y) / GRAVITY
    state.largest = max(state.largest, used)
    est.mu_used = used
    est.mu, est.mu_front, est.mu_rear = state.largest, state.largest, state.largest


@compiled
def _step(state, obs, params, est):
    _advance(state, obs.accel_x, obs.accel_y, obs, params, est)


@compiled
def _step_longitudinal(state, obs, params, est):
    _advance(state, obs.accel_x, 0.0, obs, params, est)


@compiled
def _step_lateral(state, obs, params, est):
    _advance(state, 0.0, obs.accel_y, obs, params, est)


class SpecificForce(CompiledMethod):
    """Largest specific force so far as the friction; `longitudinal` and `lateral` see one axis."""

    name = "specific_force"
    title = "|a|/g held"
    reference = "Baseline"
    baseline = True
    sensors = ("accel_x", "accel_y")
    estimates = ("mu", "mu_front", "mu_rear", "mu_used")
    parameters = (
        Parameter("smoothing_time", 0.3, "s", "Time constant of the smoothing", 0.01, 10.0),
    )
    variants = {
        "longitudinal": Variant(sensors=("accel_x",), step=_step_longitudinal),
        "lateral": Variant(sensors=("accel_y",), step=_step_lateral),
    }
    state = np.dtype([(name, np.float64) for name in ("accel_x", "accel_y", "largest")])
    step = staticmethod(_step)
