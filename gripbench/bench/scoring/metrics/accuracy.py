"""Errors of one run into RMS, largest error and mean error; estimates into their mean."""

from __future__ import annotations

import numpy as np

from gripbench.bench.scoring.metric import Context, Floats, Metric, running_total


def squares(time: Floats, estimate: Floats, truth: Floats, context: Context) -> tuple[float, int]:
    """Return the sum of squared errors and the number of samples."""
    error = estimate - truth
    return running_total(error * error), len(error)


def peak(time: Floats, estimate: Floats, truth: Floats, context: Context) -> float:
    """Return the largest absolute error."""
    return float(np.abs(estimate - truth).max())


def bias(time: Floats, estimate: Floats, truth: Floats, context: Context) -> tuple[float, int]:
    """Return the sum of estimate minus truth and the number of samples."""
    return running_total(estimate - truth), len(truth)


def mean_estimate(
    time: Floats, estimate: Floats, truth: Floats, context: Context
) -> tuple[float, int] | None:
    """Return the sum of the estimates where only an interval is known of the signal."""
    return (running_total(estimate), len(estimate)) if context.bounded else None


METRICS = (
    Metric("rms", "RMS", "Root mean square error", squares, "root_mean"),
    Metric("peak", "Peak", "Largest absolute error of all runs", peak, "maximum"),
    Metric("bias", "Bias", "Mean of estimate minus truth", bias, "mean", format="+.3g"),
    Metric(
        "mean_estimate",
        "Mean",
        "Mean estimate, where only an interval is known of the signal",
        mean_estimate,
    ),
)
