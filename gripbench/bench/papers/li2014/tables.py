"""A paper's comparison tables: published cells, our cells, and what is expected of each.

The file of a paper in `configs/papers` holds its tables: rows are scenarios, columns methods. A
published cell *matches* when ours over it lies within `match_factor`. Beside each published value
stands the ratio that gripbench reached when the table was last published from here; a cell that
leaves `tolerance` around it has changed, which is an error whether or not it matches the paper.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import exp, log, sqrt
from pathlib import Path
from typing import Any, Literal, Protocol, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from gripbench.bench.catalogue.registry import built_in_methods
from gripbench.configuration import CONFIGS, Configuration, parse, read_toml
from gripbench.envs.recordings import Recording
from gripbench.envs.scenarios import Scenario
from gripbench.envs.worlds import load_scenario, record
from gripbench.methods.contract import CompiledMethod


class MethodColumn(Configuration):
    """A column: a method in the form that the paper used.

    Attributes
    ----------
    title
        Name that the paper's table gives it.
    method, variant
        Which method, with which settings.
    exceptions
        Variant by scenario where the paper treats one differently.
    """

    title: str
    method: str
    variant: str = "paper"
    exceptions: dict[str, str] = Field(default_factory=dict)


class ScenarioRow(Configuration):
    """A row: a scenario and how many seeds it takes (1 where nothing is random)."""

    scenario: str
    title: str
    seeds: int = Field(default=1, ge=1, le=10_000)


class PublishedTable(Configuration):
    """A table of RMS errors.

    Attributes
    ----------
    label, title
        As printed.
    target
        Signal whose error it gives.
    unit
        Unit of the values.
    values
        Published values, one list a scenario, one value a method.
    reached
        Ours over published when the table was last published from here, same layout.
    """

    label: str
    title: str
    target: str
    unit: str
    values: list[list[float]]
    reached: list[list[float]]


class PaperTables(Configuration):
    """The tables of one paper.

    Attributes
    ----------
    kind
        `tables`: the file of a paper whose results are tables of methods and scenarios.
    metric
        Definition of the values in words.
    match_factor
        A cell matches when ours/published lies between 1/match_factor and match_factor.
    tolerance
        How far a cell's ratio may move from `reached`, as a factor, before it counts as changed.
    """

    kind: Literal["tables"]
    name: str
    citation: str
    metric: str
    match_factor: float = Field(gt=1.0)
    tolerance: float = Field(gt=1.0)
    methods: list[MethodColumn]
    scenarios: list[ScenarioRow]
    tables: list[PublishedTable]

    @model_validator(mode="after")
    def _check_layout(self) -> Self:
        shape = (len(self.scenarios), len(self.methods))
        for table in self.tables:
            for key in ("values", "reached"):
                rows = getattr(table, key)
                if len(rows) != shape[0] or any(len(row) != shape[1] for row in rows):
                    raise ValueError(
                        f"table {table.label}: {key} must have {shape[0]} rows of {shape[1]}"
                    )
                if any(value <= 0.0 for row in rows for value in row):
                    raise ValueError(f"table {table.label}: {key} must be positive")
        return self


class RecordingMethod(Protocol):
    """What a reproduction needs of a method: a run over a whole recording."""

    def run(self, vehicle: dict[str, float], observations: npt.NDArray[Any], /) -> npt.NDArray[Any]:
        """Return the estimates, shape (n,)."""
        ...


@dataclass(frozen=True)
class Cell:
    """One cell: the paper's value, ours, and the two verdicts."""

    table: str
    scenario: str
    method: str
    published: float
    ours: float
    match_factor: float
    reached: float
    tolerance: float

    @property
    def ratio(self) -> float:
        """Ours over published."""
        return self.ours / self.published

    @property
    def matches(self) -> bool:
        """Whether ours lies within the match factor of the published value."""
        return abs(log(self.ratio)) <= log(self.match_factor)

    @property
    def changed(self) -> bool:
        """Whether the ratio has left the stored tolerance."""
        return not abs(log(self.ratio / self.reached)) <= log(self.tolerance)


@dataclass(frozen=True)
class Outcome:
    """What a reproduction of tables gave: the paper's file and our cells, table by table."""

    paper: PaperTables
    cells: tuple[Cell, ...]

    def of_table(self, label: str) -> list[Cell]:
        """Return the cells of a table, row by row."""
        return [cell for cell in self.cells if cell.table == label]

    def matching(self) -> int:
        """Return how many cells match."""
        return sum(cell.matches for cell in self.cells)

    def mean_log_ratio(self, label: str) -> float:
        """Return the mean absolute logarithm of the ratios of a table."""
        return float(np.mean([abs(log(cell.ratio)) for cell in self.of_table(label)]))

    def order_agreement(self, label: str, scenario: str) -> float:
        """Return Kendall's tau between our order of the methods and the paper's."""
        from scipy.stats import kendalltau  # slow to import

        row = [cell for cell in self.of_table(label) if cell.scenario == scenario]
        result = kendalltau([c.ours for c in row], [c.published for c in row])
        return float(result.statistic)


def paper_path(name: str) -> Path:
    """Return where the file of a paper lies."""
    return CONFIGS / "papers" / f"{name}.toml"


def load_paper_tables(name: str) -> PaperTables:
    """Return the tables of a paper by its name."""
    path = paper_path(name)
    return parse(PaperTables, read_toml(path), path)


def reproduce(
    paper: PaperTables,
    advance: Callable[[], None] = lambda: None,
    recorder: Callable[[Scenario, int], Recording] = record,
    chooser: Callable[[MethodColumn, str], RecordingMethod] | None = None,
) -> Outcome:
    """Run every method of a paper's tables on every scenario.

    Parameters
    ----------
    paper
        The tables.
    advance
        Called after each recording, for a progress bar.
    recorder
        Simulates a scenario with a seed; another one shows what a setting of the world is worth.
    chooser
        Gives a column's method for a scenario; `method_of` unless another is given.
    """
    cells: dict[tuple[str, int, int], float] = {}
    for i, row in enumerate(paper.scenarios):
        scenario = load_scenario(row.scenario)
        methods = [(chooser or method_of)(column, row.scenario) for column in paper.methods]
        for (target, j), value in _row(paper, row, scenario, methods, recorder, advance).items():
            cells[target, i, j] = value
    return Outcome(
        paper,
        tuple(
            Cell(
                table=table.label,
                scenario=row.scenario,
                method=column.title,
                published=table.values[i][j],
                ours=cells[table.target, i, j],
                match_factor=paper.match_factor,
                reached=table.reached[i][j],
                tolerance=paper.tolerance,
            )
            for table in paper.tables
            for i, row in enumerate(paper.scenarios)
            for j, column in enumerate(paper.methods)
        ),
    )


def recordings_of(paper: PaperTables) -> int:
    """Return how many recordings a reproduction simulates."""
    return sum(row.seeds for row in paper.scenarios)


def method_of(column: MethodColumn, scenario: str) -> CompiledMethod:
    """Return a column's method as the paper used it in a scenario."""
    variant = column.exceptions.get(scenario, column.variant)
    return built_in_methods()[column.method](variant=variant)


def _row(
    paper: PaperTables,
    row: ScenarioRow,
    scenario: Scenario,
    methods: Sequence[RecordingMethod],
    recorder: Callable[[Scenario, int], Recording],
    advance: Callable[[], None],
) -> dict[tuple[str, int], float]:
    """Return the pooled RMS by target and column: the mean of squares over all samples."""
    squares = {(t.target, j): [0.0, 0] for t in paper.tables for j in range(len(methods))}
    for seed in range(row.seeds):
        recording = recorder(scenario, seed)
        for j, method in enumerate(methods):
            estimates = method.run(recording.vehicle, recording.observations)
            for table in paper.tables:
                error = estimates[table.target] - recording.truth[table.target]
                sums = squares[table.target, j]
                sums[0] += float(np.sum(error**2))
                sums[1] += len(error)
        advance()
    return {key: sqrt(total / count) for key, (total, count) in squares.items()}


def summary_lines(outcome: Outcome) -> list[str]:
    """Return the closing lines of a reproduction, plain text."""
    paper = outcome.paper
    lines = [
        f"{outcome.matching()} of {len(outcome.cells)} cells lie within a factor of "
        f"{paper.match_factor:g} of the published value."
    ]
    for table in paper.tables:
        mean = outcome.mean_log_ratio(table.label)
        lines.append(
            f"Table {table.label}: mean |ln(ours/published)| {mean:.3f}, "
            f"a typical factor of {exp(mean):.2f}."
        )
    mismatched = [cell for cell in outcome.cells if not cell.matches]
    for cell in mismatched:
        lines.append(
            f"Mismatch: table {cell.table}, {cell.scenario}, {cell.method}: "
            f"{cell.ours:.4g} against {cell.published:g} (ratio {cell.ratio:.2f})."
        )
    return lines


def changed_cells(outcome: Outcome) -> list[str]:
    """Return a sentence for each cell that has left its stored tolerance."""
    return [
        f"table {cell.table}, {cell.scenario}, {cell.method}: ratio {cell.ratio:.3f}, stored "
        f"{cell.reached:g}, allowed factor {cell.tolerance:g}"
        for cell in outcome.cells
        if cell.changed
    ]
