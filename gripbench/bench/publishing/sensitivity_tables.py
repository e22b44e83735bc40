"""What a sensitivity study found as tables: one method's causes, and all methods beside each other.

Amounts are shown with their units, RMS errors in the unit in which people see the target.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import pandas as pd

from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.publishing.presentation import significant
from gripbench.bench.ranking.sensitivity import PAPER, RADIUS_CASE, breaking_table, summary_of
from gripbench.envs.signals import signal

MOST_CAUSES = 6
"""Causes of the table method x cause, those that break most methods first."""


def amount(value: float, unit: str) -> str:
    """Return a deviation with its unit; a relative one in percent.

    Examples
    --------
    >>> amount(-0.002, "relative"), amount(1.5, "mm")
    ('-0.2 %', '+1.5 mm')
    """
    if unit == "relative":
        return f"{100.0 * value:+.3g} %"
    return f"{value:+.3g} {'' if unit == '-' else unit}".strip()


def tornado_table(table: pd.DataFrame, label: str, target: str) -> Table:
    """Return the causes of one method, the worst first; table from `summary_of`."""
    factor, unit = signal(target).display_factor, signal(target).display_unit
    first = table.iloc[0]
    rows = []
    for _, line in table.iterrows():
        broken = [line[f"breaking_{side}"] for side in ("low", "high")]
        known = dict.fromkeys(one for one in broken if one == one)
        rows.append(
            {
                "cause": line["cause"],
                "low": amount(line["low"], line["unit"]),
                "rms_low": significant(factor * line["rms_low"]),
                "high": amount(line["high"], line["unit"]),
                "rms_high": significant(factor * line["rms_high"]),
                "breaks": ", ".join(amount(one, line["unit"]) for one in known),
            }
        )
    columns = (
        Column("cause", "Cause"),
        Column("low", "Low"),
        Column("rms_low", "RMS"),
        Column("high", "High"),
        Column("rms_high", "RMS"),
        Column("breaks", "Breaks at"),
    )
    caption = (
        f"{label}, {target} [{unit}]: RMS {significant(factor * first['nominal'])} without error, "
        f"best baseline {first['baseline'] or 'none'} "
        f"{significant(factor * first['rms_baseline'])}"
    )
    return Table(columns, tuple(rows), caption)


def worst_causes(shares: pd.DataFrame) -> list[str]:
    """Return the causes that break most methods first; frame from `breaking_table`."""
    ahead = shares[(shares > 0.0).any(axis=1)]
    order = ahead.clip(upper=10.0).mean().sort_values(kind="stable")
    return [str(name) for name in order.index[:MOST_CAUSES]]


def cause_table(shares: pd.DataFrame, target: str) -> Table:
    """Return the table method x cause; frame from `breaking_table`."""
    causes = worst_causes(shares)
    rows = []
    for label, line in shares.iterrows():
        behind = not (line > 0.0).any()
        cells = {
            name: "behind" if behind else f"{line[name]:.2f}" if line[name] < math.inf else ""
            for name in causes
        }
        rows.append({"label": label, **cells})
    return Table(
        (Column("label", "Method"), *(Column(name, name) for name in causes)),
        tuple(rows),
        f"{target}: error at which the best baseline overtakes, over the range of the cause",
        ("Without a number: not within four times the range. Behind: without any error already.",),
    )


def worst_table(frame: pd.DataFrame, labels: Sequence[str], target: str) -> Table:
    """Return each method's three causes that break it first, with the amount."""
    shares = breaking_table(frame)
    rows = []
    for label in labels:
        table = summary_of(frame, label).set_index("cause")
        if table["nominal"].isna().all():
            continue
        order = pd.Series(shares.loc[label]).sort_values(kind="stable")
        cells = []
        if not (order > 0.0).any():
            cells = ["behind the best baseline without any error"]
        for cause in order[(order < math.inf) & (order > 0.0)].index[:3]:
            line = table.loc[cause]
            ends = [line[side] for side in ("breaking_low", "breaking_high")]
            nearest = min((one for one in ends if one == one), key=abs)
            cells.append(f"{cause} {amount(nearest, str(line['unit']))}")
        places = dict(zip(("first", "second", "third"), (cells + [""] * 3)[:3], strict=True))
        rows.append({"label": label, **places})
    columns = (
        Column("label", "Method"),
        Column("first", "First"),
        Column("second", "Second"),
        Column("third", "Third"),
    )
    return Table(columns, tuple(rows), f"{target}: what breaks each method first")


def radius_table(frame: pd.DataFrame, labels: Sequence[str], target: str) -> Table:
    """Return what a wheel radius on paper costs that is a fifth of a percent off."""
    factor, unit = signal(target).display_factor, signal(target).display_unit.replace("-", "")
    rows = []
    for label in labels:
        own = frame["label"] == label
        part = frame[own & (frame["cause"] == PAPER + "wheel_radius")]
        if part.empty or part["rms"].isna().all():
            continue
        found = summary_of(frame[own | frame["baseline"]], label).set_index("cause")
        line = pd.Series(found.loc[PAPER + "wheel_radius"])
        rms = {
            name: factor * float(part["rms"][(part["deviation"] - size).abs() < 1e-9].iloc[0])
            for name, size in (("less", -RADIUS_CASE), ("right", 0.0), ("more", RADIUS_CASE))
        }
        rows.append(
            {
                "label": label,
                **rms,
                "guess": factor * float(line["rms_baseline"]),
                "baseline": line["baseline"],
            }
        )
    percent = f"{100.0 * RADIUS_CASE:g} %"
    columns = (
        Column("label", "Method"),
        Column("less", f"-{percent}", unit, ".3g"),
        Column("right", "Right", unit, ".3g"),
        Column("more", f"+{percent}", unit, ".3g"),
        Column("guess", "Best guess", unit, ".3g"),
        Column("baseline", "Which"),
    )
    caption = f"{target}: RMS error with a wheel radius on paper that is off, the plant untouched"
    return Table(columns, tuple(rows), caption)
