"""A study in, one HTML page with pictures out; nothing of it is fetched from elsewhere."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.publishing.board_tables import board_table
from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.publishing.figures.style import TRUTH, line, new_figure, series_style, style
from gripbench.bench.publishing.tables import html as table_html
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

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; margin: 0 auto; max-width: 60rem; padding: 1rem; }
table { border-collapse: collapse; display: block; overflow-x: auto; }
th, td { padding: .2rem .6rem; text-align: left; border-bottom: 1px solid #8886; }
td.number, th.number { text-align: right; } td.best { font-weight: 700; }
pre { overflow-x: auto; font-size: .85rem; } img { max-width: 100%; background: #fff; }
:root { color-scheme: light dark; }
"""


def board_of(study: Study) -> Board:
    """Return the board of all methods and baselines on the test windows."""
    (board,) = boards(frame_of(study.rows), study.target, "any")
    return board


def write_study(study: Study, board: Board, path: Path) -> None:
    """Write the page of a study."""
    said = study.imported.provenance
    parts = [
        f"<h1>{html.escape(said.name)}</h1>",
        f"<p>{html.escape(said.description)}</p>" if said.description else "",
        f"<p>{html.escape(windows_text(study.imported.recordings))}.</p>",
        "<h2>Which method</h2>",
        f"<p>{html.escape(words(board))}</p>",
        table_html(board_table(board)),
        "<h2>Estimates and reference</h2>",
        *_pictures(study, board),
        "<h2>What was undetermined</h2>",
        _list(study.undetermined) or "<p>Nothing.</p>",
        "<h2>Quality of the log</h2>",
        f"<pre>{html.escape(study.imported.report.text())}</pre>",
        "<h2>Identified on the training windows</h2>",
        _found(study),
        "<h2>Tuned on the training windows</h2>",
        _tuned(study),
        "<h2>Methods that did not run, and what would make them run</h2>",
        _list(f"{name}: {reason}" for name, reason in study.left_out.items()) or "<p>None.</p>",
    ]
    body = "\n".join(part for part in parts if part)
    page = (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(said.name)}: study</title><style>{_STYLE}</style></head>"
        f"<body>\n{body}\n</body></html>\n"
    )
    write_atomically(path, page)


def _list(sentences: Iterable[str]) -> str:
    items = "".join(f"<li>{html.escape(one)}</li>" for one in sentences)
    return f"<ul>{items}</ul>" if items else ""


def _found(study: Study) -> str:
    if study.found is None:
        return "<p>Nothing.</p>"
    found = study.found
    table = Table(
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
    return table_html(table)


def _tuned(study: Study) -> str:
    factor = signal(study.target).display_factor
    table = Table(
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
    return table_html(table) if study.tuned else "<p>No method.</p>"


def _pictures(study: Study, board: Board) -> list[str]:
    """Return a picture of each run's test time: the reference and the best estimates."""
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
        data = base64.b64encode(stream.getvalue()).decode()
        found.append(
            f'<img alt="{html.escape(study.target)} on the test windows" '
            f'src="data:image/png;base64,{data}">'
        )
    return found
