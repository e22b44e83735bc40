"""The one style of all pictures.

Colours are those of Okabe and Ito, which the colour-blind tell apart; because they do not all
differ in grey, every series also has its own line and marker.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from gripbench.envs.signals import signal
from gripbench.writing import being_written

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

RC: dict[Any, Any] = {
    "backend": "agg",
    "figure.dpi": 150,
    "savefig.dpi": 150,
    "figure.constrained_layout.use": True,
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#d9d9d9",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.xmargin": 0.0,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.0,
    "path.simplify": True,
    "path.simplify_threshold": 0.2,
    "agg.path.chunksize": 20000,
    "pdf.fonttype": 42,
}
"""Settings of matplotlib under which every picture is made and saved."""

WIDTH = 6.4
"""Width of a picture [in]."""

_MARKERS_A_LINE = 12


@dataclass(frozen=True)
class SeriesStyle:
    """How one series looks."""

    color: str
    linestyle: Any
    marker: str
    linewidth: float = 1.3


TRUTH = SeriesStyle("#000000", "-", "", 2.2)
"""Style of the truth: the only thick line and the only one in black."""

SERIES = (
    SeriesStyle("#0072B2", (0, (6, 2)), "o"),
    SeriesStyle("#D55E00", (0, (2, 1.5)), "s"),
    SeriesStyle("#009E73", (0, (6, 2, 1.5, 2)), "^"),
    SeriesStyle("#CC79A7", (0, (1, 1)), "D"),
    SeriesStyle("#E69F00", "-", "v"),
    SeriesStyle("#56B4E9", (0, (8, 2, 1, 2, 1, 2)), "P"),
)
"""Styles of the estimates, in the order in which a picture draws them."""


SHADE = "#999999"
"""Colour of a range that is pointed out behind the curves."""

PAGE: Mapping[str, tuple[str, ...]] = {
    "light": tuple(look.color for look in SERIES),
    "dark": ("#56B4E9", "#FF8A4C", "#2FCB9A", "#E79BC8", "#F2C04D", "#B7A4FF"),
    "dashes": ("dash", "dot", "dashdot", "longdash", "solid", "longdashdot"),
    "symbols": ("circle", "square", "triangle-up", "diamond", "triangle-down", "cross"),
}
"""The same in Plotly's words, with colours for a dark page."""


def series_style(index: int) -> SeriesStyle:
    """Return the style of the series with this index; they repeat from the seventh on."""
    return SERIES[index % len(SERIES)]


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """Return an empty figure of this height and width [in]; call it within `style`."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height))


def style() -> Any:
    """Return the context in which figures are made and saved."""
    import matplotlib

    return matplotlib.rc_context(dict(matplotlib.rcParamsDefault) | RC)


def line(
    axes: Axes,
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    label: str,
    look: SeriesStyle,
    offset: float = 0.0,
) -> None:
    """Draw one series with its markers at even distances along x.

    Parameters
    ----------
    axes
        Where.
    x, y
        Points, shape (n,); x rises.
    label
        Name in the legend.
    look
        Its style.
    offset
        Shift of the markers, as a share of their distance, so that those of curves on top of
        one another do not hide each other.
    """
    x, y = np.asarray(x, float), np.asarray(y, float)
    axes.plot(
        x,
        y,
        label=label,
        color=look.color,
        linestyle=look.linestyle,
        linewidth=look.linewidth,
        marker=look.marker or None,
        markevery=_markers(x, offset) if look.marker else None,
        markerfacecolor="white",
        markeredgewidth=1.0,
        zorder=3 if look is TRUTH else 3.5,
    )


def zero_line(axes: Axes) -> None:
    """Draw where an error is zero."""
    axes.axhline(0.0, color=TRUTH.color, linewidth=0.8)


def _markers(x: npt.NDArray[np.float64], offset: float) -> list[int]:
    """Return the indices of points at even distances along x (a solver's points are uneven)."""
    if len(x) < 2:
        return [0] if len(x) else []
    spacing = (x[-1] - x[0]) / _MARKERS_A_LINE
    places = x[0] + spacing * (offset % 1.0 + np.arange(_MARKERS_A_LINE))
    return sorted(set(np.clip(np.searchsorted(x, places), 0, len(x) - 1).tolist()))


def legend_above(axes: Axes, columns: int = 3) -> None:
    """Put the legend above the axes, where it hides no curve."""
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.01),
        ncols=columns,
        borderaxespad=0.2,
        handlelength=3.2,
        columnspacing=1.4,
    )


SYMBOLS: Mapping[str, str] = {
    "force_x_front": "Front tyre force",
    "force_x_rear": "Rear tyre force",
    "mu_front": "Friction coefficient (front)",
    "mu_rear": "Friction coefficient (rear)",
    "mu": "Friction coefficient",
    "speed_x": "Longitudinal velocity",
    "speed_y": "Lateral velocity",
    "sideslip": "Sideslip angle",
    "yaw_rate": "Yaw rate",
}
"""What an axis calls a signal; others go by their name."""


def axis_scale(name: str) -> tuple[float, str]:
    """Return factor and unit in which pictures show a signal, degrees as their sign."""
    shown = signal(name)
    return shown.display_factor, shown.display_unit.replace("deg", "°")


def axis_label(name: str) -> str:
    """Return the label of a signal's axis with the unit that `axis_scale` gives."""
    unit = axis_scale(name)[1]
    text = SYMBOLS.get(name, name.replace("_", " ").capitalize())
    return text if unit == "-" else f"{text} [{unit}]"


def save(figure: Figure, directory: Path, stem: str, dpi: int = 150) -> list[Path]:
    """Write a figure as PNG and PDF; the same figure gives the same bytes.

    Raises
    ------
    InputError
        If the directory cannot be written.
    """
    paths = [directory / f"{stem}.png", directory / f"{stem}.pdf"]
    with being_written(paths[0]) as path:
        figure.savefig(path, dpi=dpi, metadata={"Software": None})
    with being_written(paths[1]) as path:
        figure.savefig(path, metadata={"CreationDate": None, "Producer": None, "Creator": None})
    return paths
