"""How hard the tyres of a recording were used: a lower bound of the utilisation |a|/(mu g)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gripbench.envs.recordings import Recording
from gripbench.envs.vehicles import GRAVITY

Floats = npt.NDArray[np.float64]

_SMOOTHING = 0.5  # s; a telephone's accelerometer shows the road's unevenness


def utilisation_bound(recording: Recording) -> Floats | None:
    """Return what share of the available friction was used at least.

    The horizontal acceleration is that of the reference, or else of the accelerometer as a mean
    over half a second. It is divided by the upper end of what is known of the friction, and where
    nothing is known by gravity alone, which is a bound on every road whose friction is below 1.

    Parameters
    ----------
    recording
        A recording of a real vehicle.

    Returns
    -------
    Shape (n,), NaN where the reference has a hole; None without any accelerometer.
    """
    if "mu_used" in (recording.truth.dtype.names or ()):
        used = np.ascontiguousarray(recording.truth["mu_used"])
    else:
        seen = recording.observations
        if not {"accel_x", "accel_y"} <= set(seen.dtype.names or ()):
            return None
        wide = max(1, round(_SMOOTHING / float(np.median(np.diff(seen["time"])))))
        along, across = (_mean(seen[name], wide) for name in ("accel_x", "accel_y"))
        used = np.hypot(along, across) / GRAVITY
    known = [bound.high for bound in recording.bounds if bound.signal == "mu"]
    highest = max(known, default=1.0)
    return used / (highest if np.isfinite(highest) else 1.0)


def _mean(values: Floats, wide: int) -> Floats:
    """Return the centred mean over `wide` samples, over fewer at the ends."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    here = np.arange(len(values))
    first = np.maximum(here - wide // 2, 0)
    last = np.minimum(here + wide // 2 + 1, len(values))
    return (total[last] - total[first]) / (last - first)
