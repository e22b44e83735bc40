"""Boards of a ranking as tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from gripbench.bench.publishing.tables import Column, Table
from gripbench.bench.publishing.timings import RelativeRuntime
from gripbench.bench.ranking.ranking import Board
from gripbench.bench.ranking.summary import FOOTNOTE, marked
from gripbench.bench.scoring.metric import SIGNAL_UNIT, Metric
from gripbench.bench.scoring.metrics import metrics
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
        With every metric that has a value, quantiles of the step and deadlines.
    """
    unit = signal(board.target).display_unit.replace("-", "")
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
            column
            for metric in metrics().values()
            if metric.name != "rms" and board.lines[metric.name].notna().any()
            for column in _metric_columns(metric, board.target)
        ]
    columns += _runtime_columns(timings is not None, wide)
    columns += [Column("failures", "Failed", format="d")]
    if board.lines["failures"].any():
        columns += [Column("reason", "Reason")]
    rows = [_row(line, board.target, timings or {}) for line in board.lines.to_dict("records")]
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


def _metric_columns(metric: Metric, target: str) -> list[Column]:
    """Return the columns of a metric: its value, and the share of runs that reach it."""
    unit = shown_in(metric, target)[1].replace("-", "")
    if metric.pooling != "median":
        return [Column(metric.name, metric.title, unit, metric.format)]
    share = f"{metric.title}: reached in"
    reached = [Column(metric.reached, share, "% of runs", ".0f")] if metric.reached else []
    return [Column(metric.name, metric.title, unit), *reached]


def shown_in(metric: Metric, target: str) -> tuple[float, str]:
    """Return factor and unit in which people see a metric of a target."""
    shown = signal(target)
    own = metric.unit == SIGNAL_UNIT
    return (shown.display_factor, shown.display_unit) if own else (1.0, metric.unit)


def _row(line: Mapping[Any, Any], target: str, timings: Timings) -> dict[str, Any]:
    runtime = timings.get(line["label"], {}).get("batch")
    factor = signal(target).display_factor
    return {
        **line,
        **_metric_cells(line, target),
        "name": marked(line["label"], line["idealised"]),
        "ranks": _range(line["rank_from"], line["rank_to"], "d"),
        "scores": _range(line["score_from"], line["score_to"], ".3f"),
        "rms": _times(line["rms"], factor),
        "rmses": _range(factor * line["rms_from"], factor * line["rms_to"], ".4g"),
        "tied": line["rank_from"] == 1 and line["failures"] == 0,
        "relative": runtime.relative if runtime else None,
        "step": _times(line["step_batch"], 1e9),
        "p50": _times(line["step_p50"], 1e6),
        "p99": _times(line["step_p99"], 1e6),
        "worst": _times(line["step_max"], 1e6),
        "misses": _times(line["deadline_misses"], 100.0),
        "pareto": "yes" if line["pareto"] else "",
    }


def _metric_cells(line: Mapping[Any, Any], target: str) -> dict[str, Any]:
    """Return the cells of every metric but the RMS, in the unit that people see."""
    cells: dict[str, Any] = {}
    for metric in metrics().values():
        if metric.name == "rms":
            continue
        value = _times(line[metric.name], shown_in(metric, target)[0])
        if metric.pooling == "median":
            cells[metric.name] = _reached(value, metric.format)
        else:
            cells[metric.name] = value
        if metric.reached:
            cells[metric.reached] = _times(line[metric.reached], 100.0)
    return cells


def _range(low: float, high: float, format_spec: str) -> str | None:
    if pd.isna(low) or pd.isna(high):
        return None
    return f"{low:{format_spec}}–{high:{format_spec}}"


def _reached(value: float | None, format_spec: str) -> str | None:
    if value is None or pd.isna(value):
        return None
    return "never" if value == float("inf") else f"{value:{format_spec}}"


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor
