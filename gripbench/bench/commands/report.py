"""`gripbench report`: one HTML file with everything that was run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gripbench.bench.commands import PUBLISH
from gripbench.writing import DEFAULT_RESULTS


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("report", rich_help_panel=PUBLISH)(report)


def report(
    suite: Annotated[
        list[str] | None, typer.Option(help="Only what belongs to this suite; repeat for more.")
    ] = None,
    target: Annotated[
        list[str] | None,
        typer.Option(help="Only this target; repeat for more. By default those of the suites."),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(
            help="Your own method, FILE.py:Class, so that it has curves; repeat for more."
        ),
    ] = None,
    recording: Annotated[
        list[str] | None,
        typer.Option(
            help="Folder or map of a recording of yours, so that it has curves; repeat for more."
        ),
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Seeds whose time series can be seen.")] = 3,
    band: Annotated[int, typer.Option(min=1, help="Seeds over which error bands are taken.")] = 20,
    workers: Annotated[int, typer.Option(min=0, help="Processes; 0: one a core.")] = 0,
    results: Annotated[Path, typer.Option(help="Folder of results.")] = DEFAULT_RESULTS,
    output: Annotated[
        Path | None, typer.Option(help="The file; by default report.html under RESULTS.")
    ] = None,
) -> None:
    """Write a self-contained HTML report of the stored results; it opens from disk, offline."""
    from gripbench.bench.publishing.report.page import write_report
    from gripbench.bench.publishing.terminal import progress
    from gripbench.bench.running.backends import Backend
    from gripbench.writing import check_writable

    path = output or results / "report.html"
    check_writable(path)
    with progress("time series", 1) as bar:

        def advance(done: int, total: int) -> None:
            bar.update(bar.task_ids[0], completed=done, total=total)

        write_report(
            results,
            path,
            tuple(suite or ()),
            tuple(target or ()),
            seeds,
            band,
            Backend(workers=workers).processes,
            advance,
            tuple(method or ()),
            tuple(recording or ()),
        )
    typer.echo(f"Written: {path} ({path.stat().st_size / 1e6:.1f} MB)")
