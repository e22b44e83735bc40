"""Bounds in, a table of what is least for each scenario out, or one line a sample."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from gripbench.bench.bounds.bound import KNOWABLE, Bound
from gripbench.bench.publishing.columns import Column, Table
from gripbench.envs.signals import signal


def bound_table(found: dict[str, list[Bound]], missing: dict[str, str]) -> Table:
    """Return one row for each scenario, target and set of sensors, pooled over its seeds.

    Parameters
    ----------
    found
        Bounds by the name of their set of sensors.
    missing
        Why a scenario has none.
    """
    rows: list[dict[str, Any]] = []
    for name, bounds in found.items():
        groups: dict[tuple[str, str], list[Bound]] = {}
        for bound in bounds:
            groups.setdefault((bound.scenario, bound.target), []).append(bound)
        rows += [
            {"scenario": scenario, "target": target, "sensors": name, **_pooled(target, group)}
            for (scenario, target), group in groups.items()
        ]
    rows.sort(key=lambda row: list(dict.fromkeys(b.scenario for f in found.values() for b in f))
              .index(row["scenario"]))  # fmt: skip
    columns = (
        Column("scenario", "Scenario"),
        Column("target", "Target"),
        Column("sensors", "Sensors"),
        Column("rms", "Bound", format=".3g"),
        Column("prior", "Without sensors", format=".3g"),
        Column("unit", "Unit"),
        Column("known", "Known", "% of the drive", ".0f"),
        Column("runs", "Seeds", format="d"),
    )
    notes = [
        "Bound: least RMS error of any estimate, pooled over the seeds. Known: share of the drive "
        f"in which it is below {KNOWABLE:g} of what is known without sensors.",
        *(f"{name}: n/a: {reason}." for name, reason in missing.items()),
    ]
    if any(row["rms"] == 0.0 for row in rows):
        notes.append("0: nothing of the target is drawn, or a sensor without error gives it.")
    return Table(columns, tuple(rows), caption="Posterior Cramer-Rao bound", notes=tuple(notes))


def _pooled(target: str, group: list[Bound]) -> dict[str, Any]:
    factor = signal(target).display_factor
    return {
        "rms": factor * pooled([bound.rms for bound in group], group),
        "prior": factor * pooled([bound.prior for bound in group], group),
        "unit": signal(target).display_unit,
        "known": 100.0 * float(np.mean([bound.knowable_share for bound in group])),
        "runs": len(group),
    }


def pooled(values: list[float], group: list[Bound]) -> float:
    """Return the root of the mean square over all samples that count of several runs."""
    counts = [float(bound.scored.sum()) for bound in group]
    squares = [value**2 * count for value, count in zip(values, counts, strict=True)]
    return math.sqrt(sum(squares) / sum(counts))


def bound_frame(found: dict[str, list[Bound]]) -> pd.DataFrame:
    """Return one line a sample, in SI units: of what, time, and what holds then."""
    parts = [
        pd.DataFrame(
            {
                "scenario": bound.scenario,
                "seed": bound.seed,
                "target": bound.target,
                "sensors": name,
                "time": bound.time,
                "truth": bound.truth,
                "bound": bound.deviation,
                "information_rate": bound.gained,
                "known": bound.knowable,
            }
        )
        for name, bounds in found.items()
        for bound in bounds
    ]
    return pd.concat(parts, ignore_index=True)
