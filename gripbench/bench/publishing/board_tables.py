"""Boards of a ranking as tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from gripbench.bench.publishing import bound_columns as of_bound
from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.publishing.consistency_table import uncertainty_columns, uncertainty_note
from gripbench.bench.publishing.initials import initial, instruments_of
from gripbench.bench.publishing.timings import RelativeRuntime
from gripbench.bench.ranking.marks import (
    FOOTNOTE,
    MARKED_BY,
    OUTSIDE_FOOTNOTE,
    PREFIX_FOOTNOTE,
    marked,
    training_note,
)
from gripbench.bench.ranking.plans import plan_of
from gripbench.bench.ranking.ranking import Board
from gripbench.bench.ranking.resolution import resolution
from gripbench.bench.ranking.skill import NO_BETTER
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
        With everything that is known, for files and wide screens: intervals in columns of their
        own, every metric that has a value, quantiles of the step and deadlines. Otherwise at most
        nine columns.
    """
    narrow = _narrow if board.by == "rms" else uncertainty_columns
    columns = _wide(board, timings is not None) if wide else narrow(board)
    rows = [
        _row(line, board.target, timings or {}, _decimals(board))
        for line in board.lines.to_dict("records")
    ]
    return Table(columns, tuple(rows), caption=board.title, notes=_notes(board, wide))


def _narrow(board: Board) -> tuple[Column, ...]:
    """Return the columns that a person needs: at most nine."""
    unit = signal(board.target).display_unit.replace("-", "")
    format_ = _decimals(board)
    columns = [
        Column("place", "Rank"),
        Column("name", "Method"),
        *((Column("initials", "Reads"),) if not board.sensors else ()),
        Column("score", "Score", format=".3g", best="lowest", tied="tied"),
        Column("rms", "RMS", unit, format_),
        Column("rmses_short", f"{100.0 * board.confidence:g} %"),
        *_mean_columns(board, unit, format_),
        *(
            (
                Column("skill", "Skill", format=".2f"),
                Column("percent_guess", "> guess"),
            )
            if board.guess
            else ()
        ),
        *of_bound.ratio_column(board),
        # on the board of all methods what each reads takes its place
        *((Column("percent_next", "> next"),) if board.sensors or not board.guess else ()),
    ]
    return tuple(columns)


def _mean_columns(board: Board, unit: str, format_: str) -> tuple[Column, ...]:
    """Return the mean estimate where the error is only the distance from a known interval."""
    known = board.lines["mean_estimate"].notna().any()
    return (Column("mean_estimate", "Mean", unit, format_),) if known else ()


def _wide(board: Board, relative: bool) -> tuple[Column, ...]:
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
        Column("elsewhere", f"Score in another scenario ({percent})"),
        Column("rms", "RMS", unit, ".4g"),
        Column("rmses", f"RMS ({percent})", unit),
        Column("uncertainty", "What it says of its error"),
        Column("nees_band", f"NEES of a consistent one ({percent})"),
        *of_bound.bound_columns(board, unit),
        Column("skill", "Skill", format=".3f"),
        Column("beats_guess", "Better than a guess in", "% of drives", ".0f"),
        Column("beats_next", "Better than the next in", "% of drives", ".0f"),
        Column("verdict", "Verdict"),
        Column("worse_than_guess", "Worse than a guess in"),
        *(
            column
            for metric in metrics().values()
            if metric.name != "rms" and board.lines[metric.name].notna().any()
            for column in _metric_columns(metric, board.target)
        ),
        *_runtime_columns(relative),
        *((Column("training", "Trained"),) if board.lines["training"].any() else ()),
        Column("failures", "Failed", format="d"),
    ]
    if board.lines["failures"].any():
        columns += [Column("reason", "Reason")]
    return tuple(columns)


def _notes(board: Board, wide: bool) -> tuple[str, ...]:
    """Return what stands below a board."""
    notes = [
        f"{_count(len(board.scenarios), 'scenario')}, "
        f"{_count(max(len(board.seeds), 1), 'common seed')}. A score that "
        "is marked may be the best; ranks in brackets hold together.",
        *([board.hiding] if board.hiding else []),
        *board.notes,
    ]
    if not wide and board.by == "crps":
        notes.append(uncertainty_note(board))
    elif not wide:
        if board.guess:
            notes.append(
                f"Skill: 1 - score / score of the best guess ({board.guess}); > guess, > next: "
                "share of drives with less error than that guess, than the line below."
            )
        useless = board.lines.loc[board.lines["verdict"] != "", "label"]
        if len(useless):
            notes.append(f"{NOT_BETTER} {NO_BETTER}.")
        failed = board.lines[board.lines["failures"] > 0]
        notes += [
            f"{line['label']}: {line['failures']} of {line['cells']} runs failed "
            f"({line['reason']})."
            for line in failed.to_dict("records")
        ]
        if not board.sensors:
            used = sorted(
                {name for reads in board.lines["reads"] for name in instruments_of(reads)}
            )
            notes.append("Reads: " + ", ".join(f"{initial(name)} {name}" for name in used) + ".")
    notes += of_bound.bound_notes(board, wide)
    if board.lines["baseline"].any():
        notes.append(f"{GUESS} baseline: a guess or a formula on paper.")
    if board.lines["idealised"].any():
        notes.append(FOOTNOTE + ".")
    if board.lines["computed_outside"].any():
        notes.append(OUTSIDE_FOOTNOTE + ".")
    for line in board.lines[board.lines["training"] != ""].to_dict("records"):
        notes.append(training_note(line["label"], line["training"], line["training_time"]) + ".")
    if board.lines["over_prefixes"].any():
        notes.append(PREFIX_FOOTNOTE + ".")
    return tuple(notes)


NOT_BETTER = "–"
"""Follows the name of a method whose skill is not positive."""

GUESS = "○"
"""Follows the name of a baseline."""


def one_table(boards: Sequence[Board], wide: bool = False) -> Table:
    """Return boards under each other in one table, each line with plan, target and sensors.

    Where boards show a column in different units, the target's unit is in a column of its own.
    """
    parts = [board_table(board, wide=wide) for board in boards]
    columns: dict[str, Column] = {}
    for part in parts:
        for column in part.columns:
            known = columns.setdefault(column.key, column)
            if known.unit != column.unit:
                columns[column.key] = replace(known, unit="")
    first = {
        key: Column(key, key.capitalize()) for key in ("plan", "target", "unit", "sensors", "drawn")
    }
    rows = [
        dict.fromkeys(columns)
        | dict(row)
        | {
            "plan": plan_of(board.scenarios[0]) if board.scenarios else "",
            "target": board.target,
            "unit": signal(board.target).display_unit,
            "sensors": ", ".join(board.sensors) or "any",
            "drawn": "from hidden seeds" if board.salt else "from public seeds",
        }
        for board, part in zip(boards, parts, strict=True)
        for row in part.rows
    ]
    kept = tuple(column for key, column in columns.items() if key not in first)
    return Table((*first.values(), *kept), tuple(rows))


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}" + ("s" if number != 1 else "")


def _runtime_columns(relative: bool) -> list[Column]:
    if relative:
        columns = [Column("relative", "Step", "reference kernels", ".3g", best="lowest")]
    else:
        columns = [Column("step", "Step", "ns", ".3g", best="lowest")]
    return [
        *columns,
        Column("p50", "Online p50", "µs", ".3g"),
        Column("p99", "p99", "µs", ".3g"),
        Column("worst", "max", "µs", ".3g"),
        Column("misses", "Deadlines missed", "%", ".2g"),
        Column("pareto", "Front"),
    ]


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


def _row(line: Mapping[Any, Any], target: str, timings: Timings, format_: str) -> dict[str, Any]:
    runtime = timings.get(line["label"], {}).get("batch")
    factor = signal(target).display_factor
    return {
        **line,
        **_metric_cells(line, target),
        "name": _name(line),
        "place": _place(line),
        "nees_band": _range(line["nees_low"], line["nees_high"], ".2f"),
        "percent_90": _percent(line["coverage_90"]),
        "initials": "".join(sorted(map(initial, instruments_of(line["reads"])))),
        "beats_guess": _times(line["beats_guess"], 100.0),
        "beats_next": _times(line["beats_next"], 100.0),
        "elsewhere": _range(line["elsewhere_from"], line["elsewhere_to"], ".3f"),
        "rmses_short": _range(factor * line["rms_from"], factor * line["rms_to"], format_),
        "percent_guess": _percent(line["beats_guess"]),
        "percent_next": _percent(line["beats_next"]),
        **of_bound.bound_cells(line, factor),
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


def _name(line: Mapping[Any, Any]) -> str:
    """Return a method's label with the marks that stand below the table."""
    marks = (GUESS if line["baseline"] else "") + (NOT_BETTER if line["verdict"] else "")
    marks += of_bound.below_mark(line)
    name = marked(line["label"], *(line[column] for column in MARKED_BY))
    return f"{name} {marks}" if marks else name


def _decimals(board: Board) -> str:
    """Return the format in which the smallest RMS of a board has three digits.

    No digit is shown that is beyond a tenth of what a reference instrument could tell.
    """
    factor = signal(board.target).display_factor
    values = factor * board.lines["rms"].to_numpy(float)
    values = values[np.isfinite(values) & (values > 0.0)]
    wanted = 2 - math.floor(math.log10(values.min())) if len(values) else 2
    finest = factor * resolution(board.target)
    most = math.ceil(-math.log10(finest)) + 1 if finest else 6
    return f".{max(0, min(wanted, most))}f"


def _percent(share: float) -> str | None:
    return None if pd.isna(share) else f"{100.0 * share:.0f} %"


def _place(line: Mapping[Any, Any]) -> str:
    """Return the rank with the ranks that it may have; what has no score there has none."""
    if line["by"] == "crps" and pd.isna(line["score"]):
        return "n/a"
    if line["rank_from"] == line["rank_to"]:
        return str(line["rank"])
    return f"{line['rank']} ({line['rank_from']}–{line['rank_to']})"


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
