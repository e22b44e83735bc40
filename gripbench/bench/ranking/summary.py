"""What a set of rows amounts to: pooled RMS with its interval for each cell, and what failed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from gripbench.bench.ranking.statistics import CONFIDENCE, draws, pooled_rms_interval
from gripbench.bench.scoring.metric import pooled_rms

if TYPE_CHECKING:
    import pandas as pd


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Return one line for each scenario, target and method.

    Parameters
    ----------
    rows
        As `gripbench.run` or `gripbench.read_rows` returns them.

    Returns
    -------
    Frame with the columns `scenario, target, label, idealised, computed_outside, training,
    training_time, over_prefixes, runs, ok, status, rms, low, high`:
    `rms` is pooled over the runs that are `ok` by the mean of squares, `low` and `high` bound its
    95 % interval (over runs, see `statistics.pooled_rms_interval`), `status` counts the others.
    For the available friction also, over the runs that are excited, `excited, excited_rms,
    excited_low, excited_high` (number of these runs, RMS from the first excitation on), `settled,
    delay, delay_low, delay_high` (number of runs that settle, mean of their delays [s]) and, where
    the friction jumps, `jumps, jump_settled, jump_delay, jump_low, jump_high` alike.
    """
    lines: list[dict[str, Any]] = []
    for (scenario, target, label), group in rows.groupby(
        ["scenario", "target", "label"], sort=False
    ):
        good = group[group["status"] == "ok"].sort_values("seed")
        squares = good["sum_of_squares"].to_numpy(float)
        counts = good["count"].to_numpy(float)
        low, high = pooled_rms_interval(squares, counts)
        others = group.loc[group["status"] != "ok", "status"].value_counts().sort_index()
        lines.append(
            {
                "scenario": scenario,
                "target": target,
                "label": label,
                "idealised": str(group["idealised"].iloc[0]),
                "computed_outside": bool(outside_of(group).any()),
                **dict(zip(("training", "training_time"), training_of(group), strict=True)),
                "over_prefixes": over_prefixes_of(group),
                "runs": len(group),
                "ok": len(good),
                "status": ", ".join(f"{count} {status}" for status, count in others.items()),
                "rms": pooled_rms(squares, counts),
                "low": low,
                "high": high,
                **_friction(good),
            }
        )
    columns = (
        "scenario", "target", "label", "idealised", "computed_outside", "training",
        "training_time", "over_prefixes", "runs", "ok", "status",
        "rms", "low", "high",
        "excited", "excited_rms", "excited_low", "excited_high",
        "settled", "delay", "delay_low", "delay_high",
        "jumps", "jump_settled", "jump_delay", "jump_low", "jump_high",
    )  # fmt: skip
    import pandas as pd

    return pd.DataFrame(lines, columns=list(columns))


def _friction(good: pd.DataFrame) -> dict[str, Any]:
    """Return what a summary says of the response of the friction, of runs that are `ok`."""
    if "friction_delay" not in good:
        return {}
    excited = good[good["friction_delay"].notna()]
    squares = excited["excited_rms_total"].to_numpy(float)
    counts = excited["excited_rms_count"].to_numpy(float)
    low, high = pooled_rms_interval(squares, counts)
    found: dict[str, Any] = {
        "excited": len(excited),
        "excited_rms": pooled_rms(squares, counts),
        "excited_low": low,
        "excited_high": high,
    }
    delays = excited["friction_delay"].to_numpy(float)
    found["settled"], *mean = _mean_of_settled(delays)
    found |= dict(zip(("delay", "delay_low", "delay_high"), mean, strict=True))
    jumped = good.loc[good["jump_delay"].notna(), "jump_delay"].to_numpy(float)
    found["jumps"] = len(jumped)
    found["jump_settled"], *mean = _mean_of_settled(jumped)
    return found | dict(zip(("jump_delay", "jump_low", "jump_high"), mean, strict=True))


def _mean_of_settled(delays: np.ndarray) -> tuple[int, float, float, float]:
    """Return how many delays are finite, their mean and its 95 % interval by bootstrap."""
    finite = delays[np.isfinite(delays)]
    if not len(finite):
        return 0, math.nan, math.nan, math.nan
    mean = float(finite.mean())
    if len(finite) < 2:
        return 1, mean, math.nan, math.nan
    means = draws(len(finite)) @ finite / len(finite)
    low, high = np.quantile(means, [0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2])
    return len(finite), mean, float(low), float(high)


def over_prefixes_of(rows: pd.DataFrame) -> bool:
    """Return whether the method of these rows takes whole recordings; old rows know of none."""
    return "over_prefixes" in rows and bool(rows["over_prefixes"].astype(bool).any())


def training_of(rows: pd.DataFrame) -> tuple[str, float]:
    """Return how the method of these rows was trained, and how long it took [s]; old rows: `""`."""
    if "training" not in rows:
        return "", math.nan
    said = [text for text in rows["training"].fillna("").astype(str) if text]
    return (said[-1] if said else ""), float(rows["training_time"].astype(float).median())


def outside_of(rows: pd.DataFrame) -> pd.Series:
    """Return for each row whether its estimates were handed in; a frame of old rows knows none."""
    if "computed_outside" not in rows:
        return rows["label"].map(lambda _: False).astype(bool)
    return rows["computed_outside"].astype(bool)


def not_run(rows: pd.DataFrame) -> dict[str, str]:
    """Return the scenarios in which no method ran for one and the same reason, with the reason.

    So are recordings of which no file is at hand: that says nothing of any method.
    """
    found = {}
    for scenario, part in rows.groupby("scenario", sort=False):
        if (part["status"] == "skipped").all() and part["reason"].nunique() == 1:
            found[str(scenario)] = str(part["reason"].iloc[0])
    return found


def failures(rows: pd.DataFrame) -> pd.DataFrame:
    """Return what is not `ok`: one line for each scenario, method, status and reason."""
    bad = rows[rows["status"] != "ok"].drop_duplicates(["scenario", "label", "seed"])
    grouped = bad.groupby(["status", "scenario", "label", "reason"], sort=False)["seed"]
    return grouped.agg(runs="size", first_seed="min").reset_index()


MEASURED = (
    "step_batch", "step_p50", "step_p99", "step_max", "deadline_misses", "training_time"
)  # fmt: skip
"""Columns that differ from one run of the same cell to the next."""


def scores_csv(rows: pd.DataFrame) -> str:
    """Return rows as CSV without what was measured: the same bytes for the same cells."""
    usual = [name for name in ("salt", "over_prefixes") if not rows[name].astype(bool).any()]
    text: str = rows.drop(columns=[*MEASURED, *usual]).to_csv(index=False, lineterminator="\n")
    return text
