"""`gripbench figures`: the result figures of a paper."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gripbench.bench.commands import REPRODUCE
from gripbench.writing import DEFAULT_RESULTS


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("figures", rich_help_panel=REPRODUCE)(figures)


def figures(
    paper: Annotated[str, typer.Argument(help="li2014, yoon2015, dakhlallah2008, anderson2004")],
    figure: Annotated[
        list[str] | None, typer.Option(help="Only the figure with this number; repeat for more.")
    ] = None,
    results: Annotated[Path, typer.Option(help="Folder of results.")] = DEFAULT_RESULTS,
    dpi: Annotated[int, typer.Option(min=30, max=1200, help="Dots an inch of the PNG.")] = 150,
) -> None:
    """Draw a paper's result figures by number, as PNG and PDF, into RESULTS/PAPER/figures."""
    from gripbench.bench.papers.figures import choose, write_figures
    from gripbench.bench.publishing.terminal import progress

    wanted = figure or []
    directory = results / paper / "figures"
    chosen = choose(paper, wanted)
    with progress(f"{paper}: figures", len(chosen)) as bar:
        write_figures(paper, directory, wanted, dpi, lambda: bar.advance(bar.task_ids[0]))
    typer.echo(f"{len(chosen)} figures written to {directory}/.")
