"""What a set of rows amounts to: pooled RMS with its interval for each cell, and what failed."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pandas as pd

from gripbench.bench.rows import pooled_rms

CONFIDENCE = 0.95
RESAMPLES = 2000
MARK = "†"
"""Follows the name of a method that reads a channel which no sensor in a vehicle gives."""

FOOTNOTE = f"{MARK} reads an idealised channel, which no sensor in a vehicle gives"


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Return one line for each scenario, target and method.

    Parameters
    ----------
    rows
        As `gripbench.run` or `gripbench.read_rows` returns them.

    Returns
    -------
    Frame with the columns `scenario, target, label, idealised, runs, ok, status, rms, low, high`:
    `rms` is pooled over the runs that are `ok` by the mean of squares, `low` and `high` bound its
    95 % interval (percentile bootstrap over runs, never over samples), `status` counts the others.
    """
    lines: list[dict[str, Any]] = []
    for (scenario, target, label), group in rows.groupby(
        ["scenario", "target", "label"], sort=False
    ):
        good = group[group["status"] == "ok"].sort_values("seed")
        squares = good["sum_of_squares"].to_numpy(float)
        counts = good["count"].to_numpy(float)
        low, high = interval(squares, counts)
        others = group.loc[group["status"] != "ok", "status"].value_counts().sort_index()
        lines.append(
            {
                "scenario": scenario,
                "target": target,
                "label": label,
                "idealised": str(group["idealised"].iloc[0]),
                "runs": len(group),
                "ok": len(good),
                "status": ", ".join(f"{count} {status}" for status, count in others.items()),
                "rms": pooled_rms(squares, counts),
                "low": low,
                "high": high,
            }
        )
    columns = (
        "scenario", "target", "label", "idealised", "runs", "ok", "status", "rms", "low", "high",
    )  # fmt: skip
    return pd.DataFrame(lines, columns=list(columns))


def interval(squares: np.ndarray, counts: np.ndarray) -> tuple[float, float]:
    """Return the 95 % interval of a pooled RMS by bootstrap over runs, NaN below two runs.

    Parameters
    ----------
    squares, counts
        Sum of squared errors and number of samples of each run, shape (n,).
    """
    if len(squares) < 2:
        return math.nan, math.nan
    if np.ptp(squares / counts) == 0.0:  # a deterministic scenario: nothing to resample
        value = pooled_rms(squares, counts)
        return value, value
    weights = _resampling(len(squares))
    pooled = np.sqrt((weights @ squares) / (weights @ counts))
    low, high = np.quantile(pooled, [0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2])
    return float(low), float(high)


@cache
def _resampling(runs: int) -> np.ndarray:
    """Return how often each run is drawn in each resample: the same draws for every cell."""
    generator = np.random.default_rng(0)
    drawn: np.ndarray = generator.multinomial(runs, np.full(runs, 1.0 / runs), size=RESAMPLES)
    return drawn.astype(np.float64)


def marked(label: str, idealised: str | tuple[str, ...]) -> str:
    """Return a method's label, marked if it reads an idealised channel."""
    return label + MARK if idealised else label


def failures(rows: pd.DataFrame) -> pd.DataFrame:
    """Return what is not `ok`: one line for each scenario, method, status and reason."""
    bad = rows[rows["status"] != "ok"].drop_duplicates(["scenario", "label", "seed"])
    grouped = bad.groupby(["status", "scenario", "label", "reason"], sort=False)["seed"]
    return grouped.agg(runs="size", first_seed="min").reset_index()


MEASURED = ("step_batch", "step_p50", "step_p99", "step_max", "deadline_misses")
"""Columns that differ from one run of the same cell to the next."""


def scores_csv(rows: pd.DataFrame) -> str:
    """Return rows as CSV without what was measured: the same bytes for the same cells."""
    text: str = rows.drop(columns=list(MEASURED)).to_csv(index=False, lineterminator="\n")
    return text
