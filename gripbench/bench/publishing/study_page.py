"""A study in, one HTML page with pictures out; nothing of it is fetched from elsewhere."""

from __future__ import annotations

import base64
import io
from pathlib import Path

import numpy as np

from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.publishing.board_tables import board_table
from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.publishing.figures.style import TRUTH, line, new_figure, series_style, style
from gripbench.bench.publishing.pages import template
from gripbench.bench.ranking.answers import words
from gripbench.bench.ranking.ranking import Board, boards
from gripbench.bench.running.execution import execute
from gripbench.bench.running.rows import frame_of
from gripbench.bench.running.study import Study
from gripbench.envs.signals import signal
from gripbench.logs.windows import windows_text
from gripbench.writing import write_atomically

_SHOWN = 3  # estimates in a picture
_POINTS = 2000


def board_of(study: Study) -> Board:
    """Return the board of all methods and baselines on the test windows."""
    (board,) = boards(frame_of(study.rows), study.target, "any")
    return board


def write_study(study: Study, board: Board, path: Path) -> None:
    """Write the page of a study."""
    content = template(Path(__file__).parent, "study.html").render(
        said=study.imported.provenance,
        windows=windows_text(study.imported.recordings),
        answer=words(board),
        board=board_table(board),
        target=study.target,
        pictures=_pictures(study, board),
        undetermined=study.undetermined,
        quality=study.imported.report.text(),
        found=_found(study),
        tuned=_tuned(study),
        left_out=study.left_out,
    )
    write_atomically(path, content)


def _found(study: Study) -> Table | None:
    if study.found is None:
        return None
    found = study.found
    return Table(
        (
            Column("name", "Parameter"),
            Column("value", "Value", format=".4g"),
            Column("deviation", "Standard deviation", format=".2g"),
        ),
        tuple(
            {"name": name, "value": value, "deviation": found.deviations[name]}
            for name, value in found.values.items()
        ),
        notes=("Stiffnesses are those of an axle over the mass [N/rad/kg].",),
    )


def _tuned(study: Study) -> Table:
    factor = signal(study.target).display_factor
    return Table(
        (
            Column("method", "Method"),
            Column("before", "RMS before", signal(study.target).display_unit, ".3g"),
            Column("after", "RMS after", signal(study.target).display_unit, ".3g"),
            Column("trials", "Trials"),
        ),
        tuple(
            {
                "method": one.method,
                "before": factor * one.before,
                "after": factor * one.after,
                "trials": one.draws,
            }
            for one in study.tuned
        ),
    )


def _pictures(study: Study, board: Board) -> list[str]:
    """Return a PNG of each run's test time in base64: the reference and the best estimates."""
    factor, unit = signal(study.target).display_factor, signal(study.target).display_unit
    best = [label for label in board.lines["label"] if isinstance(label, str)][:_SHOWN]
    files = {
        choose_method(str(path)).label: str(path)
        for path in sorted((study.folder / "variants").glob("*.toml"))
    }
    found = []
    for recording in study.imported.recordings:
        time, origin = recording.truth["time"], recording.notes.get("time_origin", 0.0)
        inside = np.zeros(len(time), dtype=bool)
        for start, end in recording.windows.get("test", ()):
            inside |= (time >= start) & (time <= end)
        at = np.flatnonzero(inside)[:: max(1, int(inside.sum()) // _POINTS)]
        if not len(at):
            continue
        with style():
            figure = new_figure(3.2, 9.0)
            axes = figure.subplots()
            if study.target in (recording.truth.dtype.names or ()):
                truth = factor * recording.truth[study.target][at]
                line(axes, origin + time[at], truth, "reference", TRUTH)
            for index, label in enumerate(best):
                spec = choose_method(files.get(label, label))
                estimates = execute(
                    spec.make(), spec.declaration, recording.vehicle, recording.observations,
                    0.0, False,
                ).estimates  # fmt: skip
                values = factor * estimates[study.target][at]
                line(axes, origin + time[at], values, label, series_style(index), index / 5.0)
            axes.set_xlabel("time of the log [s]")
            axes.set_ylabel(f"{study.target} [{unit}]")
            axes.legend(loc="best", fontsize="small")
            stream = io.BytesIO()
            figure.savefig(stream, dpi=110, format="png")
        found.append(base64.b64encode(stream.getvalue()).decode())
    return found
