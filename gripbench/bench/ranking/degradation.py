"""Degradation by faults: from rows of faulty runs and their clean twins to one line a fault.

Every faulty run stands beside the run of the same scenario, level and seed without the fault; only
pairs count.
"""

from __future__ import annotations

import math

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
    Columns `target, label, fault, pairs, ratio, recovery, lost`: number of pairs, geometric mean
    over scenarios of the RMS error over that of the clean twins, median time [s] from the fault's
    end until the error is again what it is without (inf: not within the run), and runs that fail
    with the fault but not without.
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
                "pairs": len(part),
                "ratio": _geometric_mean(ratios),
                "recovery": float(times.median()) if len(times) else math.nan,
                "lost": int(lost.sum()),
            }
        )
    columns = ["target", "label", "fault", "pairs", "ratio", "recovery", "lost"]
    return pd.DataFrame(lines, columns=columns)


def _geometric_mean(ratios: list[float]) -> float:
    if not ratios:
        return math.nan
    with np.errstate(divide="ignore"):
        return float(np.exp(np.mean(np.log(ratios))))
