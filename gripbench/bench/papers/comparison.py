"""A paper's results beside its published numbers: reproduced, printed and written."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import typer
from rich.progress import Progress

from gripbench.bench.papers import tables as paper_tables
from gripbench.bench.papers.claims import Claim, changed_verdicts, load_paper, paper_files
from gripbench.bench.publishing import tables
from gripbench.bench.publishing.manifest import manifest, write_manifest
from gripbench.configuration import read_toml
from gripbench.envs.signals import signal
from gripbench.envs.worlds import load_scenario
from gripbench.errors import GripbenchError, unknown


def reproduce_paper(paper: str, directory: Path) -> list[str]:
    """Run a paper's comparison again, print it and write it.

    Parameters
    ----------
    paper
        Name of a paper in `configs/papers`.
    directory
        Where to write tables and manifest.

    Returns
    -------
    One line for each figure that has left the tolerance stored beside it.

    Raises
    ------
    InputError
        If there is no such paper or its file has a mistake.
    GripbenchError
        If the directory cannot be written.
    """
    files = paper_files()
    if paper not in files:
        raise unknown("paper", paper, files)
    if read_toml(files[paper]).get("kind") == "tables":
        return _reproduce_tables(paper, directory)
    return _reproduce_claims(paper, directory)


def _make(directory: Path) -> None:
    """Make the folder once the input is known to be right, before work that would be in vain."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise GripbenchError(f"{directory}: cannot be written ({error.strerror})") from None


def _reproduce_tables(name: str, directory: Path) -> list[str]:
    paper = paper_tables.load_paper_tables(name)
    _make(directory)
    with _progress() as progress:
        task = progress.add_task(f"{name}: recordings", total=paper_tables.recordings_of(paper))
        outcome = paper_tables.reproduce(paper, lambda: progress.advance(task))
    described = [_beside(outcome, label) for label in [t.label for t in paper.tables]]
    described.append(_agreement(outcome))
    for table in described:
        tables.show(table)
    lines = paper_tables.summary_lines(outcome)
    typer.echo("\n".join(lines))
    names = [f"table_{table.label.lower()}" for table in paper.tables] + ["order"]
    _write(directory, dict(zip(names, described, strict=True)), lines)
    scenarios = {
        row.scenario: load_scenario(row.scenario).model_dump(mode="json") for row in paper.scenarios
    }
    seeds = {row.scenario: list(range(row.seeds)) for row in paper.scenarios}
    settings = {
        f"{column.title} in {row.scenario}": paper_tables.method_of(column, row.scenario).settings
        for column in paper.methods
        for row in paper.scenarios
        if row is paper.scenarios[0] or row.scenario in column.exceptions
    }
    configuration = {"paper": paper.model_dump(mode="json"), "methods": settings} | scenarios
    write_manifest(directory, manifest(configuration, seeds))
    return paper_tables.changed_cells(outcome)


def _beside(outcome: paper_tables.Outcome, label: str) -> tables.Table:
    """Return a table with one row a cell: ours, published, ratio, verdict."""
    paper = outcome.paper
    table = next(t for t in paper.tables if t.label == label)
    titles = {row.scenario: row.title for row in paper.scenarios}
    digits = ".2f" if table.unit == "N" else ".4f"
    marks = _marks(paper)
    rows = [
        {
            "scenario": titles[cell.scenario],
            "method": cell.method + marks[cell.method],
            "ours": cell.ours,
            "published": cell.published,
            "ratio": cell.ratio,
            "verdict": "match" if cell.matches else "mismatch",
        }
        for cell in outcome.of_table(label)
    ]
    unit = "" if table.unit == "-" else table.unit
    return tables.Table(
        columns=(
            tables.Column("scenario", "Scenario"),
            tables.Column("method", "Method"),
            tables.Column("ours", "Ours", unit, digits, best="lowest"),
            tables.Column("published", "Published", unit, digits, best="lowest"),
            tables.Column("ratio", "Ratio", "", ".2f"),
            tables.Column("verdict", "Verdict"),
        ),
        rows=tuple(rows),
        caption=f"Table {label}. {table.title}, ours beside the paper's",
        notes=_notes(paper),
        group_by="scenario",
    )


def _agreement(outcome: paper_tables.Outcome) -> tables.Table:
    paper = outcome.paper
    rows = []
    for row in paper.scenarios:
        entry: dict[str, Any] = {"scenario": row.title}
        for table in paper.tables:
            entry[table.label] = outcome.order_agreement(table.label, row.scenario)
        rows.append(entry)
    columns = [tables.Column(t.label, f"Table {t.label}", "", ".1f") for t in paper.tables]
    return tables.Table(
        columns=(tables.Column("scenario", "Scenario"), *columns),
        rows=tuple(rows),
        caption="Kendall's tau between our order of the methods and the paper's",
    )


def _marks(paper: paper_tables.PaperTables) -> dict[str, str]:
    """Return the mark of each column: a dagger where an idealised channel is read."""
    return {c.title: " †" if _idealised(paper, c) else "" for c in paper.methods}


def _notes(paper: paper_tables.PaperTables) -> tuple[str, ...]:
    return tuple(
        f"† {column.title} reads {', '.join(_idealised(paper, column))}: idealised, "
        "no sensor in a vehicle gives it."
        for column in paper.methods
        if _idealised(paper, column)
    )


def _idealised(
    paper: paper_tables.PaperTables, column: paper_tables.MethodColumn
) -> tuple[str, ...]:
    method = paper_tables.method_of(column, paper.scenarios[0].scenario)
    return tuple(name for name in method.sensors if signal(name).idealised)


def _reproduce_claims(name: str, directory: Path) -> list[str]:
    load_paper(name)
    _make(directory)
    module = importlib.import_module(f"gripbench.bench.papers.{name}.reproduction")
    with _progress() as progress:
        task = progress.add_task(name, total=None)

        def advance(done: int, total: int) -> None:
            progress.update(task, completed=done, total=total)

        claims: list[Claim] = module.reproduce(advance)
    table = tables.Table(
        columns=(
            tables.Column("quantity", "Claim"),
            tables.Column("unit", "Unit"),
            tables.Column("published", "Published", "", ".4g"),
            tables.Column("ours", "Ours", "", ".4g"),
            tables.Column("tolerance", "Accepted"),
            tables.Column("verdict", "Verdict"),
            tables.Column("reason", "Reason"),
        ),
        rows=tuple(
            {
                "quantity": claim.quantity,
                "unit": claim.unit,
                "published": claim.published,
                "ours": claim.ours,
                "tolerance": _range(claim),
                "verdict": claim.verdict,
                "reason": claim.reason,
            }
            for claim in claims
        ),
        caption=f"Claims of {name} beside our figures",
    )
    tables.show(table)
    count = {v: sum(c.verdict == v for c in claims) for v in ("reproduced", "not reproduced")}
    lines = [
        f"{count['reproduced']} claims reproduced, {count['not reproduced']} not, "
        f"{len(claims) - sum(count.values())} not comparable."
    ]
    typer.echo("\n".join(lines))
    _write(directory, {"claims": table}, lines)
    files = paper_files()
    write_manifest(directory, manifest({"paper": read_toml(files[name])}, {}))
    return changed_verdicts(load_paper(name), claims)


def _range(claim: Claim) -> str:
    low, high = claim.tolerance_low, claim.tolerance_high
    if low is None and high is None:
        return ""
    if low is None:
        return f"up to {high:g}"
    if high is None:
        return f"from {low:g}"
    return f"{low:g} to {high:g}"


def _write(directory: Path, described: dict[str, tables.Table], lines: list[str]) -> None:
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for name, table in described.items():
            (directory / f"{name}.csv").write_text(tables.csv(table), encoding="utf-8")
            (directory / f"{name}.tex").write_text(tables.latex(table), encoding="utf-8")
        text = "\n\n".join(tables.markdown(table) for table in described.values())
        text += "\n\n" + "\n".join(f"- {line}" for line in lines) + "\n"
        (directory / "README.md").write_text(text, encoding="utf-8")
    except OSError as error:
        raise GripbenchError(f"{directory}: cannot be written ({error.strerror})") from None


def _progress() -> Progress:
    from rich.console import Console

    console = Console(stderr=True)
    return Progress(console=console, transient=True, disable=not console.is_terminal)
