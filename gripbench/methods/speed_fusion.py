"""Speed fusion: production sensors in, longitudinal and lateral velocity out.

The longitudinal speed is that of `gripbench.methods.blocks.speed_fusion`, which other methods
compose with; beside it stands the lateral velocity of a steady turn on the paper's rear axle
(Rajamani, Vehicle Dynamics and Control, 3.3), filtered with the time constant that the linear model
has at that speed, 1/(C_f + C_r) m v.

Of its variance: see `blocks/speed_fusion.py`; the radius of the wheels that stays wrong is added,
wheels that lock together are not foreseen.
"""

from __future__ import annotations

from math import atan2, exp

import numpy as np

from gripbench.methods.baselines.bicycle_on_paper import steady_sideslip
from gripbench.methods.blocks.speed_fusion import (
    SPEED_PARAMETERS,
    SPEED_SENSORS,
    SPEED_STATE,
    SPEED_VEHICLE,
    advance_speed,
)
from gripbench.methods.contract import CompiledMethod, compiled


@compiled
def _step(state, obs, params, est):
    advance_speed(state.speed, obs, params, state.speed_y)
    filter = state.speed.filter
    speed = max(filter.x[0], 0.0)
    target = 0.0
    if speed > 2.0:
        target = speed * steady_sideslip(speed, state.speed.yaw_rate, params)
    settling = params.mass * max(speed, 2.0)
    settling /= params.cornering_stiffness_front + params.cornering_stiffness_rear
    kept = exp(-obs.elapsed / settling)
    state.speed_y = kept * state.speed_y + (1.0 - kept) * target
    est.speed_x, est.speed_y = filter.x[0], state.speed_y
    est.sideslip = atan2(state.speed_y, max(speed, 1.0))
    est.speed_x_variance = filter.P[0, 0] + (params.radius_std * filter.x[0]) ** 2


class SpeedFusion(CompiledMethod):
    """Longitudinal speed from wheel speeds and accelerometer."""

    name = "speed_fusion"
    title = "Speed fusion"
    reference = "Kiencke & Nielsen, Automotive Control Systems, 2nd ed., section 9.3"
    sensors = SPEED_SENSORS
    estimates = ("speed_x", "speed_y", "sideslip")
    variances = ("speed_x",)
    vehicle_parameters = (
        *SPEED_VEHICLE,
        "cg_to_rear",
        "cornering_stiffness_front",
        "cornering_stiffness_rear",
    )
    parameters = SPEED_PARAMETERS
    state = np.dtype([("speed", SPEED_STATE), ("speed_y", np.float64)])
    step = staticmethod(_step)
