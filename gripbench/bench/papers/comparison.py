"""A paper's name in; out, its results beside the published numbers, printed and written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import typer
from rich.progress import Progress

from gripbench.bench.papers.reproduction import Reproduction, reproduction_of
from gripbench.bench.publishing import tables
from gripbench.bench.publishing.columns import Table
from gripbench.bench.publishing.manifest import manifest, write_manifest
from gripbench.envs.hidden_draws import VARIABLE, salt
from gripbench.errors import GripbenchError, InputError
from gripbench.writing import write_atomically


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
    One line for each figure that has left what is stored beside it.

    Raises
    ------
    InputError
        If there is no such paper, its file has a mistake, or seeds are hidden.
    GripbenchError
        If the directory cannot be written.
    """
    if salt():
        raise InputError(f"{paper}: its numbers are of public seeds: unset {VARIABLE}")
    module = reproduction_of(paper)
    module.load()  # a mistake in the file is named before anything is written
    _make(directory)
    with _progress() as progress:
        task = progress.add_task(paper, total=None)
        result = module.reproduce(
            lambda done, total: progress.update(task, completed=done, total=total)
        )
    for table in result.tables.values():
        tables.show(table)
    typer.echo("\n".join(result.lines))
    files = _write(directory, result)
    write_manifest(directory, manifest(result.configuration, result.seeds), files)
    return result.changed


def _make(directory: Path) -> None:
    """Make the folder once the input is known to be right, before work that would be in vain."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise GripbenchError(f"{directory}: cannot be written ({error.strerror})") from None


def _write(directory: Path, result: Reproduction) -> list[Path]:
    content = {}
    for name, table in result.tables.items():
        content[f"{name}.csv"] = tables.csv(portable(table))
        content[f"{name}.tex"] = tables.latex(table)
    text = "\n\n".join(tables.markdown(table) for table in result.tables.values())
    content["README.md"] = text + "\n\n" + "\n".join(f"- {line}" for line in result.lines) + "\n"
    for name, written in content.items():
        write_atomically(directory / name, written)
    return [directory / name for name in content]


def portable(table: Table) -> Table:
    """Return a table with the digits of its numbers that are the same on every machine.

    Processors round differently; a file that is published must come out again elsewhere.
    """
    rows = tuple(
        {
            key: float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value
            for key, value in row.items()
        }
        for row in table.rows
    )
    return replace(table, rows=rows)


DIGITS = 6
"""Significant digits of the numbers in published files."""


def _progress() -> Progress:
    from rich.console import Console

    console = Console(stderr=True)
    return Progress(console=console, transient=True, disable=not console.is_terminal)
