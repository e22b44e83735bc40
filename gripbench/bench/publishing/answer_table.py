"""Answers in; the table that says which method to take for which road and sensors out."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.ranking.answers import Answer


def answer_table(found: Iterable[Answer]) -> Table:
    """Return answers as a table: road and sensors, method, error, drives better than a guess."""
    columns = (
        Column("target", "Estimate"),
        Column("road", "Road"),
        Column("sensors", "Sensors"),
        Column("method", "Method"),
        Column("error", "RMS error"),
        Column("better", "Better than a guess in"),
    )
    rows = tuple(_answer(one) for one in found)
    return Table(
        columns,
        rows,
        caption="Which method for which road and sensors",
        notes=(
            "The guess is the best baseline that the same sensors allow. A set of sensors stands "
            "here where it lowers the error; one that adds nothing is left out. The papers' "
            "setting has no spread: methods are given the very car that is driven.",
        ),
        group_by="target",
    )


def _answer(one: Answer) -> dict[str, Any]:
    low, high = (f"{value:.3g}" for value in (one.low, one.high))
    error = f"{one.error:.3g}" + (f" ({low}–{high})" if low != "nan" else "")
    better = "no guess was run" if not one.guess else f"{100.0 * one.better:.0f} % of drives"
    method = one.method if one.useful else f"none is better than {one.guess}; best: {one.method}"
    return {
        "target": one.target,
        "road": ", ".join(_where(one)),
        "sensors": ", ".join(one.sensors),
        "method": method,
        "error": f"{error} {one.unit}".rstrip(),
        "better": better,
    }


def _where(one: Answer) -> list[str]:
    """Return road, plan and setting, each where it tells something."""
    if one.road == "real drive":
        return [one.road]
    return [text for text in (one.road, one.plan, one.setting) if text]
