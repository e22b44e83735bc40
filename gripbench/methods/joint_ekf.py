"""Joint extended Kalman filter: states, cornering stiffness and friction in one filter.

Wenzel, Burnham, Blundell & Williams (2006), Dual extended Kalman filter for vehicle state and
parameter estimation, Vehicle System Dynamics 44, which compares the dual form (`dual_ekf`) with
this; the parameters here are the logarithms of the stiffness of each axle over that on paper and of
the friction, all random walks.

Of its variance: a bank of the road and offsets of the sensors are no states, and last; linearised
at one friction, it does not see that a road of less would explain the same readings.
"""

from __future__ import annotations

from gripbench.compilation import compiled
from gripbench.methods.blocks.single_track_ekf import correct_track, predict_track
from gripbench.methods.blocks.single_track_filter import (
    ADAPTIVE_PARAMETERS,
    LATERAL_ESTIMATES,
    LATERAL_INNOVATIONS,
    LATERAL_VARIANCES,
    SingleTrackFilter,
    read_inputs,
    start_adaptive,
    start_lateral,
    track_state,
    write_friction,
    write_innovations,
    write_lateral,
    write_no_innovations,
)


@compiled
def _step(state, obs, params, est):
    read_inputs(state.inputs, obs, params)
    filter, inputs = state.filter, state.inputs
    x, P, Q = filter.x, filter.P, filter.Q
    span = obs.elapsed
    write_no_innovations(est)
    if obs.first:
        start_lateral(filter, obs, params)
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


class JointEkf(SingleTrackFilter):
    """Lateral velocity, yaw rate, both stiffnesses and the friction in one EKF."""

    name = "joint_ekf"
    title = "Joint EKF"
    reference = "Wenzel, Burnham, Blundell & Williams (2006)"
    estimates = (*LATERAL_ESTIMATES, "mu")
    variances = (*LATERAL_VARIANCES, "mu")
    innovations = LATERAL_INNOVATIONS
    parameters = ADAPTIVE_PARAMETERS
    state = track_state(5)
    step = staticmethod(_step)
