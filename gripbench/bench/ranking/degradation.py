"""Degradation by faults: from rows of faulty runs and their clean twins to one line a fault.

Every faulty run stands beside the run of the same scenario, level and seed without the fault; only
pairs count.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cache

import numpy as np
import pandas as pd

from gripbench.bench.scoring.recovery import RECOVERY
from gripbench.envs.instruments.faults import split_faults


def degradation(frame: pd.DataFrame) -> pd.DataFrame:
    """Return what each fault does to each method.

    Parameters
    ----------
    frame
        From `gripbench.bench.running.rows.frame_of`, clean and faulty runs.

    Returns
    -------
    Columns `target, label, fault, kind, severity, pairs, ratio, recovered, recovery, lost`: the
    fault as it was named, its kind and severity (0 where several act together), number of pairs,
    geometric mean over scenarios of the RMS error over that of the clean twins, share of the runs
    in which the error becomes again what it is without, median time [s] from the fault's end until
    then (inf: not within the run), and runs that fail with the fault but not without.
    """
    plain = frame.assign(
        clean=[split_faults(name)[0] for name in frame["scenario"]],
        fault=["+".join(split_faults(name)[1]) for name in frame["scenario"]],
    )
    keys = ["clean", "seed", "label", "target"]
    faulty = plain[(plain["fault"] != "") & (plain["target"] != "")]
    twins = plain[(plain["fault"] == "") & (plain["status"] == "ok")]
    pairs = faulty.merge(
        twins[[*keys, "sum_of_squares", "count"]], on=keys, suffixes=("", "_clean")
    )
    lines = []
    for (target, label, fault), part in pairs.groupby(["target", "label", "fault"], sort=False):
        lost = ~part["status"].isin(["ok", "skipped"])
        held = part[part["status"] == "ok"]
        ratios = []
        for _, one in held.groupby("clean", sort=False):
            ours = one["sum_of_squares"].sum() / max(one["count"].sum(), 1)
            theirs = one["sum_of_squares_clean"].sum() / max(one["count_clean"].sum(), 1)
            if theirs > 0.0:
                ratios.append(math.sqrt(ours / theirs))
        times = held[RECOVERY].dropna() if RECOVERY in held else pd.Series(dtype=float)
        lines.append(
            {
                "target": target,
                "label": label,
                "fault": fault,
                **_kind(str(fault)),
                "pairs": len(part),
                "ratio": geometric_mean(ratios),
                "recovered": float(np.isfinite(times).mean()) if len(times) else math.nan,
                "recovery": float(times.median()) if len(times) else math.nan,
                "lost": int(lost.sum()),
            }
        )
    return pd.DataFrame(lines, columns=COLUMNS)


COLUMNS = [
    "target", "label", "fault", "kind", "severity", "pairs", "ratio", "recovered", "recovery",
    "lost",
]  # fmt: skip
"""Of the table of degradation."""


def without_faults(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of runs without faults; all of them where every run has one."""
    clean = ~rows["scenario"].map(_is_faulty).astype(bool)
    return rows[clean] if clean.any() else rows


@cache
def _is_faulty(scenario: str) -> bool:
    return bool(split_faults(scenario)[1])


def _kind(fault: str) -> dict[str, str | int]:
    """Return kind and severity of a fault; the channel belongs to the kind."""
    if "+" in fault:
        return {"kind": fault, "severity": 0}
    name, severity, *channel = fault.split(":")
    return {"kind": ":".join((name, *channel)), "severity": int(severity)}


def geometric_mean(ratios: Iterable[float]) -> float:
    """Return the geometric mean of what is known; NaN where nothing is."""
    known = np.asarray(list(ratios), float)
    known = known[~np.isnan(known)]
    if not len(known):
        return math.nan
    with np.errstate(divide="ignore"):
        return float(np.exp(np.log(known).mean()))
