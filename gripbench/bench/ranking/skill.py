"""Lines of a board in, the same with what each method adds to the best guess out.

A guess is a baseline: a constant, zero, an integral, a formula on paper. The yardstick of a board
is its best baseline, which reads none but the board's instruments.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pandas as pd

from gripbench.bench.ranking.grids import Grid

NO_BETTER = "no better than a guess"
"""Verdict on a method whose skill is not positive."""


def best_baseline(lines: pd.DataFrame) -> str:
    """Return the label of the baseline with the lowest score, empty where there is none."""
    ranked = lines[lines["baseline"].astype(bool) & lines["score"].notna()]
    return str(ranked.sort_values("score", kind="stable")["label"].iloc[0]) if len(ranked) else ""


def against_guess(
    lines: pd.DataFrame, runs: pd.DataFrame, wins: npt.NDArray[np.float64], grid: Grid
) -> pd.DataFrame:
    """Return the lines of a board with skill, verdict and shares of runs.

    Parameters
    ----------
    lines
        One line a method, from best to worst.
    runs
        RMS of each run (index scenario, seed) and method, columns in the order of the lines.
    wins
        Runs that the method of the row wins against that of the column.
    grid
        The runs of the board.

    Returns
    -------
    With the columns `skill` (one less the score over that of the best baseline), `verdict`,
    `beats_guess` and `beats_next` (share of the runs with a lower RMS than the best baseline and
    than the next method, half for a draw) and `worse_than_guess` (scenarios in which the pooled
    RMS is above that of the best baseline).
    """
    guess = best_baseline(lines)
    order = list(lines["label"])
    number = max(len(runs), 1)
    lines = lines.assign(
        skill=math.nan, verdict="", beats_guess=math.nan, beats_next=math.nan, worse_than_guess=""
    )
    lines["beats_next"] = [
        wins[i, i + 1] / number if i + 1 < len(order) else math.nan for i in range(len(order))
    ]
    if not guess:
        return lines
    place = order.index(guess)
    scores = lines["score"].to_numpy(float)
    by_guess = scores[place]
    pooled = _pooled(grid)
    for i, label in enumerate(order):
        if i != place:
            lines.loc[i, "beats_guess"] = wins[i, place] / number
        score = scores[i]
        if math.isnan(score):
            continue
        lines.loc[i, "skill"] = 1.0 - score / by_guess
        if not lines.loc[i, "baseline"] and score >= by_guess * (1.0 - 1e-9):
            lines.loc[i, "verdict"] = NO_BETTER
        if i != place:
            least = grid.measure.floor(grid.target)
            worse = pooled[label].clip(lower=least) > pooled[guess].clip(lower=least)
            lines.loc[i, "worse_than_guess"] = ", ".join(pooled.index[worse])
    return lines


def _pooled(grid: Grid) -> pd.DataFrame:
    """Return the pooled value by scenario and method, of the methods that finished every run."""
    measure = grid.measure
    good = grid.rows[grid.rows["label"].isin(grid.labels)]
    sums = good.groupby(["scenario", "label"])[[measure.total, measure.count]].sum()
    means = sums[measure.total] / sums[measure.count]
    return pd.DataFrame(means.pow(0.5 if measure.rooted else 1.0).unstack("label"))
