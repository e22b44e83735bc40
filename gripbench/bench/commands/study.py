"""`gripbench study`: a log and its map in, a ranked page with tuned methods out."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from gripbench.bench.commands import LOGS


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("study", rich_help_panel=LOGS)(study)


def study(
    log: Annotated[Path, typer.Argument(help="The log, or the folder with a map's files.")],
    channel_map: Annotated[
        Path, typer.Option("--map", help="TOML file that says which column is what.")
    ],
    target: Annotated[str, typer.Option(help="Signal to tune and rank for.")] = "sideslip",
    budget: Annotated[int, typer.Option(min=2, help="Trials in the tuning of each method.")] = 60,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the page and all else; by default study_NAME.")
    ] = None,
    workers: Annotated[int, typer.Option(min=0, help="Processes; 0: one a core.")] = 0,
) -> None:
    """Check a log, identify its vehicle, tune methods on training windows, rank them on the test's.

    Writes one page, `index.html`.
    """
    from textwrap import fill

    from gripbench.bench.publishing.board_tables import board_table
    from gripbench.bench.publishing.study_page import board_of, write_study
    from gripbench.bench.publishing.tables import show
    from gripbench.bench.ranking.answers import words
    from gripbench.bench.running import study as running
    from gripbench.logs.mapping.channel_map import load_channel_map
    from gripbench.logs.windows import windows_text

    folder = out or Path(f"study_{load_channel_map(channel_map).name}")
    done = running.study(
        log, channel_map, folder, target, budget, workers,
        lambda text: print(text, file=sys.stderr),
    )  # fmt: skip
    board = board_of(done)
    print(done.imported.report.text())
    print(windows_text(done.imported.recordings))
    for sentence in done.undetermined:
        print(sentence)
    print(fill(words(board), 100) + "\n")
    show(board_table(board))
    write_study(done, board, folder / "index.html")
    print(f"written to {folder / 'index.html'}")
