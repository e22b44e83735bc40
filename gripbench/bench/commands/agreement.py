"""`gripbench agreement`: whether methods stand on recordings as they stand in a population."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gripbench.bench.commands import RANK
from gripbench.writing import DEFAULT_RESULTS


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("agreement", rich_help_panel=RANK)(agreement)


def agreement(
    target: Annotated[
        list[str] | None,
        typer.Option(help="Signal; repeat for more. By default the suites' targets."),
    ] = None,
    confidence: Annotated[float, typer.Option(help="Confidence of the intervals.")] = 0.95,
    format_: Annotated[
        str, typer.Option("--format", help="terminal, text, markdown, csv, latex or html.")
    ] = "terminal",
    results: Annotated[Path, typer.Option(help="Folder of the stored rows.")] = DEFAULT_RESULTS,
) -> None:
    """Compare the order of methods on recordings with that of the populations' boards."""
    from gripbench.bench.publishing.agreement_table import agreement_table, order_table
    from gripbench.bench.publishing.leaderboard import usual_targets
    from gripbench.bench.publishing.tables import show
    from gripbench.bench.ranking.agreement import agreements
    from gripbench.bench.running.store import read_rows
    from gripbench.errors import InputError, unknown

    rows = read_rows(results)
    for name in target or ():
        if name not in set(rows["target"]):
            raise unknown("target", name, set(rows["target"]) - {""})
    found = agreements(rows, target or usual_targets(rows), confidence)
    if not found:
        raise InputError(f"{results}: no recording shares three methods with a population")
    show(agreement_table(found, confidence), format_)
    for one in found:
        print()
        show(order_table(one), format_)
