"""The runs of a method on a board in, its pooled error, metrics, runtimes and failures out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from gripbench.bench.ranking import statistics
from gripbench.bench.ranking.grids import instruments
from gripbench.bench.ranking.measures import SILENT as SILENT_STATUS
from gripbench.bench.ranking.summary import outside_of, over_prefixes_of, training_of
from gripbench.bench.scoring.consistency import SILENT, RunsTest, runs_test
from gripbench.bench.scoring.metric import Metric, pooled_rms
from gripbench.bench.scoring.metrics import metrics


@dataclass(frozen=True)
class Settings:
    """How a board is ranked, see `gripbench.bench.ranking.ranking.rank`."""

    reference: str
    confidence: float
    resamples: int
    seed: int


def method_line(group: pd.DataFrame, complete: bool, settings: Settings) -> dict[str, Any]:
    """Return what a method did over its runs on the board; no scores unless it finished all."""
    first = group.iloc[0]
    good = group[group["status"] == "ok"]
    bad = group[group["status"] != "ok"]
    by_seed = good.groupby("seed")[["sum_of_squares", "count"]].sum()
    low, high = statistics.pooled_rms_interval(
        by_seed["sum_of_squares"] if complete else [],
        by_seed["count"] if complete else [],
        settings.confidence,
        settings.resamples,
        settings.seed,
    )
    line: dict[str, Any] = {
        name: first[name]
        for name in ("label", "method", "variant", "title", "idealised", "baseline")
    }
    line |= {
        "computed_outside": bool(outside_of(group).any()),
        **dict(zip(("training", "training_time"), training_of(group), strict=True)),
        "over_prefixes": over_prefixes_of(group),
        "reads": ", ".join(instruments(first["sensors"])),
        "rms": pooled_rms(good["sum_of_squares"], good["count"]) if complete else np.nan,
        "rms_from": low,
        "rms_to": high,
        "step_batch": good["step_batch"].astype(float).median(),
        "step_p50": good["step_p50"].astype(float).median(),
        "step_p99": good["step_p99"].astype(float).median(),
        "step_max": good["step_max"].astype(float).max(),
        "deadline_misses": good["deadline_misses"].astype(float).mean(),
        "reason": "" if complete else _reason(bad),
    }
    line |= uncertainty(group, settings.confidence)
    for metric in metrics().values():
        if metric.name != "rms":
            line |= _pooled(metric, good if complete else good.iloc[:0])
    return line


def uncertainty(group: pd.DataFrame, confidence: float) -> dict[str, Any]:
    """Return the verdict on what a method states of its errors, and the band of a consistent one.

    The runs of one seed count as one: they have the same streams of the sensors. A method with a
    run that failed has no verdict.
    """
    verdict, low, high = "n/a", np.nan, np.nan
    test = tested(group, "mean_nees", confidence)
    if test is not None:
        verdict, low, high = test.verdict, test.low, test.high
    elif group["status"].isin(["ok", SILENT_STATUS]).all() and not states(group):
        verdict = SILENT
    return {"uncertainty": verdict, "nees_low": low, "nees_high": high}


def states(group: pd.DataFrame) -> bool:
    """Return whether a method states anything of its errors in these runs."""
    return "crps" in group and bool(group["crps"].notna().any())


def tested(group: pd.DataFrame, metric: str, confidence: float) -> RunsTest | None:
    """Return the test of a metric of normalised squares over runs, seeds as the unit.

    None where a run failed or has no value.
    """
    columns = [f"{metric}_total", f"{metric}_count"]
    if not {metric, *columns} <= set(group) or group[metric].isna().any():
        return None
    sums = group.groupby("seed")[columns].sum()
    return runs_test(sums[columns[0]], sums[columns[1]], confidence)


def _pooled(metric: Metric, good: pd.DataFrame) -> dict[str, float]:
    """Return a metric over the runs of a method, and in which share of them it is reached."""
    if not set(metric.columns) <= set(good):  # rows of a frame that was read without the metric
        good = good.iloc[:0].reindex(columns=list(metric.columns))
    values = [good[name].to_numpy(float) for name in metric.columns]
    found = {metric.name: metric.pooled(*values)}
    if metric.reached:
        known = values[0][~np.isnan(values[0])]
        found[metric.reached] = float(np.isfinite(known).mean()) if len(known) else np.nan
    return found


def _reason(bad: pd.DataFrame) -> str:
    """Return the most frequent status and reason of the failures."""
    if bad.empty:
        return "not run in every scenario"
    texts = bad["status"].astype(str) + ": " + bad["reason"].astype(str)
    return str(texts.value_counts(sort=True).index[0]).removesuffix(": ")
