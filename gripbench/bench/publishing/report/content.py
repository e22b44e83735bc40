"""What the report shows, collected from stored rows and from what `reproduce` wrote."""

from __future__ import annotations

import csv
import datetime
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from gripbench.bench.bounds.stored import Stored
from gripbench.bench.catalogue.suites import load_suite, suite_files
from gripbench.bench.papers.claims import paper_files
from gripbench.bench.publishing.board_tables import board_table
from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.publishing.figures.style import axis_scale
from gripbench.bench.publishing.presentation import significant
from gripbench.bench.ranking.against_bound import least_by_scenario
from gripbench.bench.ranking.answers import words
from gripbench.bench.ranking.grids import opening
from gripbench.bench.ranking.marks import MARKED_BY, marked
from gripbench.bench.ranking.plans import plan_of, road_of, standing_of
from gripbench.bench.ranking.ranking import Board, boards
from gripbench.bench.ranking.resolution import resolution
from gripbench.bench.ranking.statistics import performance_profile
from gripbench.bench.ranking.summary import failures, summary
from gripbench.envs.instruments.faults import split_faults
from gripbench.envs.signals import signal
from gripbench.errors import InputError


@dataclass(frozen=True)
class PaperTable:
    """A table of published figures beside ours.

    Attributes
    ----------
    title
        What it compares.
    table
        The table; its column `Verdict` says what became of each figure.
    """

    title: str
    table: Table


@dataclass(frozen=True)
class PaperResult:
    """What `gripbench reproduce` wrote for a paper.

    Attributes
    ----------
    name
        Name of the paper.
    tables
        Its tables.
    remarks
        Sentences on what matches and what does not.
    """

    name: str
    tables: tuple[PaperTable, ...]
    remarks: tuple[str, ...]


def chosen_targets(rows: pd.DataFrame, suites: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the targets to report: those of the suites that name a scenario of the rows.

    Without such a suite it is every target that two methods or more estimate, or else every one.
    """
    present = [str(name) for name in rows["target"].unique() if name]
    scenarios = {split_faults(name)[0] for name in rows["scenario"].unique()}
    wanted: dict[str, None] = {}
    for name in suites or suite_files():
        suite = load_suite(name)
        if suites or scenarios & set(suite.names()):
            wanted.update(dict.fromkeys(suite.targets))
    targets = [name for name in wanted if name in present]
    if targets:
        return tuple(targets)
    ran = rows[rows["status"] != "skipped"]
    shared = [name for name in present if ran[ran["target"] == name]["label"].nunique() > 1]
    return tuple(shared or present)


def rows_of_suites(rows: pd.DataFrame, suites: Sequence[str]) -> pd.DataFrame:
    """Return the rows whose scenario and method belong to one of the suites; all if none is given.

    Raises
    ------
    InputError
        If there is no such suite, or nothing of it was run.
    """
    if not suites:
        return rows
    keep = pd.Series(False, index=rows.index)
    clean = rows["scenario"].map(lambda name: split_faults(name)[0])
    for name in suites:
        suite = load_suite(name)
        labels = {spec.label for spec in suite.specs()}
        part = clean.isin(suite.names()) & rows["label"].isin(labels)
        if not part.any():
            raise InputError(
                f"no stored row of suite '{name}': gripbench run --suite {name} makes them"
            )
        keep |= part
    return rows[keep]


def found_boards(
    rows: pd.DataFrame, targets: Sequence[str], bounds: Stored | None = None
) -> list[Board]:
    """Return for each target the board of all methods and one for each set of instruments.

    Boards of level 1 stand first and open with a production car's sensors; those
    of the papers' setting stand last.
    """
    found: list[Board] = []
    for target in targets:
        if (rows.loc[rows["target"] == target, "status"] == "skipped").all():
            continue
        found += boards(rows, target, "any", bounds=bounds)
        found += boards(rows, target, bounds=bounds)
    found.sort(key=lambda board: (standing_of(board), opening(board.sensors) > 0))
    return found


def boards_by_road(rows: pd.DataFrame, targets: Sequence[str]) -> list[tuple[str, Board]]:
    """Return the boards of each kind of road alone, where a plan has several kinds."""
    roads: dict[str, dict[str, list[str]]] = {}
    for name in rows["scenario"].unique():
        roads.setdefault(plan_of(name), {}).setdefault(road_of(name), []).append(name)
    of_road: dict[str, list[str]] = {}
    for kinds in roads.values():
        for road, names in kinds.items() if len(kinds) > 1 else ():
            of_road.setdefault(road, []).extend(names)
    return [
        (road, board)
        for road, names in of_road.items()
        for board in found_boards(rows[rows["scenario"].isin(names)], targets)
    ]


def heat_map(rows: pd.DataFrame, target: str, bounds: Stored | None = None) -> dict[str, Any]:
    """Return the RMS of every method in every scenario, and its ratio to the scenario's best.

    On top stands the least that all sensors together allow, where that is known.

    The best is sought among the methods that read no idealised channel and were run here.
    """
    lines = summary(rows[rows["target"] == target])
    scenarios = list(dict.fromkeys(lines["scenario"]))
    labels = list(dict.fromkeys(lines["label"]))
    cells = {(line["label"], line["scenario"]): line for _, line in lines.iterrows()}
    real = lines[(lines["idealised"] == "") & ~lines["computed_outside"].astype(bool)]
    best = (lines if real.empty else real).groupby("scenario")["rms"].min()
    marks = {
        line["label"]: tuple(line[column] for column in MARKED_BY) for _, line in lines.iterrows()
    }
    factor = axis_scale(target)[0]
    ratio: list[list[float | None]] = []
    text: list[list[str]] = []
    for label in labels:
        ratio.append([])
        text.append([])
        for scenario in scenarios:
            line = cells.get((label, scenario))
            known = line is not None and math.isfinite(line["rms"])
            shown = "" if line is None else _words(str(line["status"]))
            if known and line is not None:
                shown = significant(factor * line["rms"]) + ("*" if line["status"] else "")
                ratio[-1].append(_ratio(line["rms"], best.get(scenario, math.nan)))
            else:
                ratio[-1].append(None)
            text[-1].append(shown)
    least = least_by_scenario(bounds or {}, target, rows)
    top = [LEAST] if least else []
    if least:
        bounded = [least.get(name, math.nan) for name in scenarios]
        pairs = zip(scenarios, bounded, strict=True)
        ratio.insert(0, [_ratio(one, best.get(name, math.nan)) if one > 0.0 else None
                         for name, one in pairs])  # fmt: skip
        text.insert(0, ["–" if math.isnan(one) else significant(factor * one) for one in bounded])
    return {
        "scenarios": scenarios,
        "roads": [road_of(name) for name in scenarios],
        "methods": [*top, *(marked(label, *marks[label]) for label in labels)],
        "ratio": ratio,
        "text": text,
    }


LEAST = "bound (all sensors)"
"""Row of a heat map with the least error that all sensors together allow."""


def _words(status: str) -> str:
    """Return what stands in a cell without a result: the worst of its statuses."""
    found = {part.split()[-1] for part in status.split(", ") if part}
    return "–" if found == {"skipped"} else ", ".join(sorted(found - {"skipped"}))


def _ratio(value: float, best: float) -> float | None:
    return value / best if best > 0.0 else None


def front(board: Board) -> list[dict[str, Any]]:
    """Return score and runtime of the methods of a board that have both."""
    return [
        {
            "label": line["label"],
            "score": float(line["score"]),
            "step": 1e9 * float(line["step_batch"]),
            "front": bool(line["pareto"]),
            "reads": line["reads"],
        }
        for line in board.lines.to_dict("records")
        if pd.notna(line["score"]) and pd.notna(line["step_batch"])
    ]


def profile(board: Board) -> dict[str, Any]:
    """Return the performance profile of a board: factors to the best, shares by method."""
    factors = np.geomspace(1.0, 30.0, 60)
    runs = board.runs.clip(lower=resolution(board.target))
    shares = performance_profile(runs.to_numpy(float), factors)
    return {
        "factors": [float(value) for value in factors],
        "methods": {
            str(label): [float(value) for value in shares[:, i]]
            for i, label in enumerate(runs.columns)
        },
    }


def failure_table(rows: pd.DataFrame) -> Table:
    """Return what did not end well, with its reason."""
    columns = (
        Column("status", "Status"),
        Column("scenario", "Scenario"),
        Column("label", "Method"),
        Column("runs", "Runs", format="d"),
        Column("first_seed", "First seed", format="d"),
        Column("reason", "Reason"),
    )
    return Table.from_frame(failures(rows), columns)


def shown_board(board: Board) -> tuple[str, Table, Table]:
    """Return a board as the report shows it: in words, what a person needs, everything."""
    return words(board), board_table(board), board_table(board, wide=True)


def target_words(target: str) -> dict[str, Any]:
    """Return what the page says of a target: description, unit of plots, a whole turn in it."""
    unit = axis_scale(target)[1]
    item = signal(target)
    turn = 2.0 * math.pi * item.display_factor if item.angle else 0.0
    return {"description": item.description, "unit": "" if unit == "-" else unit, "turn": turn}


def paper_results(results: Path) -> list[PaperResult]:
    """Return the papers whose reproduction lies in the results folder."""
    found = []
    for name in paper_files():
        directory = results / name
        tables = tuple(
            PaperTable(path.stem.replace("_", " ").capitalize(), _read_table(path))
            for path in sorted(directory.glob("*.csv"))
        )
        if tables:
            found.append(PaperResult(name, tables, _remarks(directory / "README.md")))
    return found


def _read_table(path: Path) -> Table:
    """Return a table that `tables.csv` wrote; numbers at four digits."""
    with path.open(encoding="utf-8", newline="") as file:
        headings, *lines = csv.reader(file)
    columns = tuple(Column(heading, heading, format=".4g") for heading in headings)
    rows = tuple(
        {heading: _value(text) for heading, text in zip(headings, line, strict=True)}
        for line in lines
    )
    return Table(columns, rows)


def _value(text: str) -> float | str | None:
    if not text:
        return None
    try:
        return float(text)
    except ValueError:
        return text


def _remarks(path: Path) -> tuple[str, ...]:
    if not path.is_file():
        return ()
    lines = path.read_text(encoding="utf-8").splitlines()
    return tuple(line.removeprefix("- ") for line in lines if line.startswith("- "))


def manifests(results: Path) -> dict[str, Any]:
    """Return every manifest below the results folder, by its folder's name."""
    found = {}
    for path in sorted(results.glob("**/manifest.json")):
        try:
            found[path.parent.name] = json.loads(path.read_text(encoding="utf-8"))
        except ValueError:
            raise InputError(
                f"{path}: not valid JSON; run the command that wrote it again"
            ) from None
    return found


def today() -> str:
    """Return the date in UTC."""
    return datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
