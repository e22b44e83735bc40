"""`gripbench results`: what is stored, and what of it nobody needs any more."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gripbench.bench.commands import RANK
from gripbench.writing import DEFAULT_RESULTS

Results = Annotated[Path, typer.Option(help="Folder of the stored rows.")]
Scenarios = Annotated[list[str] | None, typer.Option(help="Only this scenario; repeat for more.")]
Methods = Annotated[list[str] | None, typer.Option(help="Only this method; repeat for more.")]


def register(app: typer.Typer) -> None:
    """Add the commands."""
    group = typer.Typer(no_args_is_help=True, help="List, show and prune stored rows.")
    group.command("list")(list_rows)
    group.command("show")(show)
    group.command("prune")(prune)
    app.add_typer(group, name="results", rich_help_panel=RANK)


def list_rows(results: Results = DEFAULT_RESULTS) -> None:
    """List the stored rows by scenario and method."""
    from gripbench.bench.publishing.columns import Table
    from gripbench.bench.publishing.tables import show as show_table
    from gripbench.bench.publishing.terminal import console
    from gripbench.bench.running.store import read_rows

    frame = read_rows(results).drop_duplicates(["scenario", "label", "seed"])
    if frame.empty:
        console().print(f"no rows under {results}")
        return
    lines = [
        (
            str(scenario),
            str(label),
            str(len(group)),
            f"{group['seed'].min()} to {group['seed'].max()}",
            ", ".join(
                f"{count} {status}"
                for status, count in group["status"].value_counts().sort_index().items()
            ),
        )
        for (scenario, label), group in frame.groupby(["scenario", "label"], sort=False)
    ]
    show_table(Table.of_texts(("scenario", "method", "rows", "seeds", "status"), lines))


def show(
    results: Results = DEFAULT_RESULTS, scenario: Scenarios = None, method: Methods = None
) -> None:
    """Show the RMS errors of stored rows, and what failed."""
    from gripbench.bench.publishing.presentation import print_failures, print_summary
    from gripbench.bench.publishing.terminal import console
    from gripbench.bench.ranking.summary import summary
    from gripbench.bench.running.store import read_rows

    frame = read_rows(results, tuple(scenario or ()), tuple(method or ()))
    if frame.empty:
        console().print(f"no such rows under {results}")
        return
    print_summary(summary(frame))
    print_failures(frame)


def prune(
    results: Results = DEFAULT_RESULTS,
    scenario: Scenarios = None,
    method: Methods = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what would go.")] = False,
) -> None:
    """Remove the rows of a scenario or method, or what is damaged or of unknown scenarios."""
    from gripbench.bench.publishing.terminal import console
    from gripbench.bench.running.pruning import remove, stale, stored

    if scenario or method:
        paths = stored(results, tuple(scenario or ()), tuple(method or ()))
    else:
        paths = stale(results)
    verb = "would remove" if dry_run else "removed"
    if not dry_run:
        remove(paths)
    console().print(f"{verb} {len(paths)} files under {results}")
