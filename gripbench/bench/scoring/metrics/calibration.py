"""Errors of one run and what the method states of them into scores of its uncertainty.

The stated distribution is normal with the method's variance, or has its quantiles (see
`gripbench.bench.scoring.distributions`). A method without either, or with a variance that is zero
somewhere, has none of these values: no pass, no failure. Nor has it any over several runs of which
one has none, so that no method leaves its worst runs out.

References
----------
Y. Bar-Shalom, X.-R. Li & T. Kirubarajan, Estimation with Applications to Tracking and Navigation,
Wiley 2001, section 5.4 (NEES). T. Gneiting & A. E. Raftery, J. Amer. Statist. Assoc. 102 (2007)
359 (CRPS).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from gripbench.bench.scoring.distributions import LEVELS, Normal
from gripbench.bench.scoring.metric import Context, Floats, Metric, running_total

Total = tuple[float, int]


def normalised_squares(
    time: Floats, estimate: Floats, truth: Floats, context: Context
) -> Total | None:
    """Return the sum of squared errors over their stated variance, and the samples."""
    error = estimate - truth
    stated = context.stated(error)
    with np.errstate(over="ignore"):  # a variance next to nothing: no finite value
        if isinstance(stated, Normal):
            squares: Floats | None = error * error / stated.variance
        else:
            normalised = None if stated is None else stated.normalised()
            squares = None if normalised is None else normalised * normalised
        if squares is None:
            return None
        total = running_total(squares)
    return (total, len(error)) if math.isfinite(total) else None


def crps(time: Floats, estimate: Floats, truth: Floats, context: Context) -> Total | None:
    """Return the sum of the continuous ranked probability scores, and the samples."""
    stated = context.stated(estimate - truth)
    return None if stated is None else (running_total(stated.crps()), len(truth))


def width(time: Floats, estimate: Floats, truth: Floats, context: Context) -> Total | None:
    """Return the sum of the widths of the stated 90 % intervals, and the samples."""
    stated = context.stated(estimate - truth)
    widths = None if stated is None else stated.width(0.9)
    return None if widths is None else (running_total(widths), len(truth))


def _coverage(level: float) -> Callable[..., Total | None]:
    def covered(time: Floats, estimate: Floats, truth: Floats, context: Context) -> Total | None:
        """Return how many samples lie within their stated interval, and all of them."""
        stated = context.stated(estimate - truth)
        inside = None if stated is None else stated.inside(level)
        return None if inside is None else (float(np.count_nonzero(inside)), len(truth))

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
        "Continuous ranked probability score of the stated distribution",
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
