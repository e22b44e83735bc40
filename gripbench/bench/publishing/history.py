"""The leaderboard's history: one line a commit and method, and a picture of it.

The file is JSON lines, so that a version control system can merge it line by line. Adding a
commit again replaces its lines.
"""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
from pydantic import Field

from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.publishing.figures.style import series_style
from gripbench.bench.publishing.leaderboard import Leaderboard, Runs
from gripbench.bench.scoring.metric import pooled_rms
from gripbench.configuration import Configuration, parse
from gripbench.envs.signals import signal
from gripbench.errors import InputError
from gripbench.writing import write_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FILE = Path("history", "leaderboard.jsonl")
"""The history's file below the results folder."""


class Commit(Configuration):
    """State of the sources.

    Attributes
    ----------
    name
        Hash of the commit.
    time
        When it was made, ISO 8601.
    modified
        Whether tracked files differ from it.
    """

    name: str
    time: str
    modified: bool = False


class TargetHistory(Configuration):
    """How a method did for one target.

    Attributes
    ----------
    geometric_rms
        Geometric mean over the scenarios of the RMS pooled over the runs, in the target's unit.
    rms, rms_from, rms_to
        RMS pooled over all scenarios and runs, with its interval; None where a run failed.
    rank, rank_from, rank_to, methods
        Rank on the board of exactly the instruments that it reads, and number of methods there.
    failures
        Runs that failed.
    """

    geometric_rms: float | None = None
    rms: float | None = None
    rms_from: float | None = None
    rms_to: float | None = None
    rank: int
    rank_from: int
    rank_to: int
    methods: int
    failures: int


class HistoryRow(Configuration):
    """One method at one commit."""

    commit: str
    time: str
    modified: bool = False
    gripbench: str
    label: str
    relative_runtime: float | None = None
    targets: dict[str, TargetHistory] = Field(default_factory=dict)


def current_commit(folder: Path) -> Commit:
    """Return the commit of the working tree that a folder is in.

    Raises
    ------
    InputError
        If it is in none or git is not installed.
    """
    try:
        name, time = _git(folder, "show", "--no-patch", "--format=%H%n%cI", "HEAD").split()
        modified = bool(_git(folder, "status", "--porcelain", "--untracked-files=no").strip())
    except (OSError, subprocess.CalledProcessError, ValueError):
        raise InputError(
            f"{folder}: not in a git working tree with a commit; give --commit and --time"
        ) from None
    return Commit(name=name, time=time, modified=modified)


def _git(folder: Path, *arguments: str) -> str:
    return subprocess.run(
        ["git", "-C", str(folder), *arguments], check=True, capture_output=True, text=True
    ).stdout


def history_of(leaderboard: Leaderboard, commit: Commit) -> list[HistoryRow]:
    """Return the lines that a leaderboard adds to the history, one a method.

    Raises
    ------
    InputError
        If the commit's time is not ISO 8601.
    """
    try:
        datetime.fromisoformat(commit.time)
    except ValueError:
        raise InputError(f"time '{commit.time}' is not ISO 8601, as 2026-01-31T12:00:00") from None
    found: dict[str, dict[str, TargetHistory]] = {}
    for board in leaderboard.boards:
        for line in board["methods"]:
            if line["reads"] == line["sensors"]:
                found.setdefault(line["label"], {})[line["target"]] = TargetHistory(
                    geometric_rms=_geometric_rms(leaderboard, line["label"], line["target"])
                    if not line["failures"]
                    else None,
                    methods=len(board["methods"]),
                    **{
                        name: line[name]
                        for name in TargetHistory.model_fields
                        if name not in ("geometric_rms", "methods")
                    },
                )
    rows = []
    for label, targets in sorted(found.items()):
        runtime = leaderboard.runtimes.get(label, {}).get("batch")
        rows.append(
            HistoryRow(
                commit=commit.name,
                time=commit.time,
                modified=commit.modified,
                gripbench=leaderboard.gripbench,
                label=label,
                relative_runtime=runtime.relative if runtime else None,
                targets=dict(sorted(targets.items())),
            )
        )
    return rows


def _geometric_rms(leaderboard: Leaderboard, label: str, target: str) -> float | None:
    def chosen(runs: Runs) -> bool:
        return runs.label == label and runs.target == target and bool(runs.seeds)

    values = [
        pooled_rms(runs.sums_of_squares, runs.counts) for runs in filter(chosen, leaderboard.runs)
    ]
    if not values or min(values) <= 0.0:
        return 0.0 if values else None
    return math.exp(math.fsum(map(math.log, values)) / len(values))


def add(path: Path, rows: Iterable[HistoryRow]) -> int:
    """Add lines to a history and return how many it then has; a commit's earlier lines go.

    Raises
    ------
    InputError
        If the file has a damaged line or cannot be written.
    """
    new = list(rows)
    replaced = {row.commit for row in new}
    lines = [row for row in read_rows(path) if row.commit not in replaced] + new
    write_atomically(path, "".join(row.model_dump_json() + "\n" for row in lines))
    return len(lines)


def read_rows(path: Path) -> list[HistoryRow]:
    """Return the lines of a history, none where there is no file.

    Raises
    ------
    InputError
        If a line is damaged; it is named by its number.
    """
    if not path.exists():
        return []
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as text ({error})") from None
    rows = []
    for number, line in enumerate(lines, 1):
        try:
            content: Any = json.loads(line)
        except ValueError:
            raise InputError(f"{path}, line {number}: not valid JSON; remove the line") from None
        if not isinstance(content, dict):
            raise InputError(f"{path}, line {number}: not a line of the history; remove it")
        rows.append(parse(HistoryRow, content, f"{path}, line {number}"))
    return rows


def frame_of(rows: Iterable[HistoryRow]) -> pd.DataFrame:
    """Return a history as a frame, one line a commit, method and target, in order of time."""
    lines = [
        {
            **row.model_dump(exclude={"targets"}),
            "target": target,
            **scores.model_dump(),
        }
        for row in rows
        for target, scores in row.targets.items()
    ]
    columns = [
        *(name for name in HistoryRow.model_fields if name != "targets"),
        "target",
        *TargetHistory.model_fields,
    ]
    frame = pd.DataFrame(lines, columns=columns)
    order = pd.to_datetime(frame["time"], utc=True, format="ISO8601")
    return (
        frame.assign(order=order)
        .sort_values(["order", "target", "label"], kind="stable", ignore_index=True)
        .drop(columns="order")
    )


def table_of(frame: pd.DataFrame) -> Table:
    """Return a history as a table, the oldest commit first."""
    columns = (
        Column("commit", "Commit"),
        Column("time", "Time"),
        Column("target", "Target"),
        Column("label", "Method"),
        Column("ranks", "Rank"),
        Column("geometric_rms", "RMS (geometric mean)", format=".4g"),
        Column("rms", "RMS (pooled)", format=".4g"),
        Column("unit", "Unit"),
        Column("relative_runtime", "Step", "reference kernels", ".3g"),
        Column("failures", "Failed", format="d"),
    )
    signals = [signal(target) for target in frame["target"]]
    factors = [one.display_factor for one in signals]
    shown = frame.assign(
        geometric_rms=frame["geometric_rms"] * factors,
        rms=frame["rms"] * factors,
        unit=[one.display_unit for one in signals],
        commit=[
            name[:8] + ("+" if modified else "")
            for name, modified in zip(frame["commit"], frame["modified"], strict=True)
        ],
        ranks=[
            f"{rank} ({low}–{high}) of {methods}"
            for rank, low, high, methods in zip(
                frame["rank"], frame["rank_from"], frame["rank_to"], frame["methods"], strict=True
            )
        ],
    )
    note = "+: tracked files differed from the commit." if frame["modified"].any() else ""
    return Table.from_frame(shown, columns, notes=[note] if note else [])


def plot(frame: pd.DataFrame) -> Figure:
    """Return a picture of a history: RMS of each target, and relative runtime, by commit.

    Parameters
    ----------
    frame
        As `frame_of` returns it.

    Raises
    ------
    InputError
        If the history is empty.
    """
    from matplotlib.figure import Figure  # without pyplot: no window, no global state

    if frame.empty:
        raise InputError("the history is empty; 'gripbench history add' adds to it")
    targets = list(dict.fromkeys(sorted(frame["target"])))
    timed = frame["relative_runtime"].notna().any()
    panels = len(targets) + int(timed)
    places = {name: place for place, name in enumerate(dict.fromkeys(frame["commit"]))}
    labels = sorted(frame["label"].unique())
    figure = Figure(figsize=(8.0, 0.8 + 2.4 * panels), layout="constrained")
    axes = figure.subplots(panels, 1, squeeze=False, sharex=True)[:, 0]
    for axis, target in zip(axes, targets, strict=False):
        unit, factor = signal(target).display_unit, signal(target).display_factor
        title = f"RMS of {target}" + (f" [{unit}]" if unit != "-" else "")
        part = frame[frame["target"] == target]
        _lines(axis, part, "geometric_rms", places, labels, title, factor)
    if timed:
        once = frame.drop_duplicates(["commit", "label"])
        _lines(axes[-1], once, "relative_runtime", places, labels, "step [reference kernels]")
    axes[-1].set_xticks(range(len(places)), [name[:8] for name in places], rotation=45)
    axes[-1].set_xlabel("commit")
    handles, texts = axes[0].get_legend_handles_labels()
    figure.legend(handles, texts, loc="outside right upper", fontsize="small", frameon=False)
    return figure


def _lines(
    axis: Any,
    frame: pd.DataFrame,
    column: str,
    places: Mapping[str, int],
    labels: Sequence[str],
    title: str,
    factor: float = 1.0,
) -> None:
    """Draw one line a method; a method looks the same in every panel."""
    from matplotlib.ticker import LogFormatter

    for number, label in enumerate(labels):
        part = frame[(frame["label"] == label) & frame[column].notna()]
        look = series_style(number)
        axis.plot(
            [places[name] for name in part["commit"]],
            factor * part[column],
            label=label,
            color=look.color,
            linestyle=look.linestyle,
            marker=look.marker,
            markersize=4,
            linewidth=1,
        )
    axis.set_yscale("log")
    axis.yaxis.set_major_formatter(LogFormatter())
    axis.yaxis.set_minor_formatter(LogFormatter())
    axis.set_ylabel(title)
    axis.grid(alpha=0.3)
