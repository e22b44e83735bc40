"""A share of the peak force in, the slip that the Magic Formula needs for it out."""

from __future__ import annotations

from math import asin, atan, tan

from gripbench.compilation import compiled
from gripbench.envs.tyres.longitudinal import magic_formula_slope


@compiled
def inverse_slip(share, params):
    """Return the slip at which the tyre gives a share of its peak force, and d slip / d share.

    Parameters
    ----------
    share
        Force over mu F_z, cut to within -0.95 and 0.95.
    params
        Record with the Magic Formula factors.
    """
    share = min(max(share, -0.95), 0.95)
    angle = asin(share) / params.magic_c
    target = tan(angle)
    u = target
    for _ in range(8):  # u (1 - E) + E atan(u) = target; monotonic for E <= 1
        value = u * (1.0 - params.magic_e) + params.magic_e * atan(u) - target
        u -= value / (1.0 - params.magic_e + params.magic_e / (1.0 + u * u))
    slip = u / params.magic_b
    _, slope = magic_formula_slope(slip, params.magic_b, params.magic_c, params.magic_e)
    return slip, 1.0 / max(slope, 1e-3)
