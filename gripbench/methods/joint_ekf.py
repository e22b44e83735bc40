"""Joint extended Kalman filter: states, cornering stiffness and friction in one filter.

Wenzel, Burnham, Blundell & Williams (2006), Dual extended Kalman filter for vehicle state and
parameter estimation, Vehicle System Dynamics 44, which compares the dual form (`dual_ekf`) with
this; the parameters here are the logarithms of the stiffness of each axle over that on paper and of
the friction, all random walks.
"""

from __future__ import annotations

import numpy as np

from gripbench.methods.blocks.kalman import filter_type
from gripbench.methods.blocks.single_track import SINGLE_TRACK_VEHICLE
from gripbench.methods.blocks.single_track_ekf import correct_track, predict_track
from gripbench.methods.blocks.single_track_filter import (
    ADAPTIVE_PARAMETERS,
    FUSED_SENSORS,
    FUSED_VEHICLE,
    GPS_SENSORS,
    INPUT_STATE,
    LATERAL_ESTIMATES,
    LATERAL_INNOVATIONS,
    LATERAL_VARIANCES,
    MEASURED_SENSORS,
    read_fused,
    read_gps,
    read_measured,
    start_adaptive,
    write_friction,
    write_innovations,
    write_lateral,
    write_no_innovations,
)
from gripbench.methods.contract import CompiledMethod, Variant, compiled

_STATE = np.dtype(
    [("inputs", INPUT_STATE), ("filter", filter_type(5)), ("motion", np.float64, (2, 7))]
)


@compiled
def _advance(state, obs, params, est):
    filter, inputs = state.filter, state.inputs
    x, P, Q = filter.x, filter.P, filter.Q
    span = obs.elapsed
    write_no_innovations(est)
    if obs.first:
        P[0, 0], P[1, 1], x[1] = params.speed_y_std**2, 1.0, obs.yaw_rate
        start_adaptive(x, P, 2, params)
    elif span > 0.0:
        Q[2, 2] = Q[3, 3] = params.stiffness_walk**2 * span
        Q[4, 4] = params.friction_walk**2 * span
        predict_track(filter, span, inputs.speed, inputs.steer, 0.0, params, state.motion)
        rate, accel = correct_track(
            filter, span, inputs.speed, inputs.steer, 0.0, obs.yaw_rate, obs.accel_y, params,
            state.motion,
        )  # fmt: skip
        write_innovations(rate, accel, est)
    write_lateral(inputs, x[0], x[1], P[0, 0], est)
    write_friction(x[4], P[4, 4], est)


@compiled
def _step(state, obs, params, est):
    read_fused(state.inputs, obs, params)
    _advance(state, obs, params, est)


@compiled
def _step_measured(state, obs, params, est):
    read_measured(state.inputs, obs, params)
    _advance(state, obs, params, est)


@compiled
def _step_gps(state, obs, params, est):
    read_gps(state.inputs, obs, params)
    _advance(state, obs, params, est)


class JointEkf(CompiledMethod):
    """Lateral velocity, yaw rate, both stiffnesses and the friction in one EKF."""

    name = "joint_ekf"
    title = "Joint EKF"
    reference = "Wenzel, Burnham, Blundell & Williams (2006)"
    sensors = FUSED_SENSORS
    estimates = (*LATERAL_ESTIMATES, "mu")
    variances = (*LATERAL_VARIANCES, "mu")
    innovations = LATERAL_INNOVATIONS
    vehicle_parameters = FUSED_VEHICLE
    parameters = ADAPTIVE_PARAMETERS
    variants = {
        "measured_speed": Variant(
            sensors=MEASURED_SENSORS, step=_step_measured, vehicle_parameters=SINGLE_TRACK_VEHICLE
        ),
        "gps_speed": Variant(
            sensors=GPS_SENSORS, step=_step_gps, vehicle_parameters=SINGLE_TRACK_VEHICLE
        ),
    }
    state = _STATE
    step = staticmethod(_step)
