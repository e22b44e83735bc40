"""Times and whether an error is small into the time from which it stays small."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

TICK = 1e-9
"""Times are sums of steps: a difference [s] below which two of them are the same."""


def first_stay(times: npt.NDArray[np.float64], within: npt.NDArray[np.bool_], hold: float) -> float:
    """Return the first time from which every sample is within for a time, NaN if there is none.

    Parameters
    ----------
    times, within
        Time [s], rising, and whether the error is small, shape (n,).
    hold
        How long [s] it has to stay so.

    Examples
    --------
    >>> first_stay(np.arange(5.0), np.array([True, False, True, True, True]), 2.0)
    2.0
    """
    edges = np.diff(np.concatenate(([False], within, [False])).astype(np.int8))
    first, last = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    long = times[last] - times[first] >= hold
    return float(times[first[np.argmax(long)]]) if long.any() else math.nan
