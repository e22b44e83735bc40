"""Pictures of published recordings: estimates, a baseline among them, beside the reference."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.publishing.figures.style import TRUTH, line, new_figure, series_style, style
from gripbench.bench.running.execution import execute
from gripbench.bench.running.recorded_scenarios import on_recording, recorded_scenario, scored_runs
from gripbench.writing import being_written

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HEADING = ("kinematic_kalman_filter", "model_based_kalman_filter", "course_as_heading")
_FRICTION = ("velocity_friction_ekf", "specific_force")

PICTURES: dict[str, tuple[str, tuple[str, ...], int]] = {
    "comma2k19_example": ("yaw", _HEADING, 0),
    "dart_rubber_floor_ramp": ("mu", _FRICTION, 0),
    "dart_taped_tyres_tiles_ramp": ("mu", _FRICTION, 0),
    "f1tenth_optitrack": ("sideslip", ("dugoff_ekf", "zero_sideslip"), 3),
}
"""Target, methods and test run of the picture of each published recording."""

_LABELS = {"yaw": "heading [deg]", "sideslip": "sideslip [deg]", "mu": "friction [-]"}


def write_pictures(names: Sequence[str], directory: Path) -> list[Path]:
    """Write the picture of each recording as `recording_NAME.png`.

    Parameters
    ----------
    names
        Published recordings.
    directory
        Where the pictures go.
    """
    written = []
    for name in names:
        path = directory / f"recording_{name}.png"
        with style():
            figure = draw(name)
            with being_written(path) as temporary:
                figure.savefig(temporary, dpi=150)
        written.append(path)
    return written


def draw(name: str) -> Figure:
    """Return the picture of a published recording; call it within `style`."""
    target, methods, run = PICTURES[name]
    scenario = recorded_scenario(name)
    recording = scored_runs(scenario)[run]
    inside = np.flatnonzero(recording.truth["time"] >= recording.score_from)
    origin = recording.notes["time_origin"]
    time = origin + recording.truth["time"][inside]
    factor = np.rad2deg(1.0) if target in ("yaw", "sideslip") else 1.0
    figure = new_figure(3.2)
    axes = figure.subplots()
    bounds = [bound for bound in recording.bounds if bound.signal == target]
    if not bounds:
        line(axes, time, factor * recording.truth[target][inside], "reference", TRUTH)
    for bound in bounds:
        span = [origin + bound.start, origin + bound.end]
        axes.fill_between(span, bound.low, bound.high, color="0.8", label="known interval")
    for index, method in enumerate(methods):
        spec = on_recording(choose_method(method), scenario)
        made = execute(
            spec.make(), spec.declaration, recording.vehicle, recording.observations, 0.0, False
        ).estimates[target]
        look = series_style(index)
        line(axes, time, factor * made[inside], spec.declaration.title, look, index / 5.0)
    axes.set_xlabel("time of the log [s]")
    axes.set_ylabel(_LABELS[target])
    axes.set_title(f"{name}, test window")
    axes.legend(loc="best", fontsize="small")
    return figure
