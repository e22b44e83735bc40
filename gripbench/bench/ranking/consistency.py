"""Rows in; for each target, scenario and method what it states of its errors, and whether it is so.

Two tests stand side by side. NEES holds the errors against the stated distribution, and needs the
truth; NIS and whiteness hold a filter's innovations against what the filter expects of them, and a
vehicle can watch them too. A filter can pass the second and fail the first: it fits its readings
with a wrong model.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import pandas as pd

from gripbench.bench.ranking.degradation import without_faults
from gripbench.bench.ranking.method_lines import tested, uncertainty
from gripbench.bench.ranking.plans import plan_of
from gripbench.bench.scoring.consistency import RunsTest
from gripbench.bench.scoring.metrics import metrics
from gripbench.errors import InputError, unknown

POOLED = (
    "crps", "coverage_50", "coverage_90", "coverage_95", "sharpness", "innovation_correlation",
    "white_innovations",
)  # fmt: skip
"""Metrics that stand beside the two tests."""

COLUMNS = (
    "target", "plan", "scenario", "label", "runs", "verdict", "factor", "factor_from", "factor_to",
    "nees", "nees_low", "nees_high", *POOLED[:5], "nis", "nis_low", "nis_high", "nis_verdict",
    *POOLED[5:],
)  # fmt: skip


def consistency(
    rows: pd.DataFrame,
    target: str | Iterable[str] = (),
    by_scenario: bool = False,
    confidence: float = 0.95,
) -> pd.DataFrame:
    """Say of each method whether its errors are as large as it says.

    Parameters
    ----------
    rows
        Frame as `gripbench.run` or `gripbench.read_rows` returns it.
    target
        Signal or signals that are estimated; empty: all.
    by_scenario
        Whether each scenario has lines of its own; else a plan's scenarios are pooled, and the
        runs of one seed are one.
    confidence
        Probability of the bands of a consistent filter.

    Returns
    -------
    One line a target, plan (or scenario) and method, with `COLUMNS`. `verdict` is consistent,
    overconfident or cautious by a factor, `says nothing` for a method that states no uncertainty,
    `n/a` where a run failed or lacks a value. `factor` is the ratio of the errors to the stated
    deviation with its interval, `nees_low` and `nees_high` the band of a consistent filter;
    `nis...` are the same of the innovations, empty where none are shown. Runs with faults count in
    scenarios of their own alone.

    Raises
    ------
    InputError
        If `confidence` is not between 0.5 and 1, or no row has a target.
    """
    if not 0.5 <= confidence < 1.0:
        raise InputError(f"confidence is {confidence:g}; it must be from 0.5 to below 1")
    rows = rows if by_scenario else without_faults(rows)
    known = [str(name) for name in rows["target"].unique() if name]
    chosen = ([target] if isinstance(target, str) else list(target)) or known
    for name in chosen:
        if name not in known:
            raise unknown("target", name, known)
    ran = rows[(rows["status"] != "skipped") & rows["target"].isin(chosen)]
    ran = ran.assign(plan=[plan_of(str(name)) or str(name) for name in ran["scenario"]])
    lines: list[dict[str, Any]] = []
    place = ["plan", "scenario"] if by_scenario else ["plan"]
    for key, group in ran.groupby(["target", *place, "label"], sort=False):
        named = dict(zip(["target", *place, "label"], key, strict=True))
        lines.append({"scenario": "", **named, **_line(group, confidence)})
    found = pd.DataFrame(lines, columns=list(COLUMNS))
    return found.sort_values(["target", "plan", "scenario", "label"], ignore_index=True)


def _line(group: pd.DataFrame, confidence: float) -> dict[str, Any]:
    nees, nis = tested(group, "mean_nees", confidence), tested(group, "mean_nis", confidence)
    low, high = nees.factor_interval if nees else (math.nan, math.nan)
    return {
        "runs": len(group),
        "verdict": uncertainty(group, confidence)["uncertainty"],
        "factor": nees.factor if nees else math.nan,
        "factor_from": low,
        "factor_to": high,
        **_band("nees", nees),
        **_band("nis", nis),
        "nis_verdict": nis.verdict if nis else "",
        **{name: _pooled(group, name) for name in POOLED},
    }


def _band(name: str, test: RunsTest | None) -> dict[str, float]:
    if test is None:
        return dict.fromkeys((name, f"{name}_low", f"{name}_high"), math.nan)
    return {name: test.mean, f"{name}_low": test.low, f"{name}_high": test.high}


def _pooled(group: pd.DataFrame, name: str) -> float:
    metric = metrics()[name]
    if not set(metric.columns) <= set(group):  # rows of a frame without the metric
        return math.nan
    return metric.pooled(*(group[column].to_numpy(float) for column in metric.columns))
