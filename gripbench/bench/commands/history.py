"""`gripbench history`: add a leaderboard to the history, show and draw it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gripbench.bench.commands import PUBLISH
from gripbench.writing import DEFAULT_RESULTS

if TYPE_CHECKING:
    import pandas as pd

Results = Annotated[
    Path, typer.Option(help="Results folder; the history is history/leaderboard.jsonl in it.")
]


def register(app: typer.Typer) -> None:
    """Add the commands."""
    history = typer.Typer(
        help="History of the leaderboard, one line a commit and method.", no_args_is_help=True
    )
    history.command("add")(add)
    history.command("show")(show)
    history.command("plot")(plot)
    app.add_typer(history, name="history", rich_help_panel=PUBLISH)


def add(
    results: Results = DEFAULT_RESULTS,
    leaderboard: Annotated[
        Path | None, typer.Option(help="leaderboard.json or its folder; by default --results.")
    ] = None,
    commit: Annotated[
        str, typer.Option(help="Name of the commit; by default that of the working tree.")
    ] = "",
    time: Annotated[str, typer.Option(help="Its time, ISO 8601; goes with --commit.")] = "",
) -> None:
    """Add the leaderboard to the history; a commit that is there already is replaced."""
    from gripbench.bench.publishing import history
    from gripbench.bench.publishing.leaderboard import read
    from gripbench.errors import InputError

    if bool(commit) != bool(time):
        raise InputError("history add: --commit and --time go together")
    made = read(leaderboard or results)
    state = history.Commit(name=commit, time=time) if commit else history.current_commit(Path.cwd())
    lines = history.history_of(made, state)
    total = history.add(results / history.FILE, lines)
    print(f"{results / history.FILE}: {len(lines)} lines of {state.name[:8]}, {total} in all")


def show(
    results: Results = DEFAULT_RESULTS,
    target: Annotated[str, typer.Option(help="Only this target; all by default.")] = "",
    method: Annotated[str, typer.Option(help="Only this method; all by default.")] = "",
    format_: Annotated[
        str, typer.Option("--format", help="terminal, text, markdown, csv, latex or html.")
    ] = "terminal",
) -> None:
    """Print the history as a table."""
    from gripbench.bench.publishing import history, tables

    tables.show(history.table_of(_frame(results, target, method)), format_)


def plot(
    out: Annotated[Path, typer.Argument(help="Picture to write: .png, .pdf or .svg.")],
    results: Results = DEFAULT_RESULTS,
    target: Annotated[str, typer.Option(help="Only this target; all by default.")] = "",
    method: Annotated[str, typer.Option(help="Only this method; all by default.")] = "",
) -> None:
    """Draw RMS and relative runtime by commit."""
    from gripbench.bench.publishing import history
    from gripbench.errors import InputError, nearest
    from gripbench.writing import being_written

    suffixes = (".png", ".pdf", ".svg")
    if out.suffix not in suffixes:
        raise InputError(f"{out}: cannot draw '{out.suffix}': {nearest(out.suffix, suffixes)}")
    figure = history.plot(_frame(results, target, method))
    with being_written(out) as path:
        figure.savefig(path, dpi=150)
    print(f"wrote {out}")


def _frame(results: Path, target: str, method: str) -> pd.DataFrame:
    from gripbench.bench.publishing import history
    from gripbench.errors import unknown

    frame = history.frame_of(history.read_rows(results / history.FILE))
    for column, name in (("target", target), ("label", method)):
        if name and name not in set(frame[column]):
            raise unknown(f"{column} in the history", name, set(frame[column]))
        frame = frame[frame[column] == name] if name else frame
    return frame
