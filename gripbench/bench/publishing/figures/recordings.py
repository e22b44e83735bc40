"""Pictures of real recordings: estimates beside the reference, trivial estimators beside both."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gripbench.bench.publishing.figures.style import TRUTH, line, new_figure, series_style, style
from gripbench.bench.running.execution import missing
from gripbench.bench.running.recorded import published_methods, scored_samples
from gripbench.bench.running.yardsticks import YARDSTICKS
from gripbench.envs.recordings import Recording
from gripbench.logs.published import load_recording
from gripbench.writing import being_written

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURES: dict[str, tuple[str, tuple[str, ...], int]] = {
    "comma2k19_example": ("yaw", ("kinematic_kalman_filter", "model_based_kalman_filter"), 0),
    "dart_rubber_floor_ramp": ("mu", ("velocity_friction_ekf",), 0),
    "dart_taped_tyres_tiles_ramp": ("mu", ("velocity_friction_ekf",), 0),
    "f1tenth_optitrack": ("sideslip", ("dugoff_ekf",), 7),
}
"""Target, methods and run of the picture of each published recording."""

_LABELS = {"yaw": "heading [deg]", "sideslip": "sideslip [deg]", "mu": "friction [-]"}


def write_pictures(names: Sequence[str], directory: Path, folder: Path | None = None) -> list[Path]:
    """Write the picture of each recording as `recording_NAME.png`.

    Parameters
    ----------
    names
        Published recordings.
    directory
        Where the pictures go.
    folder
        Where the recordings' files lie, see `gripbench.logs.locations`.
    """
    written = []
    for name in names:
        path = directory / f"recording_{name}.png"
        with style():
            figure = draw(name, folder)
            with being_written(path) as temporary:
                figure.savefig(temporary, dpi=150)
        written.append(path)
    return written


def draw(name: str, folder: Path | None = None) -> Figure:
    """Return the picture of a published recording; call it within `style`."""
    target, methods, run = PICTURES[name]
    imported = load_recording(name, folder)
    recording = next(one for one in imported.recordings if one.seed == run)
    inside = scored_samples(recording)
    time = recording.truth["time"][inside]
    angle = target in ("yaw", "sideslip")

    def shown(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> np.ndarray:
        return np.rad2deg(values[inside]) if angle else values[inside]

    figure = new_figure(3.2)
    axes = figure.subplots()
    if target in (recording.truth.dtype.names or ()):
        line(axes, time, shown(recording.truth[target]), "reference", TRUTH)
    for bound in (one for one in recording.bounds if one.signal == target):
        axes.fill_between(
            [bound.start, bound.end], bound.low, bound.high, color="0.8", label="known interval"
        )
    index = 0
    for spec in published_methods(imported, methods):
        if missing(spec.declaration, recording.vehicle, recording.observations.dtype.names or ()):
            continue
        estimates = spec.make().run(recording.vehicle, recording.observations)
        look = series_style(index)
        line(axes, time, shown(estimates[target]), spec.declaration.title, look, index / 5.0)
        index += 1
    for label, estimate in _yardsticks(recording, target).items():
        line(axes, time, shown(estimate), label, series_style(index), index / 5.0)
        index += 1
    axes.set_xlabel("time [s]")
    axes.set_ylabel(_LABELS[target])
    axes.set_title(f"{name}, test window")
    axes.legend(loc="best", fontsize="small")
    return figure


def _yardsticks(
    recording: Recording, target: str
) -> dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]]:
    """Return the first trivial estimator of the target, the one a reader would try first."""
    for name, estimate in YARDSTICKS[target].items():
        values = estimate(recording)
        if values is not None:
            return {name: values}
    return {}
