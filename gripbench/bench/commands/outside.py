"""`gripbench export` and `gripbench submit`: for estimators that run outside gripbench."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gripbench.bench.commands import RUN
from gripbench.writing import DEFAULT_RESULTS


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command("export", rich_help_panel=RUN)(export)
    app.command("submit", rich_help_panel=RUN)(submit)


def export(
    suite: Annotated[str, typer.Argument(help="A suite's name or TOML file.")],
    to: Annotated[Path, typer.Option(help="Folder to write, not there yet or empty.")],
    seeds: Annotated[
        str, typer.Option(help="N for seeds 0 to N-1, or A:B for A to B-1; by default the suite's.")
    ] = "",
    level: Annotated[
        int | None,
        typer.Option(help="Level of the populations, 0 to 2; by default the suite's."),
    ] = None,
    format_: Annotated[
        str, typer.Option("--format", help="Of the observations: csv, parquet or mat.")
    ] = "csv",
    results: Annotated[
        Path,
        typer.Option(help="Folder of the rows that will come of it; which drive is which is kept."),
    ] = DEFAULT_RESULTS,
) -> None:
    """Write a suite's observations for an estimator that runs elsewhere; never the truth."""
    from gripbench.bench.publishing.terminal import console, progress
    from gripbench.bench.running.api import seeds_of
    from gripbench.bench.running.exporting import export_suite
    from gripbench.envs.scenarios import LEVELS
    from gripbench.errors import InputError

    if level is not None and level not in LEVELS:
        raise InputError(f"level {level}: known: {', '.join(map(str, LEVELS))}")
    with progress("exporting", 1) as bar:
        task = bar.task_ids[0]
        count = export_suite(
            suite,
            seeds_of(seeds) if seeds else None,
            to,
            results,
            format_,
            level,
            lambda done, of: bar.update(task, completed=done, total=of),
        )
    console().print(
        f"wrote {count} drives to {to}; {to / 'README.md'} says what to hand in", soft_wrap=True
    )


def submit(
    folder: Annotated[Path, typer.Argument(help="The exported folder, with estimates in it.")],
    name: Annotated[str, typer.Option(help="What to call the method, such as my_observer.")],
    reads: Annotated[str, typer.Option(help="Every channel that it reads, with commas between.")],
    title: Annotated[str, typer.Option(help="Its name as the literature gives it.")] = "",
    results: Annotated[Path, typer.Option(help="Folder of the stored rows.")] = DEFAULT_RESULTS,
) -> None:
    """Score estimates that were computed elsewhere, as rows beside all others."""
    from gripbench.bench.publishing.presentation import print_failures, print_summary
    from gripbench.bench.publishing.terminal import console
    from gripbench.bench.ranking.summary import summary
    from gripbench.bench.running import submissions
    from gripbench.bench.running.rows import frame_of

    rows = submissions.submit(folder, name, reads.split(","), results, title)
    frame = frame_of(rows)
    print_summary(summary(frame))
    print_failures(frame)
    console().print(f"{len(rows)} rows of {name} stored in {results}", soft_wrap=True)
