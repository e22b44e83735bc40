"""Error of one run into the time that it takes to stay small.

Time from the start of scoring, or from the recording's note `friction_step` if that is later, to
the first sample from which the absolute error stays within `BAND` of the largest absolute truth
for `HOLD` seconds.
"""

from __future__ import annotations

import math

import numpy as np

from gripbench.bench.scoring.metric import Context, Floats, Metric
from gripbench.bench.scoring.settling import first_stay

BAND = 0.1
"""Width of the band: share of the largest absolute truth."""

HOLD = 0.5
"""Time [s] for which the error has to stay within the band."""


def convergence_time(time: Floats, estimate: Floats, truth: Floats, context: Context) -> float:
    """Return the time [s] until the error stays within its band, inf where it never does."""
    start = max(context.score_from, context.notes.get("friction_step", 0.0))
    within = np.abs(estimate - truth) <= BAND * np.abs(truth).max()
    counted = time >= start
    since = first_stay(time[counted], within[counted], HOLD)
    return math.inf if math.isnan(since) else since - start


METRICS = (
    Metric(
        "convergence_time",
        "Convergence",
        "Median time until the error stays within 10 % of the largest truth for half a second",
        convergence_time,
        "median",
        "s",
        reached="converged",
        format=".2f",
    ),
)
