"""Figures 3 to 17 and 20 to 32 of Li, Du & Li (2014), by their numbers.

As in the paper, only the front axle is shown, Method 1 with half of its total force, and Figures 4
to 17 take one in a hundred of the solver's points. The friction axis covers what lies within a
band that its caption names: without traction there is nothing to estimate from, and some
estimates then leave any readable axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.papers.figures import PaperFigure
from gripbench.bench.papers.li2014.tables import PaperTables, load_paper_tables
from gripbench.bench.publishing.figures.runs import Runs
from gripbench.bench.publishing.figures.style import (
    SHADE,
    TRUTH,
    axis_label,
    legend_above,
    line,
    new_figure,
    series_style,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

THINNED = 100
"""Figures 4 to 17 show one point in this many."""

METHODS = ("Method 1", "Method 2", "Method 3", "EKF")
"""Methods of Figures 4 to 17; Figures 20 to 32 show the fifth, which the paper proposes."""

PROPOSED = "Proposed"

DETAIL = (8.0, 8.5)
"""Interval [s] that the force figures of the proposed observer magnify."""

SETTLED = 0.5
"""Estimates before this time [s] do not stretch the force axis of those figures."""

FORCE, FRICTION, SPEED = "force_x_front", "mu_front", "speed_x"


@dataclass(frozen=True)
class _Case:
    """A scenario of the paper with the numbers of its figures."""

    scenario: str
    words: str
    compared: tuple[int, int]
    proposed: tuple[int, int]
    friction_axis: tuple[float, float]
    compared_note: tuple[str, str]
    proposed_note: tuple[str, str]


def _cases() -> tuple[_Case, ...]:
    return (
        _Case(
            "li2014_constant_mu", "constant friction 0.9", (4, 5), (21, 22), (-0.5, 2.5),
            (
                "Methods 1 and 3 lie on each other, close to the truth; Method 2 is above it. The "
                "truth itself swings with the steps of the solver.",
                "Method 1 holds 0.9; after 20 s, without traction, the others lose it.",
            ),
            (
                "Estimate and truth swing alike, as the magnified half second shows.",
                "Within a second at 0.9, and it stays there without traction.",
            ),
        ),
        _Case(
            "li2014_friction_step", "friction falls from 0.9 to 0.5 at 10 s", (6, 7), (23, 24),
            (-0.5, 2.5),
            (
                "The force hardly changes at 10 s, since the torque stays as it was.",
                "All methods follow the fall at 10 s, and all but Method 1 lose it after 20 s.",
            ),
            (
                "The estimate overshoots once, when friction falls.",
                "The estimate follows the fall at once and stays a little too high.",
            ),
        ),
        _Case(
            "li2014_noisy_acceleration", "noise and bias on the acceleration", (8, 9), (25, 26),
            (-2.0, 6.0),
            (
                "Method 2, which does not use the acceleration, is as good as without noise.",
                "Noise matters most after 20 s, where there is no traction.",
            ),
            (
                "The start apart, the lower gain keeps the estimate near the truth.",
                "Usable under traction only.",
            ),
        ),
        _Case(
            "li2014_large_torque", "large torque", (11, 12), (27, 28), (-0.5, 2.5),
            (
                "In the tyres' nonlinear region Method 1 and the EKF leave the truth.",
                "Beyond the linear region all methods fall below 0.9, Method 1 furthest.",
            ),
            (
                "The estimate follows up to about 3700 N and then collapses.",
                "Far too low at large slip; back at 0.9 only at the end.",
            ),
        ),
        _Case(
            "li2014_gradient", "road gradient 0.01 rad", (13, 14), (29, 30), (-0.5, 2.5),
            (
                "Method 2 is furthest off: it does not know of the gradient's force.",
                "Method 1 is the best of the four.",
            ),
            (
                "Estimate and truth swing alike, as the magnified half second shows.",
                "Above 0.9 at the start only.",
            ),
        ),
        _Case(
            "li2014_combined_traction_braking", "traction, then braking", (16, 17), (31, 32),
            (-0.5, 2.5),
            (
                "All follow the sign of the force; Method 2 is furthest off under traction.",
                "All but Method 1 go wrong where the torque vanishes, and under braking.",
            ),
            (
                "The estimate follows both signs of the force.",
                "Close to 0.9 throughout.",
            ),
        ),
    )  # fmt: skip


def _paper() -> PaperTables:
    return load_paper_tables("li2014")


def _choice(title: str, scenario: str) -> str:
    """Return the choice of the method that a column of the paper's tables stands for."""
    column = next(column for column in _paper().methods if column.title == title)
    return f"{column.method}:{column.exceptions.get(scenario, column.variant)}"


def _curves(
    axes: Axes, runs: Runs, scenario: str, name: str, titles: Sequence[str], every: int
) -> None:
    """Draw the truth of a signal and its estimates by these methods."""
    truth = runs.recording(scenario).truth
    time = truth["time"]
    line(axes, time[::every], truth[name][::every], "Truth", TRUTH)
    for index, title in enumerate(titles):
        estimates = runs.estimates(scenario, _choice(title, scenario))
        look = series_style(4 if title == PROPOSED else index)
        line(axes, time[::every], estimates[name][::every], title, look, index / len(titles))
    axes.set_xlabel("Time [s]")
    axes.set_ylabel(axis_label(name))
    axes.set_xlim(0.0, float(time[-1]))


def _single(
    runs: Runs,
    scenario: str,
    name: str,
    titles: Sequence[str],
    every: int,
    limits: tuple[float, float] | None = None,
) -> Figure:
    figure = new_figure(3.3)
    axes = figure.subplots()
    _curves(axes, runs, scenario, name, titles, every)
    if limits:
        axes.set_ylim(*limits)
    legend_above(axes, 5)
    return figure


def _with_detail(runs: Runs, scenario: str, name: str) -> Figure:
    """Draw every point of truth and proposed observer, and half a second of it magnified."""
    figure = new_figure(3.3)
    whole, detail = figure.subplots(1, 2, width_ratios=(1.7, 1.0))
    for axes in (whole, detail):
        _curves(axes, runs, scenario, name, (PROPOSED,), 1)
    for drawn in whole.lines:
        drawn.set_linewidth(0.5 * drawn.get_linewidth())
    detail.set_ylabel("")
    detail.set_xlim(*DETAIL)
    whole.axvspan(*DETAIL, color=SHADE, alpha=0.5, zorder=0)
    time = runs.recording(scenario).truth["time"]
    _fit(detail, (time >= DETAIL[0]) & (time <= DETAIL[1]))
    _fit(whole, time > SETTLED)
    legend_above(whole)
    return figure


def _fit(axes: Axes, shown: npt.NDArray[np.bool_]) -> None:
    """Fit the range of y to those points of the curves that are to be shown."""
    values = np.concatenate([np.asarray(drawn.get_ydata(), float)[shown] for drawn in axes.lines])
    margin = 0.05 * float(np.ptp(values))
    axes.set_ylim(float(values.min()) - margin, float(values.max()) + margin)


def _torque(runs: Runs, scenario: str) -> Figure:
    truth = runs.recording(scenario).truth
    figure = new_figure(2.9)
    axes = figure.subplots()
    line(axes, truth["time"], truth["torque_front"], "Front and rear", TRUTH)
    axes.set_xlabel("Time [s]")
    axes.set_ylabel("Torque on each axle [N m]")
    axes.set_xlim(0.0, float(truth["time"][-1]))
    legend_above(axes)
    return figure


def _overview(runs: Runs) -> Figure:
    """Draw force and friction of the friction step, all five methods."""
    scenario = "li2014_friction_step"
    figure = new_figure(3.5, width=9.6)
    for axes, name, limits in zip(
        figure.subplots(1, 2), (FORCE, FRICTION), ((-60.0, 460.0), (0.0, 1.4)), strict=True
    ):
        _curves(axes, runs, scenario, name, (*METHODS, PROPOSED), THINNED)
        axes.set_ylim(*limits)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=6, handlelength=3.2)
    return figure


def _figures() -> tuple[PaperFigure, ...]:
    found: dict[int, PaperFigure] = {}

    def add(number: int, title: str, caption: str, draw: Any) -> None:
        found[number] = PaperFigure(str(number), title, caption, draw)

    for number, scenario, words, caption in (
        (3, "li2014_constant_mu", "Torque", "150 N m on each axle until 20 s."),
        (10, "li2014_large_torque", "Large torque", "Half a sine of 2150 N m over 25 s."),
        (15, "li2014_combined_traction_braking", "Traction and brake torque",
         "150 N m until 10 s, then -67 N m from 13.5 s to 18.5 s."),
    ):  # fmt: skip
        add(number, words, caption, partial(_torque, scenario=scenario))
    add(
        20,
        "Estimated velocity",
        "The estimate of the proposed observer, which has no GPS, lies on the truth.",
        partial(_single, scenario="li2014_constant_mu", name=SPEED, titles=(PROPOSED,), every=1),
    )
    for case in _cases():
        for titles, numbers, notes, every in (
            (METHODS, case.compared, case.compared_note, THINNED),
            ((PROPOSED,), case.proposed, case.proposed_note, 1),
        ):
            who = "proposed observer" if titles == (PROPOSED,) else "Methods 1 to 3 and EKF"
            add(
                numbers[0],
                f"Front tyre force, {who}: {case.words}",
                notes[0],
                partial(_with_detail, scenario=case.scenario, name=FORCE)
                if titles == (PROPOSED,)
                else partial(
                    _single, scenario=case.scenario, name=FORCE, titles=titles, every=every
                ),
            )
            low, high = case.friction_axis
            if titles == (PROPOSED,) and case.scenario != "li2014_noisy_acceleration":
                low, high = 0.0, 1.4
            add(
                numbers[1],
                f"Front friction coefficient, {who}: {case.words}",
                f"{notes[1]} The axis is cut at {low:g} and {high:g}.",
                partial(
                    _single,
                    scenario=case.scenario,
                    name=FRICTION,
                    titles=titles,
                    every=every,
                    limits=(low, high),
                ),
            )
    overview = PaperFigure(
        "overview",
        "Force and friction of five methods while friction falls from 0.9 to 0.5 at 10 s",
        "The force (left) does not tell the fall at 10 s; the friction estimates (right) do. After "
        "20 s there is no traction, and nothing to estimate friction from.",
        _overview,
    )
    return (*(found[number] for number in sorted(found)), overview)


FIGURES = _figures()
"""Every result figure of the paper, in order, and the overview."""
