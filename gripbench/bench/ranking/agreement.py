"""Rows in; how far the order of methods on a recording is that of a population's board out.

The order is that of the scores of the methods that finished every run of both. Kendall's tau is 1
where both orders are the same, 0 where they have nothing in common, -1 where one is the other
turned round. Its interval resamples the drives of the population and, apart from them, the windows
of the recording: it says what other cars and other windows would give, not other methods.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd

from gripbench.bench.ranking import statistics
from gripbench.bench.ranking.degradation import without_faults
from gripbench.bench.ranking.grids import Grid, grid_of, on_board
from gripbench.bench.ranking.plans import level_of, plan_of
from gripbench.bench.running.recorded_scenarios import PREFIX
from gripbench.errors import InputError

FEWEST = 3
"""Methods without which an order says nothing."""


@dataclass(frozen=True)
class Agreement:
    """How far two orders of methods agree.

    Attributes
    ----------
    recording, population
        Scenario of the recording, and plan of the population.
    target
        Signal that is estimated.
    tau, low, high
        Kendall's tau-b with its interval; NaN where the runs are too few for one.
    p
        Chance of a tau as large if the orders had nothing in common.
    methods
        One line a method, the best on the recording first: `label, baseline, recording,
        population` with its RMS on the recording and its geometric mean RMS in the population.
    turned
        Pairs of methods in the one order on the recording and in the other in the population, each
        time significantly: the better one on the recording first.
    """

    recording: str
    population: str
    target: str
    tau: float
    low: float
    high: float
    p: float
    methods: pd.DataFrame
    turned: tuple[tuple[str, str], ...]


def agreements(
    rows: pd.DataFrame,
    targets: Iterable[str] = (),
    confidence: float = statistics.CONFIDENCE,
    resamples: int = statistics.RESAMPLES,
) -> list[Agreement]:
    """Return an agreement for each recording, population and target that three methods share.

    Parameters
    ----------
    rows
        Frame as `gripbench.read_rows` returns it: runs on recordings and on populations.
    targets
        Signals; empty: all.
    confidence, resamples
        Of the intervals, and of what is significant.

    Raises
    ------
    InputError
        If there are no runs of a recording, or none of a population.
    """
    rows = without_faults(rows)
    names = [str(name) for name in rows["scenario"].unique()]
    recorded = sorted(name for name in names if name.startswith(PREFIX))
    plans: dict[str, list[str]] = {}
    for name in names:
        if level_of(name):
            plans.setdefault(plan_of(name), []).append(name)
    for found, command in ((recorded, "--suite recordings"), (plans, "--suite lateral_population")):
        if not found:
            raise InputError(
                "an agreement is between recordings and populations: 'gripbench run "
                f"{command}' makes the runs that are missing"
            )
    wanted = [name for name in rows["target"].unique() if name and name in (set(targets) or {name})]
    found_ = []
    for recording in recorded:
        for plan, scenarios in sorted(plans.items()):
            for target in wanted:
                one = _agreement(rows, recording, plan, scenarios, target, confidence, resamples)
                if one is not None:
                    found_.append(one)
    return found_


def _agreement(
    rows: pd.DataFrame,
    recording: str,
    plan: str,
    scenarios: list[str],
    target: str,
    confidence: float,
    resamples: int,
) -> Agreement | None:
    good = rows[(rows["target"] == target) & (rows["status"] == "ok")]
    here = set(good.loc[good["scenario"] == recording, "label"])
    there = set(good.loc[good["scenario"].isin(scenarios), "label"])
    shared = rows[rows["label"].isin(here & there)]
    if len(here & there) < FEWEST:
        return None
    own = _grid(shared[shared["scenario"] == recording], target)
    drawn = _grid(shared[shared["scenario"].isin(scenarios)], target)
    labels = [label for label in own.labels if label in drawn.labels]
    if len(labels) < FEWEST:
        return None
    both = [_scores(grid, labels, seed, resamples) for seed, grid in enumerate((own, drawn))]
    tau, p = _tau(both[0].estimate, both[1].estimate)
    low, high = np.nan, np.nan
    if min(one.runs for one in both) > 1:
        taus = [_tau(*pair)[0] for pair in zip(both[0].replicates, both[1].replicates, strict=True)]
        low, high = np.quantile(taus, [0.5 - confidence / 2.0, 0.5 + confidence / 2.0])
    baseline = rows.drop_duplicates("label").set_index("label")["baseline"]
    methods = pd.DataFrame(
        {
            "label": labels,
            "baseline": [bool(baseline[label]) for label in labels],
            "recording": np.exp(both[0].estimate),
            "population": np.exp(both[1].estimate),
        }
    ).sort_values("recording", kind="stable", ignore_index=True)
    better = [statistics.adjusted_p_better(one) <= 1.0 - confidence for one in both]
    turned = tuple(
        (labels[i], labels[j]) for i, j in np.argwhere(better[0] & better[1].T) if i != j
    )
    return Agreement(recording, plan, target, tau, float(low), float(high), p, methods, turned)


def _grid(rows: pd.DataFrame, target: str) -> Grid:
    lines, notes = max(on_board(rows, target), key=lambda part: len(part[0]))
    return grid_of(lines, target, notes)


def _scores(grid: Grid, labels: list[str], seed: int, resamples: int) -> statistics.Scores:
    places = [grid.labels.index(label) for label in labels]
    return statistics.mean_log_rms(
        grid.totals[:, :, places],
        grid.counts[:, :, places],
        grid.single_values[:, places],
        resamples,
        seed,
        grid.measure.floor(grid.target),
    )


def _tau(first: npt.NDArray[np.float64], second: npt.NDArray[np.float64]) -> tuple[float, float]:
    """Return Kendall's tau-b and its one-sided p-value; scores equal but for rounding are ties."""
    from scipy.stats import kendalltau  # slow to import

    digits = -round(np.log10(statistics.INDISTINGUISHABLE))
    rounded = (np.round(first, digits), np.round(second, digits))
    found = kendalltau(*rounded, alternative="greater")
    return float(found.statistic), float(found.pvalue)
