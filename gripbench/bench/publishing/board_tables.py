"""Boards of a ranking as tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from gripbench.bench.publishing.tables import Column, Table
from gripbench.bench.publishing.timings import RelativeRuntime
from gripbench.bench.ranking.ranking import Board
from gripbench.bench.ranking.summary import FOOTNOTE, marked
from gripbench.bench.running.rows import UTILISATION_BANDS
from gripbench.envs.signals import signal

Timings = Mapping[str, Mapping[str, RelativeRuntime]]
"""Relative runtimes by label and form, as `publishing.timings.read_timings` gives them."""


def board_table(board: Board, timings: Timings | None = None, wide: bool = False) -> Table:
    """Return a board as a table; marked is every method that may be the best one.

    Parameters
    ----------
    board
        The board.
    timings
        Relative runtimes; without them the step times stored with the rows are shown.
    wide
        With the scores beside RMS: peak, bias, convergence, RMS by utilisation, deadlines.
    """
    unit = signal(board.target).unit.replace("-", "")
    percent = f"{100.0 * board.confidence:g} %"
    columns = [
        Column("rank", "Rank", format="d"),
        Column("ranks", f"Ranks ({percent})"),
        Column("group", "Group"),
        Column("name", "Method"),
        *((Column("reads", "Reads"),) if not board.sensors else ()),
        Column("score", "Score", format=".3f", best="lowest", tied="tied"),
        Column("scores", f"Score ({percent})"),
        Column("rms", "RMS", unit, ".4g"),
        Column("rmses", f"RMS ({percent})", unit),
    ]
    if wide:
        columns += [
            Column("peak", "Peak", unit, ".4g"),
            Column("bias", "Bias", unit, "+.3g"),
            Column("convergence", "Convergence", "s"),
            Column("converged_share", "Converged", "% of runs", ".0f"),
            *(
                Column(f"rms_{band}", f"RMS {_band(low, high)}", unit, ".4g")
                for band, low, high in UTILISATION_BANDS
            ),
        ]
    columns += _runtime_columns(timings is not None, wide)
    columns += [Column("failures", "Failed", format="d")]
    if board.lines["failures"].any():
        columns += [Column("reason", "Reason")]
    rows = [_row(line, timings or {}) for line in board.lines.to_dict("records")]
    notes = [
        f"{len(board.scenarios)} scenarios, {max(len(board.seeds), 1)} common seeds. Methods that "
        "share a letter are not separable; a marked score may be the best.",
        *board.notes,
    ]
    if board.lines["idealised"].any():
        notes.append(FOOTNOTE + ".")
    return Table(tuple(columns), tuple(rows), caption=board.title, notes=tuple(notes))


def wins_table(board: Board) -> Table:
    """Return the runs that the method of each row wins against that of each column."""
    columns = [Column("name", "Wins against"), *(
        Column(label, label, format="g") for label in board.wins.columns
    )]  # fmt: skip
    rows = [
        {"name": label, **{str(other): value for other, value in line.items()}}
        for label, line in board.wins.iterrows()
    ]
    runs = int(board.lines["cells"].iloc[0])
    return Table(
        tuple(columns),
        tuple(rows),
        caption=f"{board.title}: wins in {runs} runs",
        notes=("Runs with the lower RMS, half for a draw; a failure loses.",),
    )


def _runtime_columns(relative: bool, wide: bool) -> list[Column]:
    if relative:
        columns = [Column("relative", "Step", "reference kernels", ".3g", best="lowest")]
    else:
        columns = [Column("step", "Step", "ns", ".3g", best="lowest")]
    if wide:
        columns += [
            Column("p50", "Online p50", "µs", ".3g"),
            Column("p99", "p99", "µs", ".3g"),
            Column("worst", "max", "µs", ".3g"),
            Column("misses", "Deadlines missed", "%", ".2g"),
            Column("pareto", "Front"),
        ]
    return columns


def _row(line: Mapping[Any, Any], timings: Timings) -> dict[str, Any]:
    runtime = timings.get(line["label"], {}).get("batch")
    return {
        **line,
        "name": marked(line["label"], line["idealised"]),
        "ranks": _range(line["rank_from"], line["rank_to"], "d"),
        "scores": _range(line["score_from"], line["score_to"], ".3f"),
        "rmses": _range(line["rms_from"], line["rms_to"], ".4g"),
        "tied": line["rank_from"] == 1 and line["failures"] == 0,
        "converged_share": _times(line["converged"], 100.0),
        "convergence": _convergence(line["convergence_time"]),
        "relative": runtime.relative if runtime else None,
        "step": _times(line["step_batch"], 1e9),
        "p50": _times(line["step_p50"], 1e6),
        "p99": _times(line["step_p99"], 1e6),
        "worst": _times(line["step_max"], 1e6),
        "misses": _times(line["deadline_misses"], 100.0),
        "pareto": "yes" if line["pareto"] else "",
    }


def _band(low: float, high: float) -> str:
    return f"at {low:g}–{high:g} of mu" if high < 10.0 else f"above {low:g} of mu"


def _range(low: float, high: float, format_spec: str) -> str | None:
    if pd.isna(low) or pd.isna(high):
        return None
    return f"{low:{format_spec}}–{high:{format_spec}}"


def _convergence(time: float) -> str | None:
    if pd.isna(time):
        return None
    return "never" if time == float("inf") else f"{time:.2f}"


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor
