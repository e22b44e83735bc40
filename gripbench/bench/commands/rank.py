"""`gripbench rank`: the stored rows as ranked boards."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gripbench.bench.commands import RANK
from gripbench.writing import DEFAULT_RESULTS

if TYPE_CHECKING:
    import pandas as pd

    from gripbench.bench.ranking.ranking import Board


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("rank", rich_help_panel=RANK)(rank)


def rank(
    results: Annotated[Path, typer.Option(help="Folder of the stored rows.")] = DEFAULT_RESULTS,
    target: Annotated[
        list[str] | None,
        typer.Option(help="Signal to rank by; repeat for more. By default the suites' targets."),
    ] = None,
    sensors: Annotated[
        str,
        typer.Option(
            help="Instruments that a method may read, with commas between; 'any': all methods on "
            "one board. By default one board for each set of instruments."
        ),
    ] = "",
    scenario: Annotated[
        list[str] | None, typer.Option(help="Only this scenario; repeat for more.")
    ] = None,
    method: Annotated[
        list[str] | None, typer.Option(help="Only this method (its label); repeat for more.")
    ] = None,
    reference: Annotated[
        str, typer.Option(help="Method whose score is 1; by default the board's geometric mean.")
    ] = "",
    by: Annotated[
        str,
        typer.Option(
            help="rms: by the errors. crps: by what the methods state of their errors, on boards "
            "of uncertainty."
        ),
    ] = "rms",
    confidence: Annotated[float, typer.Option(help="Confidence of ranks and intervals.")] = 0.95,
    format_: Annotated[
        str, typer.Option("--format", help="terminal, text, markdown, csv, latex or html.")
    ] = "terminal",
    wide: Annotated[bool, typer.Option("--wide", help="With the scores beside RMS.")] = False,
    wins: Annotated[bool, typer.Option("--wins", help="Also who wins against whom.")] = False,
) -> None:
    """Rank the methods of stored rows with the confidence that their runs allow."""
    from gripbench.bench.bounds.stored import bounds_beside
    from gripbench.bench.publishing.leaderboard import usual_targets
    from gripbench.bench.ranking.ranking import boards

    rows = stored_rows(results, scenario or [])
    found = boards(
        rows,
        target or usual_targets(rows),
        sensors,
        scenarios=scenario or (),
        labels=method or (),
        reference=reference,
        confidence=confidence,
        by=by,
        bounds=bounds_beside(results, rows["scenario"].unique()),
    )
    show_boards(found, format_, wide, wins)


def show_boards(
    found: Sequence[Board], format_: str, wide: bool = False, wins: bool = False
) -> None:
    """Print boards with what each says in words; as CSV all of them in one table."""
    from textwrap import fill

    from gripbench.bench.publishing.board_tables import board_table, one_table
    from gripbench.bench.publishing.tables import show
    from gripbench.bench.publishing.wins_table import wins_table
    from gripbench.bench.ranking.answers import words

    if format_ == "csv" and not wins:
        show(one_table(found, wide), format_)
        return
    for number, board in enumerate(found):
        if number:
            print()
        if format_ in ("terminal", "text", "markdown"):
            print(fill(words(board), 100) + "\n")
        show(board_table(board, wide=wide), format_)
        if wins:
            print()
            show(wins_table(board), format_)


def stored_rows(results: Path, scenarios: Sequence[str] = ()) -> pd.DataFrame:
    """Return the stored rows, of all scenarios or of these.

    Raises
    ------
    InputError
        If there are none, of one of these scenarios or at all, or nobody knows a scenario.
    """
    from gripbench.bench.catalogue.scenarios import all_scenario_files
    from gripbench.bench.running.store import read_rows
    from gripbench.errors import InputError, unknown

    rows = read_rows(results, tuple(scenarios))
    stored = set(rows["scenario"])
    for name in scenarios:
        if name in stored:
            continue
        known = all_scenario_files()
        if name.partition("@")[0] not in known and ":" not in name:
            raise unknown("scenario", name, {*known, *stored})
        raise InputError(
            f"{results}: no stored rows of '{name}'; 'gripbench run --scenario {name}' makes them"
        )
    if rows.empty:
        raise InputError(f"{results}: no stored rows; 'gripbench run' makes them")
    return rows
