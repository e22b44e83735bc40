"""Pictures of what methods state of their errors: reliability diagram, NEES over time.

Both are taken over many runs of a scenario. Samples of one run are not independent, so the band of
a curve, and what a consistent method may scatter, come from the runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gripbench.bench.publishing.figures.runs import Runs
from gripbench.bench.publishing.figures.style import (
    TRUTH,
    legend_above,
    line,
    new_figure,
    series_style,
)
from gripbench.bench.scoring.consistency import chi_square_test
from gripbench.bench.scoring.distributions import Floats, Quantiles, Stated
from gripbench.bench.scoring.scoring import context_of
from gripbench.envs.signals import signal
from gripbench.errors import InputError, unknown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEVELS = tuple(k / 20.0 for k in range(1, 20))
"""Levels of the quantiles that a reliability diagram shows of a variance."""

POINTS = 400
"""Points of a curve over time."""

_CONFIDENCE = 0.95


def reliability_plot(
    runs: Runs, scenario: str, methods: Sequence[str], name: str, seeds: int
) -> Figure:
    """Draw in which share of the samples the truth lies below each stated quantile.

    A method that knows its errors is on the diagonal; an S that is flat in the middle states too
    narrow a distribution, a curve above or below the diagonal is a bias.

    Parameters
    ----------
    runs
        Where recordings and estimates come from.
    scenario
        Its name.
    methods
        Choices of methods, `name[:variant][@parameter=value,...]`.
    name
        The signal.
    seeds
        Number of runs.

    Raises
    ------
    InputError
        If a method does not estimate the signal, or states nothing of its error.
    """
    figure = new_figure(5.0, 5.2)
    axes = figure.subplots()
    axes.plot([0.0, 1.0], [0.0, 1.0], color=TRUTH.color, linewidth=0.8)
    for index, (label, every) in enumerate(_over_runs(runs, scenario, methods, name, seeds)):
        below: list[list[float]] = []
        levels: tuple[float, ...] = LEVELS
        for _, stated in every:
            levels = stated.levels if isinstance(stated, Quantiles) else LEVELS
            shares = [stated.below(level) for level in levels]
            below.append([float(np.mean(one)) for one in shares if one is not None])
        share = np.mean(below, axis=0)
        look = series_style(index)
        x = np.array([0.0, *levels, 1.0])
        line(axes, x, np.array([0.0, *share, 1.0]), label, look, index / len(methods))
        if seeds > 1:
            from scipy.special import stdtrit

            reach = stdtrit(seeds - 1, 0.5 + _CONFIDENCE / 2.0)
            half = reach * np.std(below, axis=0, ddof=1) / np.sqrt(seeds)
            axes.fill_between(
                levels, np.maximum(share - half, 0.0), np.minimum(share + half, 1.0),
                color=look.color, alpha=0.15, linewidth=0.0,
            )  # fmt: skip
    axes.set_xlabel("Stated probability")
    axes.set_ylabel(f"Share of samples below, {signal(name).name}")
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.0)
    legend_above(axes, 2)
    figure.suptitle(f"{scenario}, {seeds} runs", fontsize=9.5, x=0.01, ha="left")
    return figure


def nees_plot(runs: Runs, scenario: str, methods: Sequence[str], name: str, seeds: int) -> Figure:
    """Draw the mean normalised squared error over time with the band of a consistent method.

    At one time the runs are independent: the band is that of the chi-square law with one degree of
    freedom for each run, exact where errors are normal. Parameters and errors as of
    `reliability_plot`.
    """
    figure = new_figure(3.6)
    axes = figure.subplots()
    for index, (label, every) in enumerate(_over_runs(runs, scenario, methods, name, seeds)):
        squares: list[Floats] = []
        times: Floats = np.empty(0)
        for time, stated in every:
            normalised = stated.normalised()
            if normalised is None:
                raise InputError(
                    f"{label}: its quantiles of {name} tell no deviation on both sides"
                )
            squares.append(normalised**2)
            times = time if len(time) > len(times) else times
        length = max(map(len, squares))
        table = np.full((seeds, length), np.nan)
        for row, values in zip(table, squares, strict=True):
            row[: len(values)] = values
        shown = np.unique(np.linspace(0, length - 1, min(POINTS, length)).astype(int))
        mean = np.nanmean(table[:, shown], axis=0)
        line(axes, times[shown], mean, label, series_style(index), index / len(methods))
    band = chi_square_test(np.ones(seeds), confidence=_CONFIDENCE)
    axes.axhspan(band.low, band.high, color=TRUTH.color, alpha=0.12, linewidth=0.0)
    axes.axhline(1.0, color=TRUTH.color, linewidth=0.8)
    axes.set_yscale("log")
    axes.set_xlabel("Time [s]")
    axes.set_ylabel(f"NEES of {name}")
    legend_above(axes, 2)
    figure.suptitle(
        f"{scenario}, mean of {seeds} runs; grey: 95 % of a consistent method", fontsize=9.5,
        x=0.01, ha="left",
    )  # fmt: skip
    return figure


def _over_runs(
    runs: Runs, scenario: str, methods: Sequence[str], name: str, seeds: int
) -> list[tuple[str, list[tuple[Floats, Stated]]]]:
    """Return of each method its label and, of each run, what `_stated` returns."""
    found: dict[str, list[tuple[Floats, Stated]]] = {method: [] for method in methods}
    for seed in range(seeds):
        for method, every in found.items():
            every.append(_stated(runs, scenario, method, name, seed))
        runs.forget()
    return [(runs.method(method).label, every) for method, every in found.items()]


def _stated(runs: Runs, scenario: str, method: str, name: str, seed: int) -> tuple[Floats, Stated]:
    """Return times [s] and stated distribution of the samples of a run that count."""
    spec = runs.method(method)
    if name not in spec.declaration.estimates:
        raise unknown(f"estimate of {spec.label}", name, spec.declaration.estimates)
    recording = runs.recording(scenario, seed)
    estimates = runs.estimates(scenario, method, seed)
    if name not in (recording.truth.dtype.names or ()):
        raise unknown(f"signal in the truth of {scenario}", name, recording.truth.dtype.names or ())
    times = recording.truth["time"]
    counted = (times >= recording.score_from) & np.isfinite(recording.truth[name])
    outputs = spec.declaration.outputs
    estimate, truth, context = context_of(name, estimates, outputs, recording, counted)
    stated = context.stated(estimate - truth)
    if stated is None:
        raise InputError(f"{spec.label} states nothing of its error in {name}: no picture of that")
    return times[counted], stated
