"""Figures 6 to 10 and 12 to 14 of Yoon, Li & Ahn (2015), by their numbers.

The paper's runs on test tracks and public roads are the scenarios of the same manoeuvres. Figure
14 shows its part (a), which the paper measured; parts (b) and (c) are figures of other papers.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from gripbench.bench.papers.figures import PaperFigure
from gripbench.bench.papers.panels import TRUTH_NAME, Panel, draw_panels, signal_panel
from gripbench.bench.papers.yoon2015.brush_identification import (
    identify,
    lateral_test,
    modelled_acceleration,
)
from gripbench.bench.papers.yoon2015.reproduction import TRACK, friction_error_and_delay
from gripbench.bench.publishing.figures.runs import Runs
from gripbench.bench.publishing.figures.style import SHADE, new_figure, series_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CASCADE = "magnetometer_gps_cascade"
PUBLIC = "public_road"

SEEDS = range(5)
"""Runs of each manoeuvre in Figure 14."""

_EVERY = 10  # of the samples, for the identification


def _run(runs: Runs, scenario: str, seed: int = 0) -> Figure:
    truth = runs.recording(scenario, seed).truth
    estimates = [("Cascade", runs.estimates(scenario, CASCADE, seed))]
    lateral = Panel("Lateral acceleration [m/s²]", ((TRUTH_NAME, truth["accel_y"]),))
    slip = signal_panel("sideslip", truth, estimates)
    friction = signal_panel("mu", truth, estimates, limits=(0.0, 1.0))
    return draw_panels(truth["time"], [lateral, slip, friction])


def _validation(runs: Runs) -> Figure:
    """Fit the brush tyre to two manoeuvres on snow and show it in the first of them."""
    recordings = [runs.recording(name) for name in ("double_lane_change_snow", "slalom_snow")]
    tests = [lateral_test(recording, every=_EVERY) for recording in recordings]
    vehicle = recordings[0].vehicle
    tyre = identify(tests, vehicle)
    parameters = np.array(list(tyre.values.values()))
    truth = recordings[0].truth
    time = truth["time"][truth["time"] >= recordings[0].score_from][::_EVERY]
    modelled = modelled_acceleration(tests[0], vehicle, parameters)
    modelled = modelled + float(np.mean(tests[0].accel_y - modelled))
    panel = Panel(
        "Lateral acceleration [m/s²]", (("Measured", tests[0].accel_y), ("Model", modelled))
    )
    return draw_panels(time, [panel], height=2.8)


def _performance(runs: Runs) -> Figure:
    figure = new_figure(3.4)
    axes = figure.subplots()
    for index, scenario in enumerate((*TRACK, PUBLIC)):
        found = []
        for seed in SEEDS:
            truth = runs.recording(scenario, seed).truth
            mu = runs.estimates(scenario, CASCADE, seed)["mu"]
            error, delay = friction_error_and_delay(truth, np.asarray(mu, float))
            found.append((abs(error), delay))
        points = np.array(found)
        points = points[np.isfinite(points).all(axis=1)]
        look = series_style(index)
        missing = len(found) - len(points)
        label = scenario.replace("_", " ") + (f" ({missing} never settle)" if missing else "")
        axes.plot(
            points[:, 1], points[:, 0], linestyle="", marker=look.marker, color=look.color,
            markerfacecolor="white", markersize=7.0, label=label,
        )  # fmt: skip
    axes.fill_between(
        (1.0, 7.0), 0.0, 0.2, color=SHADE, alpha=0.25, linewidth=0.0, label="Range in the paper"
    )
    axes.margins(0.05)
    axes.set(xlabel="Tracking delay [s]", ylabel="Normalised steady-state error")
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    figure.legend(loc="outside right upper")
    return figure


def _figures() -> tuple[PaperFigure, ...]:
    settled = "The friction estimate (below) moves only while there is lateral excitation."
    public = (
        "Sideslip is worse than on the test track, since the filters know no pitch of the road; "
        "the friction estimate moves in bends only."
    )
    described = (
        (6, "Tyre model validation on packed snow",
         "The identified brush tyre gives the measured lateral acceleration.", _validation),
        (7, "Double lane change on packed snow", settled,
         partial(_run, scenario="double_lane_change_snow")),
        (8, "Slalom on packed snow", settled, partial(_run, scenario="slalom_snow")),
        (9, "Double lane change on ice", settled,
         partial(_run, scenario="double_lane_change_ice")),
        (10, "Slalom on ice", settled, partial(_run, scenario="slalom_ice")),
        (12, "Public roads, first run", public, partial(_run, scenario=PUBLIC, seed=0)),
        (13, "Public roads, second run", public, partial(_run, scenario=PUBLIC, seed=1)),
        (14, "Steady-state error and delay of the friction estimate",
         f"One point a run, {len(SEEDS)} runs of each manoeuvre; grey is what the paper reports.",
         _performance),
    )  # fmt: skip
    return tuple(PaperFigure(str(n), title, text, draw) for n, title, text, draw in described)


FIGURES = _figures()
"""Every result figure of the paper, in order."""
