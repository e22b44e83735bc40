"""Lines of consistency, or a board of uncertainty, in; tables of verdicts out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.ranking.ranking import Board
from gripbench.envs.signals import signal

NOTES = (
    "Verdict and factor: errors over the stated deviation; consistent where NEES lies in the band "
    "of a consistent filter, which rests on the scatter of the runs. In 50/90/95 %: share of "
    "samples within the stated intervals. n/a: no such value in every run.",
    "NIS: squared innovations over their stated variance, with their own band; white: share of "
    "runs and channels whose innovations pass the Ljung-Box test at 5 %. Only filters that show "
    "their innovations have them.",
)


_OF_INNOVATIONS = (
    Column("nis", "NIS", format=".3g"),
    Column("nis_band", "Band of NIS"),
    Column("white", "White"),
)
"""Columns where a filter shows its innovations."""


def consistency_table(lines: pd.DataFrame, target: str, confidence: float) -> Table:
    """Return the lines of a target as a table, those of a plan or scenario together.

    Parameters
    ----------
    lines
        As `gripbench.bench.ranking.consistency.consistency` returns them.
    target
        Signal that is estimated.
    confidence
        Confidence of the bands.
    """
    shown = signal(target)
    unit = shown.display_unit.replace("-", "")
    part = lines[lines["target"] == target]
    notes = NOTES if part["nis"].notna().any() else NOTES[:1]
    columns = (
        Column("place", "Drives"),
        Column("label", "Method"),
        Column("verdict", "Verdict"),
        Column("factors", f"Factor ({100 * confidence:g} %)"),
        Column("nees", "NEES", format=".3g"),
        Column("nees_band", "Band"),
        Column("covered", "In 50/90/95 %"),
        Column("sharpness", "Width of 90 %", unit, ".3g"),
        Column("crps", "CRPS", unit, ".3g", best="lowest"),
        *(_OF_INNOVATIONS if part["nis"].notna().any() else ()),
    )
    rows = tuple(_row(line, shown.display_factor) for line in part.to_dict("records"))
    return Table(columns, rows, caption=f"Consistency: {target}", notes=notes, group_by="place")


def _row(line: Mapping[Any, Any], factor: float) -> dict[str, Any]:
    shares = [line[f"coverage_{level}"] for level in (50, 90, 95)]
    words = ["n/a" if pd.isna(share) else f"{100.0 * share:.0f}" for share in shares]
    return {
        **line,
        "place": line["scenario"] or line["plan"],
        "factors": _range(line["factor_from"], line["factor_to"], ".3g"),
        "nees_band": _range(line["nees_low"], line["nees_high"], ".2f"),
        "nis_band": _range(line["nis_low"], line["nis_high"], ".2f"),
        "covered": None if all(map(pd.isna, shares)) else " / ".join(words),
        "sharpness": factor * line["sharpness"],
        "crps": factor * line["crps"],
        "white": _percent(line["white_innovations"]),
    }


def _range(low: float, high: float, form: str) -> str | None:
    return None if pd.isna(low) or pd.isna(high) else f"{low:{form}}–{high:{form}}"


def _percent(share: float) -> str | None:
    return None if pd.isna(share) else f"{100.0 * share:.0f} %"


def uncertainty_columns(board: Board) -> tuple[Column, ...]:
    """Return the columns that a person needs of a board of uncertainty: at most nine."""
    unit = signal(board.target).display_unit.replace("-", "")
    return (
        Column("place", "Rank"),
        Column("name", "Method"),
        *((Column("initials", "Reads"),) if not board.sensors else ()),
        Column("score", "Score", format=".3g", best="lowest", tied="tied"),
        Column("crps", "CRPS", unit, ".3g"),
        *((Column("skill", "Skill", format=".2f"),) if board.guess else ()),
        Column("percent_90", "In 90 %"),
        Column("sharpness", "Its width", unit, ".3g"),
        Column("uncertainty", "Verdict"),
    )


def uncertainty_note(board: Board) -> str:
    """Return what the columns of a board of uncertainty mean."""
    guess = f" Skill: 1 - score / score of {board.guess}." if board.guess else ""
    return (
        "Score: of the mean continuous ranked probability score, for a stated distribution that "
        f"is narrow and true.{guess} In 90 %: share of samples within the stated 90 % interval, "
        "and its width. A verdict's factor is on the standard deviation; n/a: no distribution in "
        "every run."
    )
