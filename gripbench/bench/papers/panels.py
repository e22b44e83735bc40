"""Figures of several panels over a common axis, as the lateral papers show their runs."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.publishing.figures.style import (
    TRUTH,
    axis_label,
    axis_scale,
    line,
    new_figure,
    series_style,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_POINTS = 3000
"""A curve of more points than this is thinned: none of them could be told apart."""

TRUTH_NAME = "Truth"


@dataclass(frozen=True)
class Panel:
    """One panel.

    Attributes
    ----------
    ylabel
        Label of its axis, with unit.
    curves
        Name and values of each curve, shape (n,); the one called `TRUTH_NAME` is the truth.
    limits
        Range of its axis; None: what the curves need.
    """

    ylabel: str
    curves: tuple[tuple[str, npt.ArrayLike], ...]
    limits: tuple[float, float] | None = None


def signal_panel(
    name: str,
    truth: npt.NDArray[Any],
    estimates: Sequence[tuple[str, npt.NDArray[Any]]],
    limits: tuple[float, float] | None = None,
) -> Panel:
    """Return the panel of a signal: truth and estimates, angles in degrees."""
    scale = axis_scale(name)[0]
    curves = ((TRUTH_NAME, truth), *estimates)
    return Panel(
        axis_label(name), tuple((label, scale * data[name]) for label, data in curves), limits
    )


def error_panel(
    name: str, truth: npt.NDArray[Any], estimates: Sequence[tuple[str, npt.NDArray[Any]]]
) -> Panel:
    """Return the panel of a signal's errors, angles in degrees."""
    scale, unit = axis_scale(name)
    words = axis_label(name).partition(" [")[0].lower()
    return Panel(
        f"Error of {words}" + ("" if unit == "-" else f" [{unit}]"),
        tuple((label, scale * (data[name] - truth[name])) for label, data in estimates),
    )


def draw_panels(
    x: npt.ArrayLike,
    panels: Sequence[Panel],
    *,
    xlabel: str = "Time [s]",
    columns: int = 1,
    height: float = 1.75,
) -> Figure:
    """Draw panels below (and beside) one another with one legend.

    Parameters
    ----------
    x
        What they have in common, shape (n,); rises.
    panels
        The panels, row by row.
    xlabel
        Label of the common axis.
    columns
        Number of panels in a row.
    height
        Height of a row [in].
    """
    x = np.asarray(x, float)
    every = max(1, len(x) // MOST_POINTS)
    rows = -(-len(panels) // columns)
    figure = new_figure(height * rows + 0.6, width=6.4 if columns == 1 else 8.0)
    grid = figure.subplots(rows, columns, sharex=True, squeeze=False)
    handles: dict[str, Any] = {}
    for axes, panel in zip(grid.flat, panels, strict=False):
        names = [name for name, _ in panel.curves if name != TRUTH_NAME]
        for name, values in panel.curves:
            known = name != TRUTH_NAME
            look = series_style(names.index(name)) if known else TRUTH
            offset = names.index(name) / len(names) if known else 0.0
            line(axes, x[::every], np.asarray(values, float)[::every], name, look, offset)
        axes.set_ylabel(textwrap.fill(panel.ylabel, int(12 * height)))
        if panel.limits:
            axes.set_ylim(*panel.limits)
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    for axes in grid[-1]:
        axes.set_xlabel(xlabel)
    figure.legend(
        list(handles.values()), list(handles), loc="outside upper center", ncols=4, handlelength=3.2
    )
    return figure
