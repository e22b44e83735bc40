"""`gripbench consistency`: whether methods know their errors, from stored rows."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gripbench.bench.commands import RANK
from gripbench.writing import DEFAULT_RESULTS


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("consistency", rich_help_panel=RANK)(consistency)


def consistency(
    results: Annotated[Path, typer.Option(help="Folder of the stored rows.")] = DEFAULT_RESULTS,
    target: Annotated[
        list[str] | None,
        typer.Option(help="Signal; repeat for more. By default the suites' targets."),
    ] = None,
    scenario: Annotated[
        list[str] | None, typer.Option(help="Only this scenario; repeat for more.")
    ] = None,
    method: Annotated[
        list[str] | None, typer.Option(help="Only this method (its label); repeat for more.")
    ] = None,
    by_scenario: Annotated[
        bool, typer.Option("--by-scenario", help="Each scenario by itself.")
    ] = False,
    confidence: Annotated[float, typer.Option(help="Confidence of bands and intervals.")] = 0.95,
    format_: Annotated[
        str, typer.Option("--format", help="terminal, text, markdown, csv, latex or html.")
    ] = "terminal",
) -> None:
    """Say of each method whether its errors are as large as it says: NEES, NIS, coverage, CRPS."""
    from gripbench.bench.commands.rank import stored_rows
    from gripbench.bench.publishing.consistency_table import consistency_table
    from gripbench.bench.publishing.leaderboard import usual_targets
    from gripbench.bench.publishing.tables import show
    from gripbench.bench.ranking.consistency import consistency as lines_of
    from gripbench.errors import InputError, unknown

    rows = stored_rows(results, scenario or [])
    for name in method or ():
        if name not in set(rows["label"]):
            raise unknown("method", name, set(rows["label"]))
    if scenario:
        rows = rows[rows["scenario"].isin(scenario)]
    if method:
        rows = rows[rows["label"].isin(method)]
    lines = lines_of(rows, target or usual_targets(rows), by_scenario, confidence)
    if lines.empty:
        raise InputError(f"{results}: every run of these methods was skipped")
    if format_ == "csv":
        print(lines.to_csv(index=False, lineterminator="\n"), end="")
        return
    for number, name in enumerate(dict.fromkeys(lines["target"])):
        if number:
            print()
        show(consistency_table(lines, name, confidence), format_)
