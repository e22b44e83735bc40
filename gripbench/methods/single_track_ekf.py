"""Extended Kalman filter on the single-track model with brush tyres and a friction that is assumed.

As the single-track Kalman filter, with axle forces that saturate at `friction` times the load, so
that a slide is followed where the road is the one that is assumed. Ray (1995), Nonlinear state and
tire force estimation for advanced vehicle control, IEEE Transactions on Control Systems Technology
3, and Best, Gordon & Dixon (2000), Vehicle System Dynamics 34; tyres: Pacejka, Tyre and Vehicle
Dynamics, 3.2.
"""

from __future__ import annotations

import numpy as np

from gripbench.methods.blocks.kalman import filter_type
from gripbench.methods.blocks.single_track import SINGLE_TRACK_VEHICLE
from gripbench.methods.blocks.single_track_ekf import correct_track, predict_track
from gripbench.methods.blocks.single_track_filter import (
    FUSED_PARAMETERS,
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
    write_innovations,
    write_lateral,
    write_no_innovations,
)
from gripbench.methods.contract import CompiledMethod, Parameter, Variant, compiled

_STATE = np.dtype(
    [("inputs", INPUT_STATE), ("filter", filter_type(2)), ("motion", np.float64, (2, 7))]
)


@compiled
def _advance(state, obs, params, est):
    filter, inputs = state.filter, state.inputs
    span = obs.elapsed
    write_no_innovations(est)
    if obs.first:
        filter.P[0, 0], filter.P[1, 1] = params.speed_y_std**2, 1.0
        filter.x[1] = obs.yaw_rate
    elif span > 0.0:
        predict_track(
            filter, span, inputs.speed, inputs.steer, params.friction, params, state.motion
        )
        rate, accel = correct_track(
            filter, span, inputs.speed, inputs.steer, params.friction, obs.yaw_rate, obs.accel_y,
            params, state.motion,
        )  # fmt: skip
        write_innovations(rate, accel, est)
    write_lateral(inputs, filter.x[0], filter.x[1], filter.P[0, 0], est)


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


class SingleTrackEkf(CompiledMethod):
    """Single-track model with tyres that saturate at an assumed friction."""

    name = "single_track_ekf"
    title = "Single-track EKF"
    reference = "Ray (1995); Best, Gordon & Dixon (2000)"
    sensors = FUSED_SENSORS
    estimates = LATERAL_ESTIMATES
    variances = LATERAL_VARIANCES
    innovations = LATERAL_INNOVATIONS
    vehicle_parameters = FUSED_VEHICLE
    parameters = (
        *FUSED_PARAMETERS,
        Parameter("friction", 0.8, "-", "Friction coefficient that is assumed", 0.05, 1.5),
    )
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
