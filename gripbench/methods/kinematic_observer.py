"""Kinematic observer with pseudo-measurements of low sideslip: integration that a model calms.

The form that production cars are known to run: d v_y/dt = a_y - offset - r v is integrated, and as
long as yaw rate, lateral acceleration and steering angle agree with the linear model, v_y is held
near its steady value by a pseudo-measurement; in a slide they do not, and integration runs alone.
Farrelly & Wellstead (1996), Estimation of vehicle lateral velocity, IEEE Conf. Control
Applications; Ungoren, Peng & Tseng (2004), A study on lateral speed estimation methods,
International Journal of Vehicle Autonomous Systems 2, whose switch on the deviation from the model
is made smooth: the variance of the pseudo-measurement grows with the square of the deviation.

Of its variance: the model's sideslip is wrong by the bank, the stiffness and the offset for a
whole bend, and is taken as a measurement with white noise, sample by sample.
"""

from __future__ import annotations

import numpy as np

from gripbench.methods.baselines.bicycle_on_paper import steady_sideslip, steady_yaw_rate
from gripbench.methods.blocks.kalman import correct_scalar, filter_type, predict_covariance
from gripbench.methods.blocks.single_track import SINGLE_TRACK_VEHICLE
from gripbench.methods.blocks.single_track_filter import (
    FUSED_PARAMETERS,
    FUSED_VEHICLE,
    INPUT_STATE,
    SingleTrackFilter,
    read_inputs,
    speed_sources,
    write_lateral,
)
from gripbench.methods.contract import Parameter, compiled

# the steady turn of the model knows no moment of inertia
_VEHICLE = tuple(name for name in SINGLE_TRACK_VEHICLE if name != "yaw_inertia")
_FUSED_VEHICLE = tuple(name for name in FUSED_VEHICLE if name != "yaw_inertia")

_STATE = np.dtype([("inputs", INPUT_STATE), ("filter", filter_type(2)), ("deviation", np.float64)])


@compiled
def _step(state, obs, params, est):
    read_inputs(state.inputs, obs, params)
    filter, inputs = state.filter, state.inputs
    x, P, h = filter.x, filter.P, filter.h
    span, speed, rate = obs.elapsed, inputs.speed, obs.yaw_rate
    if obs.first:
        P[0, 0], P[1, 1] = params.speed_y_std**2, params.offset_std**2
        filter.F[0, 0] = filter.F[1, 1] = 1.0
        h[0] = 1.0
    elif span > 0.0:
        filter.F[0, 1] = -span
        filter.Q[0, 0] = params.accel_y_noise**2 * span
        filter.Q[1, 1] = params.offset_walk**2 * span
        x[0] += span * (obs.accel_y - x[1] - rate * speed)
        predict_covariance(filter)
        away = abs(rate - steady_yaw_rate(speed, inputs.steer, params)) * speed
        away = max(away, abs(obs.accel_y - x[1] - rate * speed))
        share = -np.expm1(-span / params.switch_time)
        state.deviation += share * (away - state.deviation)
        if away > state.deviation:  # a slide is seen at once, its end after a while
            state.deviation = away
        doubt = 1.0 + (state.deviation / params.switch_accel) ** 4
        density = params.pseudo_noise * speed * doubt
        correct_scalar(filter, speed * steady_sideslip(speed, rate, params) - x[0],
                       density * density / span)  # fmt: skip
    write_lateral(inputs, x[0], rate, P[0, 0], est)


class KinematicObserver(SingleTrackFilter):
    """Integrated lateral velocity, held near the model's where the model holds."""

    name = "kinematic_observer"
    title = "Kinematic observer, switched"
    reference = "Farrelly & Wellstead (1996); Ungoren, Peng & Tseng (2004)"
    vehicle_parameters = _FUSED_VEHICLE
    variants = speed_sources(_VEHICLE)
    parameters = (
        *FUSED_PARAMETERS,
        Parameter("pseudo_noise", 0.005, "rad sqrt(s)", "Density of the model's error", 1e-5, 1.0),
        Parameter("switch_accel", 1.0, "m/s^2", "Deviation at which the model fails", 0.05, 10.0),
        Parameter(
            "switch_time", 0.5, "s", "Time after which the model is trusted again", 0.01, 5.0
        ),
    )
    state = _STATE
    step = staticmethod(_step)
