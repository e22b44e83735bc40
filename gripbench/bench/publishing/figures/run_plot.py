"""A plot of one run: a signal's truth, its estimates with their confidence, and their errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.bounds.bound import Bound
from gripbench.bench.catalogue.declarations import Declaration
from gripbench.bench.publishing.figures.knowable import shade_unknowable
from gripbench.bench.publishing.figures.runs import Runs
from gripbench.bench.publishing.figures.style import (
    TRUTH,
    axis_label,
    axis_scale,
    legend_above,
    line,
    new_figure,
    series_style,
    zero_line,
)
from gripbench.bench.running.recorded_scenarios import log_window
from gripbench.envs.signals import VARIANCE, difference, signal
from gripbench.errors import InputError, unknown
from gripbench.methods.outputs import quantile_field

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DEVIATIONS = 1.96
"""Half width of the band around an estimate that gives its variance, in standard deviations."""

MOST_POINTS = 4000
"""A curve of more points than this is thinned: none of them could be told apart."""


_USUAL = ("mu", "mu_front", "sideslip", "speed_x")


def usual_signal(runs: Runs, scenario: str, methods: Sequence[str], seed: int = 0) -> str:
    """Return what is drawn of a run unless one asks: what all methods estimate, friction first.

    Parameters
    ----------
    runs, scenario, methods, seed
        As `run_plot` takes them.
    """
    known = runs.recording(scenario, seed).truth.dtype.names or ()
    found = [name for name in dict.fromkeys((*_USUAL, *known)) if name in known and name != "time"]
    for method in methods:
        estimates = runs.method(method).declaration.estimates
        found = [name for name in found if name in estimates] or found
    return found[0]


def run_plot(
    runs: Runs,
    scenario: str,
    methods: Sequence[str],
    name: str,
    seed: int = 0,
    start: float | None = None,
    end: float | None = None,
    bound: Bound | None = None,
) -> Figure:
    """Draw a signal of one run: truth and estimates above, errors below.

    Parameters
    ----------
    runs
        Where recordings and estimates come from.
    scenario, seed
        The run.
    methods
        Choices of methods, `name[:variant][@parameter=value,...]`.
    name
        The signal.
    start, end
        Part of the run [s]; all of it where none is given. Of a recording it is the window, and
        times are those of the log's own clock.
    bound
        Of this run and signal: what could not be known is shaded.

    Raises
    ------
    InputError
        If the run has no such signal, a method does not estimate it, or the part is empty.
    """
    signal(name)
    recording = runs.recording(scenario, seed)
    truth, window = recording.truth, log_window(recording)
    if name not in (truth.dtype.names or ()):
        raise unknown(f"signal in the truth of {scenario}", name, truth.dtype.names or ())
    time = truth["time"]
    if window is not None:
        time = time + recording.notes.get("time_origin", 0.0)
        start = window.start if start is None else start
    shown = np.flatnonzero(
        (time >= (time[0] if start is None else start))
        & (time <= (time[-1] if end is None else end))
    )
    if len(shown) < 2:
        raise InputError(
            f"{scenario} has no samples there: seed {seed} runs from {time[0]:.6g} to "
            f"{time[-1]:.6g} s"
        )
    shown = shown[:: max(1, len(shown) // MOST_POINTS)]
    scale, unit = axis_scale(name)
    figure = new_figure(5.0 if methods else 3.2)
    rows = figure.subplots(2 if methods else 1, 1, sharex=True, squeeze=False)[:, 0]
    line(rows[0], time[shown], scale * truth[name][shown], "Truth", TRUTH)
    for index, method in enumerate(methods):
        spec = runs.method(method)
        if name not in spec.declaration.estimates:
            raise unknown(f"estimate of {spec.label}", name, spec.declaration.estimates)
        estimates = runs.estimates(scenario, method, seed)[shown]
        look = series_style(index)
        values = scale * estimates[name]
        line(rows[0], time[shown], values, spec.label, look, index / len(methods))
        line(
            rows[1], time[shown],
            scale * difference(name, estimates[name], truth[name][shown]), spec.label, look,
            index / len(methods),
        )  # fmt: skip
        band = _stated_band(spec.declaration, estimates, name)
        if band is not None:
            rows[0].fill_between(
                time[shown], scale * band[0], scale * band[1], color=look.color, alpha=0.15,
                linewidth=0.0, zorder=2,
            )  # fmt: skip
    rows[0].set_ylabel(axis_label(name))
    rows[-1].set_xlabel("Time [s]" if window is None else "Time of the log [s]")
    if bound is not None:
        for axes in rows:
            shade_unknowable(axes, bound)
        rows[-1].set_xlim(time[shown[0]], time[shown[-1]])
    if methods:
        zero_line(rows[1])
        rows[1].set_ylabel("Error" if unit == "-" else f"Error [{unit}]")
    legend_above(rows[0], 2 if max(map(len, methods), default=0) > 24 else 3)
    title = f"{scenario}, seed {seed}"
    if window is not None:
        title += f": run {window.run}, {window.start:.3f} to {window.end:.3f} s of the log's clock"
    figure.suptitle(title, fontsize=9.5, x=0.01, ha="left")
    return figure


def _stated_band(
    declaration: Declaration, estimates: npt.NDArray[Any], name: str
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]] | None:
    """Return between what a method states that the signal lies; None: it states nothing.

    By a variance 95 %, by quantiles from the lowest to the highest that it gives.
    """
    if name in declaration.variances:
        reach = DEVIATIONS * np.sqrt(np.maximum(estimates[name + VARIANCE], 0.0))
        return estimates[name] - reach, estimates[name] + reach
    if name in declaration.quantiles:
        levels = declaration.quantiles[name]
        low, high = (quantile_field(name, level) for level in (levels[0], levels[-1]))
        return estimates[low], estimates[high]
    return None
