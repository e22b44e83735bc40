"""The verdict on a pack as a table and in words."""

from __future__ import annotations

import math
from typing import Any

from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.ranking.verification import CONFIDENCE, Comparison, Verdict
from gripbench.envs.signals import signal


def verdict_table(label: str, verdict: Verdict) -> Table:
    """Return the comparisons of a verdict as a table, RMS in the unit that boards show."""
    columns = (
        Column("scenario", "Scenario"),
        Column("target", "Target"),
        Column("packed", "Packed RMS"),
        Column("fresh", "Fresh RMS"),
        Column("ratio", f"Ratio ({100.0 * CONFIDENCE:g} %)"),
        Column("verdict", "Verdict"),
    )
    rows = tuple(_row(one) for one in verdict.comparisons)
    return Table(columns, rows, caption=f"{label}: packed rows and fresh drives")


def _row(one: Comparison) -> dict[str, Any]:
    shown = signal(one.target)
    unit = shown.display_unit.replace("-", "")
    known = not math.isnan(one.ratio)
    return {
        "scenario": one.scenario,
        "target": one.target,
        "packed": _rms(one.packed * shown.display_factor, unit, one.packed_runs),
        "fresh": _rms(one.fresh * shown.display_factor, unit, one.fresh_runs),
        "ratio": f"{one.ratio:.3g} ({one.low:.3g} to {one.high:.3g})" if known else None,
        "verdict": "differs" if one.fault else "agrees",
    }


def _rms(value: float, unit: str, runs: int) -> str | None:
    return f"{value:.4g} {unit}".rstrip() + f" ({runs})" if runs else None


def words(label: str, verdict: Verdict) -> list[str]:
    """Return a verdict in words: what it rests on, what speaks against it, what it does not say."""
    count = len(verdict.comparisons)
    again = (
        f"; {verdict.repeated - len(verdict.different)} of {verdict.repeated} packed rows that "
        "were run again came out the same"
        if verdict.repeated
        else ""
    )
    agree = sum(not one.fault for one in verdict.comparisons)
    head = "verified" if verdict.verified else "NOT verified"
    return [
        f"{head}: {label}: {agree} of {count} figures agree with fresh hidden drives{again}.",
        *(f"- {fault}." for fault in verdict.faults),
        *verdict.notes,
    ]
