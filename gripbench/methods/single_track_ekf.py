"""Extended Kalman filter on the single-track model with brush tyres and a friction that is assumed.

As the single-track Kalman filter, with axle forces that saturate at `friction` times the load, so
that a slide is followed where the road is the one that is assumed. Ray (1995), Nonlinear state and
tire force estimation for advanced vehicle control, IEEE Transactions on Control Systems Technology
3, and Best, Gordon & Dixon (2000), Vehicle System Dynamics 34; tyres: Pacejka, Tyre and Vehicle
Dynamics, 3.2.

Of its variance: friction and stiffness are taken for known. Where the road is another one the
error of the tyre forces lasts for the whole slide; the noise that stands for it is white.
"""

from __future__ import annotations

from gripbench.methods.blocks.single_track_ekf import correct_track, predict_track
from gripbench.methods.blocks.single_track_filter import (
    FUSED_PARAMETERS,
    LATERAL_INNOVATIONS,
    SingleTrackFilter,
    read_inputs,
    start_lateral,
    track_state,
    write_innovations,
    write_lateral,
    write_no_innovations,
)
from gripbench.methods.contract import Parameter, compiled


@compiled
def _step(state, obs, params, est):
    read_inputs(state.inputs, obs, params)
    filter, inputs = state.filter, state.inputs
    span = obs.elapsed
    write_no_innovations(est)
    if obs.first:
        start_lateral(filter, obs, params)
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


class SingleTrackEkf(SingleTrackFilter):
    """Single-track model with tyres that saturate at an assumed friction."""

    name = "single_track_ekf"
    title = "Single-track EKF"
    reference = "Ray (1995); Best, Gordon & Dixon (2000)"
    innovations = LATERAL_INNOVATIONS
    parameters = (
        *FUSED_PARAMETERS,
        Parameter("friction", 0.8, "-", "Friction coefficient that is assumed", 0.05, 1.5),
    )
    state = track_state(2)
    step = staticmethod(_step)
