"""Bring series to a common grid of time: means over cells, smooth parts taken off."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gripbench.logs.channels.series import Floats, Series

FEWEST = 20
"""Cells that a comparison needs at least."""


_GAP = 10.0  # usual distances between samples, and a second: across more nothing is known


def on_grid(series: Sequence[Series], step: float) -> list[Floats] | None:
    """Return the means of the series over the same cells of time, or None if these are too few.

    The cells are those of the longest stretch in which no series has a gap.
    """
    start, end = _longest_stretch(series)
    if not np.isfinite(end - start) or end - start > 1e7 * step:
        return None
    count = int((end - start) / step) - 1
    if count < FEWEST:
        return None
    centres = start + step * (1.0 + np.arange(count))
    columns = []
    for s in series:
        mean = np.interp(centres, s.times, s.values)
        total = np.concatenate([[0.0], np.cumsum(s.values)])
        first = np.searchsorted(s.times, centres - 0.5 * step)
        last = np.searchsorted(s.times, centres + 0.5 * step)
        averaged = last - first > 1  # a slower series has at most one sample in a cell
        mean[averaged] = (total[last] - total[first])[averaged] / (last - first)[averaged]
        columns.append(mean)
    return columns


def _longest_stretch(series: Sequence[Series]) -> tuple[float, float]:
    """Return the longest interval [s] that all series fill."""
    start = max(float(s.times[0]) for s in series)
    end = min(float(s.times[-1]) for s in series)
    gaps = []
    for one in {id(s.times): s.times for s in series}.values():
        steps = np.diff(one)
        if not len(steps):
            continue
        wide = np.flatnonzero(steps > max(1.0, _GAP * float(np.median(steps))))
        gaps += [(float(one[k]), float(one[k + 1])) for k in wide]
    best, begin = (start, start), start
    for low, high in [*sorted(gaps), (end, end)]:
        if min(low, end) - begin > best[1] - best[0]:
            best = begin, min(low, end)
        begin = max(begin, high)
    return best


def without_trend(values: Floats, width: int) -> Floats:
    """Return values less their centred mean over `width` cells, over fewer at the ends."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    here = np.arange(len(values))
    half = np.minimum(np.minimum(here, len(values) - 1 - here), width // 2)
    return values - (total[here + half + 1] - total[here - half]) / (2 * half + 1)


def correlation(left: Floats, right: Floats) -> float:
    """Return the correlation of two signals; 0 where one is constant."""
    a, b = left - left.mean(), right - right.mean()
    size = float(np.sqrt(np.mean(a * a) * np.mean(b * b)))
    return float(np.mean(a * b)) / size if size > 0.0 else 0.0
