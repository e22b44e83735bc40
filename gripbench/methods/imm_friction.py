"""Interacting multiple models over classes of friction: ice, snow, wet and dry road.

Each class has the single-track filter with brush tyres of its friction; the classes are Markovian
and weigh by the likelihood of yaw rate and a_y (Blom & Bar-Shalom 1988; of friction in the form of
Tsunashima, Murakami & Miyata (2006), Vehicle and road state estimation using interacting multiple
model approach, Vehicle System Dynamics 44).

Of its variance: the spread between the classes is in it, a bank of the road and offsets of the
sensors are not, and errors of the tyre model that last are counted as new evidence in every
sample.
"""

from __future__ import annotations

import numpy as np

from gripbench.methods.blocks.hypotheses import (
    bank_type,
    mix,
    moments,
    put,
    score_of,
    take,
    weigh,
)
from gripbench.methods.blocks.single_track_ekf import correct_track, predict_track
from gripbench.methods.blocks.single_track_filter import (
    FUSED_PARAMETERS,
    LATERAL_ESTIMATES,
    LATERAL_VARIANCES,
    SingleTrackFilter,
    read_inputs,
    track_state,
    write_lateral,
)
from gripbench.methods.contract import Parameter, compiled

FRICTION = (0.15, 0.3, 0.55, 0.9)
"""Friction of ice, snow, wet and dry road."""

_K = len(FRICTION)


@compiled
def _step(state, obs, params, est):
    read_inputs(state.inputs, obs, params)
    filter, inputs, bank = state.filter, state.inputs, state.bank
    span = obs.elapsed
    if obs.first:
        for j in range(_K):
            bank.prior[j] = bank.weight[j] = 1.0 / _K
            bank.x[j, 1] = obs.yaw_rate
            bank.P[j, 0, 0], bank.P[j, 1, 1] = params.speed_y_std**2, 1.0
    elif span > 0.0:
        mix(bank, -np.expm1(-params.change_rate * span), 1.0)
        for j in range(_K):
            take(bank, j, filter)
            predict_track(
                filter, span, inputs.speed, inputs.steer, FRICTION[j], params, state.motion
            )
            rate, accel = correct_track(
                filter, span, inputs.speed, inputs.steer, FRICTION[j], obs.yaw_rate, obs.accel_y,
                params, state.motion,
            )  # fmt: skip
            bank.score[j] = score_of(rate[0], rate[1]) + score_of(accel[0], accel[1])
            put(bank, j, filter)
        weigh(bank)
    speed_y, variance = moments(bank, 0)
    write_lateral(inputs, speed_y, moments(bank, 1)[0], variance, est)
    mean, square = 0.0, 0.0
    for j in range(_K):
        mean += bank.weight[j] * FRICTION[j]
        square += bank.weight[j] * FRICTION[j] ** 2
    est.mu = mean
    est.mu_variance = square - mean * mean + params.class_error**2


class ImmFriction(SingleTrackFilter):
    """Single-track filters on ice, snow, wet and dry road, weighed."""

    name = "imm_friction"
    title = "IMM over friction classes"
    reference = "Blom & Bar-Shalom (1988); Tsunashima, Murakami & Miyata (2006)"
    estimates = (*LATERAL_ESTIMATES, "mu")
    variances = (*LATERAL_VARIANCES, "mu")
    parameters = (
        *FUSED_PARAMETERS,
        Parameter("change_rate", 0.1, "1/s", "Rate at which the friction changes", 1e-4, 10.0),
        Parameter("class_error", 0.1, "-", "Error of a class's friction", 1e-3, 1.0),
    )
    state = track_state(2, ("bank", bank_type(_K, 2)))
    step = staticmethod(_step)
