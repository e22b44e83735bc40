"""Li, Du & Li (2014) run again: Tables IV and V, ours beside the paper's, cell by cell."""

from __future__ import annotations

from itertools import count
from math import exp, log
from typing import Any

import numpy as np

from gripbench.bench.papers.li2014 import tables as paper_tables
from gripbench.bench.papers.li2014.tables import MethodColumn, Outcome, PaperTables
from gripbench.bench.papers.reproduction import Progress, Reproduction
from gripbench.bench.publishing.columns import Column, Table
from gripbench.envs.signals import signal
from gripbench.envs.worlds import load_scenario

NAME = "li2014"

ALIKE = 1.15
"""Ratios of one method that lie within this factor of their mean share a factor."""

APART = 1.25
"""A shared factor nearer to 1 than this is not worth a word."""


def load() -> PaperTables:
    """Return the paper's file."""
    return paper_tables.load_paper_tables(NAME)


def reproduce(progress: Progress | None = None) -> Reproduction:
    """Return Tables IV and V with our cells, and how well the order of the methods agrees."""
    paper = load()
    total, done = paper_tables.recordings_of(paper), count(1)

    def advance() -> None:
        if progress is not None:
            progress(next(done), total)

    outcome = paper_tables.reproduce(paper, advance)
    tables = {
        f"table_{table.label.lower()}": _beside(outcome, table.label) for table in paper.tables
    }
    rows = {row.scenario: load_scenario(row.scenario) for row in paper.scenarios}
    settings = {
        f"{column.title} in {name}": paper_tables.method_of(column, name).settings
        for column in paper.methods
        for name in rows
        if name == paper.scenarios[0].scenario or name in column.exceptions
    }
    return Reproduction(
        tables | {"order": _agreement(outcome)},
        paper_tables.summary_lines(outcome) + shared_factors(outcome),
        paper_tables.changed_cells(outcome),
        {"paper": paper.model_dump(mode="json"), "methods": settings}
        | {name: scenario.model_dump(mode="json") for name, scenario in rows.items()},
        {row.scenario: list(range(row.seeds)) for row in paper.scenarios},
    )


def shared_factors(outcome: Outcome) -> list[str]:
    """Return a line for each method and table where three or more ratios share a factor.

    A criterion of a factor of 2 hides an error that all rows have in common: the line says where
    ratios of ours over the published value lie within `ALIKE` of their geometric mean while that
    mean is off by more than `APART`.
    """
    lines = []
    for table in outcome.paper.tables:
        for column in outcome.paper.methods:
            cells = [c for c in outcome.of_table(table.label) if c.method == column.title]
            alike = _largest_group([cell.ratio for cell in cells])
            mean = exp(float(np.mean(np.log(alike)))) if alike else 1.0
            if abs(log(mean)) > log(APART):
                ratios = ", ".join(f"{ratio:.2f}" for ratio in alike)
                lines.append(
                    f"Table {table.label}, {column.title}: {len(alike)} of {len(cells)} ratios "
                    f"share a factor of {mean:.2f} ({ratios})."
                )
    return lines


def _largest_group(ratios: list[float]) -> list[float]:
    """Return the most ratios, three at least, that lie within `ALIKE` of their geometric mean."""
    ordered = sorted(ratios)
    for size in range(len(ordered), 2, -1):
        for first in range(len(ordered) - size + 1):
            group = ordered[first : first + size]
            mean = float(np.mean(np.log(group)))
            if max(abs(log(ratio) - mean) for ratio in group) <= log(ALIKE):
                return group
    return []


def _beside(outcome: Outcome, label: str) -> Table:
    """Return a table with one row a cell: ours, published, ratio, verdict."""
    paper = outcome.paper
    table = next(t for t in paper.tables if t.label == label)
    titles = {row.scenario: row.title for row in paper.scenarios}
    digits = ".2f" if table.unit == "N" else ".4f"
    marks = {c.title: " †" if _idealised(paper, c) else "" for c in paper.methods}
    unit = "" if table.unit == "-" else table.unit
    return Table(
        columns=(
            Column("scenario", "Scenario"),
            Column("method", "Method"),
            Column("ours", "Ours", unit, digits, best="lowest"),
            Column("published", "Published", unit, digits, best="lowest"),
            Column("ratio", "Ratio", "", ".2f"),
            Column("verdict", "Verdict"),
        ),
        rows=tuple(
            {
                "scenario": titles[cell.scenario],
                "method": cell.method + marks[cell.method],
                "ours": cell.ours,
                "published": cell.published,
                "ratio": cell.ratio,
                "verdict": "match" if cell.matches else "mismatch",
            }
            for cell in outcome.of_table(label)
        ),
        caption=f"Table {label}. {table.title}, ours beside the paper's",
        notes=tuple(
            f"† {column.title} reads {', '.join(_idealised(paper, column))}: idealised, "
            "no sensor in a vehicle gives it."
            for column in paper.methods
            if _idealised(paper, column)
        ),
        group_by="scenario",
    )


def _agreement(outcome: Outcome) -> Table:
    paper = outcome.paper
    rows = []
    for row in paper.scenarios:
        entry: dict[str, Any] = {"scenario": row.title}
        for table in paper.tables:
            entry[table.label] = outcome.order_agreement(table.label, row.scenario)
        rows.append(entry)
    columns = [Column(t.label, f"Table {t.label}", "", ".1f") for t in paper.tables]
    return Table(
        columns=(Column("scenario", "Scenario"), *columns),
        rows=tuple(rows),
        caption="Kendall's tau between our order of the methods and the paper's",
    )


def _idealised(paper: PaperTables, column: MethodColumn) -> tuple[str, ...]:
    method = paper_tables.method_of(column, paper.scenarios[0].scenario)
    return tuple(name for name in method.sensors if signal(name).idealised)
