"""Figures 3, 4 and 6 to 13 of Dakhlallah, Glaser, Mammar & Sebsadji (2008), by their numbers.

The paper's measured drive is the scenario of moderate lateral acceleration with the paper's
vehicle. Its simulation "of the model" (Figures 3 and 4) is the filter without its correction.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from gripbench.bench.papers.figures import PaperFigure
from gripbench.bench.papers.panels import (
    TRUTH_NAME,
    Panel,
    draw_panels,
    error_panel,
    signal_panel,
)
from gripbench.bench.publishing.figures.runs import Runs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCENARIO = "dakhlallah_mild"
FILTER, MODEL = ("EKF", "dugoff_ekf"), ("Model", "dugoff_ekf:open_loop")
STATES = ("speed_x", "speed_y", "yaw_rate")
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
_LEAST_LOAD = 50.0  # N; used friction means nothing on a wheel without load


def _states(runs: Runs, method: tuple[str, str], names: tuple[str, ...], errors: bool) -> Figure:
    truth = runs.recording(SCENARIO).truth
    shown = [(method[0], runs.estimates(SCENARIO, method[1]))]
    if errors:
        panels = [error_panel(name, truth, shown) for name in names]
    else:
        panels = [signal_panel(name, truth, shown) for name in names]
    return draw_panels(truth["time"], panels, height=1.75 if len(names) > 1 else 2.8)


def _wheels(runs: Runs, axis: str, over_load: bool) -> Figure:
    truth = runs.recording(SCENARIO).truth
    estimates = runs.estimates(SCENARIO, FILTER[1])
    what = {"x": "Longitudinal", "y": "Lateral"}[axis]
    panels = []
    for wheel in WHEELS:
        curves = []
        for name, samples in ((TRUTH_NAME, truth), (FILTER[0], estimates)):
            values = np.asarray(samples[f"force_{axis}_{wheel}"], float)
            if over_load:
                values = values / np.maximum(samples[f"force_z_{wheel}"], _LEAST_LOAD)
            curves.append((name, values))
        unit = "used friction" if over_load else "force [N]"
        panels.append(Panel(f"{what} {unit}, {wheel.replace('_', ' ')}", tuple(curves)))
    return draw_panels(truth["time"], panels, columns=2, height=2.3)


def _figures() -> tuple[PaperFigure, ...]:
    described: tuple[tuple[int, str, str, Callable[[Runs], Figure]], ...] = (
        (3, "State of the model", "The model alone, fed with steering and wheel speeds, already "
         "follows the drive.",
         partial(_states, method=MODEL, names=STATES, errors=False)),
        (4, "Error of the model's state", "What the model alone leaves for the filter to correct.",
         partial(_states, method=MODEL, names=STATES, errors=True)),
        (6, "Estimated state", "Estimates of velocities and yaw rate on top of the truth.",
         partial(_states, method=FILTER, names=STATES, errors=False)),
        (7, "Error of the estimated state", "The lateral velocity, which is not measured, is the "
         "one to look at.",
         partial(_states, method=FILTER, names=STATES, errors=True)),
        (8, "Longitudinal forces", "No drive torque is measured: the forces follow from the wheel "
         "speeds alone.",
         partial(_wheels, axis="x", over_load=False)),
        (9, "Lateral forces", "The outer wheels carry most of the force.",
         partial(_wheels, axis="y", over_load=False)),
        (10, "Longitudinal used friction", "Force over load: little of the friction is used "
         "lengthwise.",
         partial(_wheels, axis="x", over_load=True)),
        (11, "Lateral used friction", "What a drive uses is a lower bound of what the road has.",
         partial(_wheels, axis="y", over_load=True)),
        (12, "Sideslip angle", "Estimate and truth, as the paper compares them.",
         partial(_states, method=FILTER, names=("sideslip",), errors=False)),
        (13, "Error of the sideslip angle", "The error grows with the lateral acceleration.",
         partial(_states, method=FILTER, names=("sideslip",), errors=True)),
    )  # fmt: skip
    return tuple(PaperFigure(str(n), title, text, draw) for n, title, text, draw in described)


FIGURES = _figures()
"""Every result figure of the paper, in order."""
