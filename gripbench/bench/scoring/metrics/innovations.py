"""Innovations of one run, where a filter shows them, into NIS and whiteness.

They are the filter's own and the same for each of its targets. Of a consistent filter each is
normal with the variance that it states, and none tells anything of the next.

References
----------
Y. Bar-Shalom, X.-R. Li & T. Kirubarajan, Estimation with Applications to Tracking and Navigation,
Wiley 2001, section 5.4. G. M. Ljung & G. E. P. Box, Biometrika 65 (1978) 297.
"""

from __future__ import annotations

import math

import numpy as np

from gripbench.bench.scoring.consistency import WhitenessTest
from gripbench.bench.scoring.metric import Context, Floats, Metric, running_total


def normalised_squares(
    time: Floats, estimate: Floats, truth: Floats, context: Context
) -> tuple[float, int] | None:
    """Return the sum of squared innovations over their stated variance, and their number."""
    if context.innovations is None:
        return None
    values = context.innovations.normalised.values()
    with np.errstate(over="ignore"):
        total = math.fsum(running_total(each * each) for each in values)
    return (total, sum(map(len, values))) if math.isfinite(total) else None


def correlation(
    time: Floats, estimate: Floats, truth: Floats, context: Context
) -> tuple[float, int] | None:
    """Return the sum of the correlations of neighbours, and the number of channels."""
    tests = _tests(context)
    return (math.fsum(float(test.autocorrelation[0]) for test in tests), len(tests))


def white(
    time: Floats, estimate: Floats, truth: Floats, context: Context
) -> tuple[float, int] | None:
    """Return how many channels' innovations are white, and the number of channels."""
    tests = _tests(context)
    return (float(sum(test.white for test in tests)), len(tests))


def _tests(context: Context) -> tuple[WhitenessTest, ...]:
    return () if context.innovations is None else context.innovations.whiteness


METRICS = (
    Metric(
        "mean_nis",
        "NIS",
        "Mean of squared innovation over its stated variance, 1 for a consistent filter",
        normalised_squares,
        "mean",
        "-",
        format=".3g",
        whole=True,
    ),
    Metric(
        "innovation_correlation",
        "Innovation correlation",
        "Correlation of an innovation with the one before, 0 for a consistent filter",
        correlation,
        "mean",
        "-",
        format=".2f",
        whole=True,
    ),
    Metric(
        "white_innovations",
        "White innovations",
        "Share of runs and channels whose innovations pass as white, .95 for a consistent filter",
        white,
        "mean",
        "-",
        format=".2f",
        whole=True,
    ),
)
