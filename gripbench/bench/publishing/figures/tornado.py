"""The tornado of one method: from a table of causes to bars of the error at both ends."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from gripbench.bench.publishing.figures.style import SERIES, new_figure
from gripbench.envs.signals import signal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 15
"""Most causes in a picture, the worst ones."""


def tornado(table: pd.DataFrame, label: str, target: str) -> Figure:
    """Return the picture; call it within `style`.

    Parameters
    ----------
    table
        From `gripbench.bench.ranking.sensitivity.summary_of`.
    label, target
        Method and signal.
    """
    shown = table.iloc[:MOST]
    factor, unit = signal(target).display_factor, signal(target).display_unit
    figure = new_figure(1.3 + 0.27 * len(shown))
    axes = figure.subplots()
    places = np.arange(len(shown))[::-1]
    nominal = factor * shown["nominal"].to_numpy(float)
    for side, look, height in (("low", SERIES[0], 0.34), ("high", SERIES[1], 0.34)):
        ends = factor * shown[f"rms_{side}"].to_numpy(float)
        shift = 0.18 if side == "low" else -0.18
        axes.barh(places + shift, ends - nominal, height, nominal, color=look.color, label=side)
    axes.axvline(nominal[0], color="black", lw=1.0, label="no error")
    baseline = factor * float(shown["rms_baseline"].iloc[0])
    if np.isfinite(baseline):
        name = shown["baseline"].iloc[0]
        axes.axvline(baseline, color="black", lw=1.0, ls="--", label=f"best baseline: {name}")
    axes.set_yticks(places, [_named(line) for _, line in shown.iterrows()])
    axes.set_xlabel(f"RMS error of {target} [{unit}]")
    axes.set_xlim(left=0.0, right=1.03 * axes.get_xlim()[1])
    figure.suptitle(f"{label}: one cause at a time, at both ends of its range", x=0.01, ha="left")
    axes.grid(visible=False, axis="y")
    axes.legend(loc="lower right", frameon=True, fontsize=7.5)
    return figure


def _named(line: pd.Series) -> str:
    """Return a cause with its range."""
    low, high, unit = line["low"], line["high"], line["unit"]
    if unit == "relative":
        return f"{line['cause']} ({100.0 * low:+.3g} to {100.0 * high:+.3g} %)"
    return f"{line['cause']} ({low:+.3g} to {high:+.3g} {unit})"
