"""Kinematic integration: yaw rate, lateral acceleration and a speed in, lateral velocity out.

d v_y/dt = a_y - r v_x, with a forgetting of one second, without which every bias grows for ever.
The speed is the mean of the rear wheels', or one that is measured (variants).
"""

from __future__ import annotations

from math import atan2, exp

import numpy as np

from gripbench.methods.contract import CompiledMethod, Parameter, Variant, compiled

_NAMES = ("speed", "rate", "speed_y")


@compiled
def _advance(state, speed, obs, params, est):
    kept = exp(-obs.elapsed / params.forgetting_time)
    state.speed_y = kept * state.speed_y + (1.0 - kept) * params.forgetting_time * state.rate
    if speed == speed:  # what is missing stays as it was
        state.speed = speed
    rate = obs.accel_y - obs.yaw_rate * state.speed
    if rate == rate:
        state.rate = rate
    est.speed_x, est.speed_y = state.speed, state.speed_y
    est.sideslip = atan2(state.speed_y, max(state.speed, params.lowest_speed))


@compiled
def _step(state, obs, params, est):
    rolling = 0.5 * (obs.wheel_speed_rear_left + obs.wheel_speed_rear_right)
    _advance(state, params.wheel_radius * rolling, obs, params, est)


@compiled
def _step_measured(state, obs, params, est):
    _advance(state, obs.speed_x, obs, params, est)


@compiled
def _step_gps(state, obs, params, est):
    _advance(state, obs.speed_gps, obs, params, est)


class KinematicIntegration(CompiledMethod):
    """Lateral velocity by integration; `measured_speed` and `gps_speed` need no wheel speeds."""

    name = "kinematic_integration"
    title = "Kinematic integration"
    reference = "Baseline; d v_y/dt = a_y - r v_x"
    baseline = True
    sensors = ("wheel_speed_rear_left", "wheel_speed_rear_right", "yaw_rate", "accel_y")
    estimates = ("sideslip", "speed_x", "speed_y")
    vehicle_parameters = ("wheel_radius",)
    parameters = (
        Parameter("forgetting_time", 1.0, "s", "Time constant of the forgetting", 0.05, 100.0),
        Parameter("lowest_speed", 0.1, "m/s", "Least speed in the angle", 0.01, 10.0),
    )
    variants = {
        "measured_speed": Variant(
            sensors=("speed_x", "yaw_rate", "accel_y"), step=_step_measured, vehicle_parameters=()
        ),
        "gps_speed": Variant(
            sensors=("speed_gps", "yaw_rate", "accel_y"), step=_step_gps, vehicle_parameters=()
        ),
    }
    state = np.dtype([(name, np.float64) for name in _NAMES])
    step = staticmethod(_step)
