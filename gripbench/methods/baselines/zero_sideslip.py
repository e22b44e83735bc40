"""Zero sideslip: no sample in, a vehicle that moves where it points out."""

from __future__ import annotations

import numpy as np

from gripbench.methods.contract import CompiledMethod, Parameter, compiled


@compiled
def _step(state, obs, params, est):
    est.sideslip, est.speed_y = 0.0, 0.0
    est.sideslip_variance = params.sideslip_std**2


class ZeroSideslip(CompiledMethod):
    """Sideslip angle and lateral velocity zero."""

    name = "zero_sideslip"
    title = "Zero sideslip"
    reference = "Baseline"
    baseline = True
    sensors = ()
    estimates = ("sideslip", "speed_y")
    variances = ("sideslip",)
    parameters = (
        Parameter("sideslip_std", 0.05, "rad", "Standard deviation of its error", 1e-4, 1.0),
    )
    state = np.dtype([("unused", np.float64)])
    step = staticmethod(_step)
