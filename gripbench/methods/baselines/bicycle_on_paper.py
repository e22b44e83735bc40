"""Bicycle on paper: speed and yaw rate in, the steady-state sideslip of the linear model out.

In a steady turn the rear axle carries a m V r / L and its slip angle is that over C_r, so that

    beta = (b / V - a m V / (L C_r)) r

(Rajamani, Vehicle Dynamics and Control, 3.3). The yaw rate is measured, or follows from the
steering angle by r = V delta / (L + K V^2) with K = m (b C_r - a C_f) / (L C_f C_r) (variant
`steering`).
"""

from __future__ import annotations

import numpy as np

from gripbench.methods.contract import CompiledMethod, Parameter, Variant, compiled

_VEHICLE = ("mass", "cg_to_front", "cg_to_rear", "cornering_stiffness_rear")
_WHEELS = ("wheel_speed_rear_left", "wheel_speed_rear_right")


@compiled
def steady_sideslip(speed, yaw_rate, params):
    """Return the sideslip angle [rad] of a steady turn at a speed [m/s] and yaw rate [rad/s]."""
    wheelbase = params.cg_to_front + params.cg_to_rear
    load = params.cg_to_front * params.mass * speed / (wheelbase * params.cornering_stiffness_rear)
    return (params.cg_to_rear / speed - load) * yaw_rate


@compiled
def steady_yaw_rate(speed, steer, params):
    """Return the yaw rate [rad/s] of a steady turn at a speed [m/s] and steering angle [rad]."""
    a, b = params.cg_to_front, params.cg_to_rear
    front, rear = params.cornering_stiffness_front, params.cornering_stiffness_rear
    gradient = params.mass * (b * rear - a * front) / ((a + b) * front * rear)
    # beyond the critical speed of an oversteering vehicle there is no steady turn
    return speed * steer / max(a + b + gradient * speed * speed, 0.1 * (a + b))


@compiled
def _write(state, speed, yaw_rate, params, est):
    if speed == speed and yaw_rate == yaw_rate:  # what is missing stays as it was
        state.sideslip = 0.0
        if speed > params.lowest_speed:
            state.sideslip = steady_sideslip(speed, yaw_rate, params)
    est.sideslip = state.sideslip


@compiled
def _rolling(obs, params):
    return 0.5 * params.wheel_radius * (obs.wheel_speed_rear_left + obs.wheel_speed_rear_right)


@compiled
def _step(state, obs, params, est):
    _write(state, _rolling(obs, params), obs.yaw_rate, params, est)


@compiled
def _step_steering(state, obs, params, est):
    speed = _rolling(obs, params)
    _write(state, speed, steady_yaw_rate(speed, obs.steer_angle, params), params, est)


@compiled
def _step_measured(state, obs, params, est):
    _write(state, obs.speed_x, obs.yaw_rate, params, est)


@compiled
def _step_gps(state, obs, params, est):
    _write(state, obs.speed_gps, obs.yaw_rate, params, est)


class BicycleOnPaper(CompiledMethod):
    """Steady-state sideslip of the linear single-track model."""

    name = "bicycle_on_paper"
    title = "Bicycle on paper"
    reference = "Baseline; Rajamani, Vehicle Dynamics and Control, 3.3"
    baseline = True
    sensors = (*_WHEELS, "yaw_rate")
    estimates = ("sideslip",)
    vehicle_parameters = (*_VEHICLE, "wheel_radius")
    parameters = (
        Parameter("lowest_speed", 2.0, "m/s", "Speed below which the sideslip is 0", 0.1, 20.0),
    )
    variants = {
        "steering": Variant(
            sensors=(*_WHEELS, "steer_angle"),
            step=_step_steering,
            vehicle_parameters=(*_VEHICLE, "wheel_radius", "cornering_stiffness_front"),
        ),
        "measured_speed": Variant(
            sensors=("speed_x", "yaw_rate"), step=_step_measured, vehicle_parameters=_VEHICLE
        ),
        "gps_speed": Variant(
            sensors=("speed_gps", "yaw_rate"), step=_step_gps, vehicle_parameters=_VEHICLE
        ),
    }
    state = np.dtype([("sideslip", np.float64)])
    step = staticmethod(_step)
