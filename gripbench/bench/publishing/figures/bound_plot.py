"""A bound over time, drawn: truth with its band, least deviation, information a second."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gripbench.bench.bounds.bound import Bound
from gripbench.bench.publishing.figures.knowable import shade_unknowable
from gripbench.bench.publishing.figures.run_plot import DEVIATIONS, MOST_POINTS
from gripbench.bench.publishing.figures.style import (
    TRUTH,
    axis_label,
    axis_scale,
    legend_above,
    line,
    new_figure,
    series_style,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def bound_plot(bounds: list[Bound], names: list[str]) -> Figure:
    """Draw the bounds of one run and target for several sets of sensors.

    Parameters
    ----------
    bounds
        Of the same run and target; the truth's band and the shade are those of the first.
    names
        Name of each set.
    """
    first = bounds[0]
    scale, unit = axis_scale(first.target)
    shown = slice(None, None, max(1, len(first.time) // MOST_POINTS))
    time = first.time[shown]
    figure = new_figure(6.4)
    rows = figure.subplots(3, 1, sharex=True)
    truth, width = scale * first.truth[shown], DEVIATIONS * scale * first.deviation[shown]
    line(rows[0], time, truth, "Truth", TRUTH)
    rows[0].fill_between(
        time, truth - width, truth + width, color=series_style(0).color, alpha=0.3, linewidth=0.0,
        zorder=2, label="95 % of the best estimate",
    )  # fmt: skip
    rows[0].set_ylabel(axis_label(first.target))
    for index, (bound, name) in enumerate(zip(bounds, names, strict=True)):
        look = series_style(index)
        offset = index / len(bounds)
        deviation = scale * np.maximum(bound.deviation[shown], 1e-12)
        line(rows[1], time, deviation, name, look, offset)
        seconds, information = information_a_second(bound)
        line(rows[2], seconds, information / scale**2, name, look, offset)
    rows[1].set_yscale("log")
    rows[1].axhline(scale * first.prior, color=TRUTH.color, linewidth=0.8, label="without sensors")
    label = "Least deviation"
    rows[1].set_ylabel(label if unit == "-" else f"{label} [{unit}]")
    rows[2].set_yscale("symlog", linthresh=_threshold(bounds, scale))
    rows[2].set_ylabel("Information a second" + ("" if unit == "-" else f"\n[1/{unit}²]"))
    rows[2].set_xlabel("Time [s]")
    lowest = min(float(np.median(bound.deviation)) for bound in bounds)
    rows[1].set_ylim(bottom=max(0.03 * scale * lowest, 1e-12))
    shade_unknowable(rows[0], first)
    for axes in rows[1:]:
        shade_unknowable(axes, first, "")
    legend_above(rows[0])
    legend_above(rows[1], 1)
    figure.suptitle(f"{first.scenario}, seed {first.seed}", fontsize=9.5, x=0.01, ha="left")
    return figure


def information_a_second(bound: Bound) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle of each second and the information about the target that it brings."""
    step = bound.time[1] - bound.time[0]
    second = np.floor(bound.time + 1e-9).astype(int)
    gained = np.bincount(second, bound.gained * step)
    return np.arange(len(gained)) + 0.5, gained


def _threshold(bounds: list[Bound], scale: float) -> float:
    largest = max(float(information_a_second(bound)[1].max(initial=0.0)) for bound in bounds)
    return max(largest / scale**2 * 1e-6, 1e-12)
