"""Errors of one run and the method's own variance into scores of its uncertainty.

The stated distribution is normal with the method's variance. A method without a variance, or with
one that is not positive and finite throughout, has none of these values: no pass, no failure. Nor
has it any over several runs of which one has none, so that no method leaves its worst runs out.

References
----------
Y. Bar-Shalom, X.-R. Li & T. Kirubarajan, Estimation with Applications to Tracking and Navigation,
Wiley 2001, section 5.4 (NEES). T. Gneiting & A. E. Raftery, J. Amer. Statist. Assoc. 102 (2007)
359, eq. 21 (CRPS of the normal distribution).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from gripbench.bench.scoring.metric import Context, Floats, Metric, running_total

LEVELS = (0.5, 0.9, 0.95)
"""Probabilities of the stated intervals."""


def normalised_squares(
    time: Floats, estimate: Floats, truth: Floats, context: Context
) -> tuple[float, int] | None:
    """Return the sum of squared errors over their stated variance, and the samples."""
    if context.deviation is None or context.variance is None:
        return None
    error = estimate - truth
    with np.errstate(over="ignore"):  # a variance next to nothing: no finite value
        total = running_total(error * error / context.variance)
    return (total, len(error)) if math.isfinite(total) else None


def crps(
    time: Floats, estimate: Floats, truth: Floats, context: Context
) -> tuple[float, int] | None:
    """Return the sum of the continuous ranked probability scores, and the samples."""
    deviation = context.deviation
    if deviation is None:
        return None
    from scipy.special import ndtr

    z = np.abs(estimate - truth) / deviation
    with np.errstate(over="ignore"):
        density = np.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    scores = deviation * (z * (2.0 * ndtr(z) - 1.0) + 2.0 * density - 1.0 / math.sqrt(math.pi))
    return running_total(scores), len(scores)


def width(
    time: Floats, estimate: Floats, truth: Floats, context: Context
) -> tuple[float, int] | None:
    """Return the sum of the widths of the stated 90 % intervals, and the samples."""
    if context.deviation is None:
        return None
    return 2.0 * _quantile(0.95) * running_total(context.deviation), len(truth)


def _quantile(probability: float) -> float:
    from scipy.special import ndtri  # slow to import, and few methods state a variance

    return float(ndtri(probability))


def _coverage(level: float) -> Callable[..., tuple[float, int] | None]:
    def covered(
        time: Floats, estimate: Floats, truth: Floats, context: Context
    ) -> tuple[float, int] | None:
        """Return how many samples lie within their stated interval, and all of them."""
        if context.deviation is None:
            return None
        reach = _quantile(0.5 + level / 2.0)
        inside = np.abs(estimate - truth) <= reach * context.deviation
        return float(np.count_nonzero(inside)), len(truth)

    return covered


METRICS = (
    Metric(
        "mean_nees",
        "NEES",
        "Mean of squared error over stated variance, 1 for a consistent filter",
        normalised_squares,
        "mean",
        "-",
        format=".3g",
        whole=True,
    ),
    Metric(
        "crps",
        "CRPS",
        "Continuous ranked probability score of the stated variance",
        crps,
        whole=True,
    ),
    *(
        Metric(
            f"coverage_{100 * level:.0f}",
            f"Coverage of {100 * level:.0f} %",
            f"Share of samples within their stated {100 * level:.0f} % interval",
            _coverage(level),
            "mean",
            "-",
            format=".3f",
            whole=True,
        )
        for level in LEVELS
    ),
    Metric("sharpness", "Sharpness", "Mean width of the stated 90 % interval", width, whole=True),
)
