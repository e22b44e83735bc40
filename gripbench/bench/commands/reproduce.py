"""`gripbench reproduce PAPER`: a paper's results beside its published numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gripbench.bench.commands import REPRODUCE
from gripbench.writing import DEFAULT_RESULTS


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("reproduce", rich_help_panel=REPRODUCE)(reproduce)


def reproduce(
    paper: Annotated[str, typer.Argument(help="li2014, yoon2015, dakhlallah2008, anderson2004")],
    results: Annotated[Path, typer.Option(help="Directory to write into")] = DEFAULT_RESULTS,
) -> None:
    """Run a paper's comparison again and print it beside the published numbers.

    Exit code 1 when a figure has left the tolerance that is stored beside it.
    """
    from gripbench.bench.papers.comparison import reproduce_paper

    directory = results / paper
    changed = reproduce_paper(paper, directory)
    typer.echo(f"Written to {directory}/.")
    for line in changed:
        typer.echo(f"changed: {line}", err=True)
    if changed:
        raise typer.Exit(1)
