"""A board in, its columns and sentences on the least error that its sensors allow out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gripbench.bench.publishing.columns import Column
from gripbench.bench.ranking.ranking import Board

BELOW = "⚠"
"""Follows the name of a method whose error is smaller than its sensors allow."""


def below_mark(line: Mapping[Any, Any]) -> str:
    """Return the mark of a method that is below what its sensors allow; empty: it is not."""
    return BELOW if line["below_bound"] else ""


def bound_cells(line: Mapping[Any, Any], factor: float) -> dict[str, float]:
    """Return the cells of `bound_columns`; `factor` is that of the target's display unit."""
    return {"bound": factor * line["bound"], "known_percent": 100.0 * line["known"]}


def ratio_column(board: Board) -> tuple[Column, ...]:
    """Return the one column of a narrow board; none where no bound is stored."""
    known = board.lines["bound_ratio"].notna().any()
    return (Column("bound_ratio", "x bound", format=".3g"),) if known else ()


def bound_columns(board: Board, unit: str) -> tuple[Column, ...]:
    """Return the columns of a wide board, the bound in the unit that people see."""
    if board.lines["bound"].isna().all():
        return ()
    return (
        Column("bound", "Bound", unit, ".4g"),
        Column("bound_ratio", "RMS / bound", format=".3g"),
        Column("known_percent", "Can be known", "% of drives", ".0f"),
        Column("below_bound", "Below what the sensors allow in"),
    )


def bound_notes(board: Board, wide: bool) -> list[str]:
    """Return what stands below a board."""
    notes = []
    if not wide and board.lines["bound_ratio"].notna().any():
        runs = int(board.lines["bound_runs"].iloc[0])
        notes.append(
            "x bound: RMS over the least that any estimate with these sensors can have, in "
            f"{runs} of the runs (docs/bounds.md)."
        )
    if (board.lines["below_bound"] != "").any():
        notes.append(
            f"{BELOW} below what the sensors allow: has seen what it may not, or the car's own "
            "values."
        )
    return notes
