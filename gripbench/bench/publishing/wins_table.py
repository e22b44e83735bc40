"""A board in, a table of who wins against whom in how many runs out."""

from __future__ import annotations

from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.ranking.ranking import Board


def wins_table(board: Board) -> Table:
    """Return the runs that the method of each row wins against that of each column."""
    columns = [Column("name", "Wins against"), *(
        Column(label, label, format="g") for label in board.wins.columns
    )]  # fmt: skip
    rows = [
        {"name": label, **{str(other): value for other, value in line.items()}}
        for label, line in board.wins.iterrows()
    ]
    runs = int(board.lines["cells"].iloc[0])
    return Table(
        tuple(columns),
        tuple(rows),
        caption=f"{board.title}: wins in {runs} runs",
        notes=("Runs with the lower value, half for a draw; a failure loses.",),
    )
