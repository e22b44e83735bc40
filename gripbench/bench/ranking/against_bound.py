"""Lines of a board and stored bounds in, how far each method is from the least error out.

A method whose errors are smaller than any estimate's of these sensors can be has seen what it may
not see, or the car's own values. Of an estimate at the bound the mean of N runs' squared error over
the bound's variance spreads as chi-squared over N with N degrees of freedom at most (an error that
stays the same all through a run), so below its lower quantile nothing honest is left.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pandas as pd

from gripbench.bench.bounds.stored import EVERYTHING, Stored
from gripbench.bench.ranking.grids import Grid, salts_of, sensor_sets
from gripbench.envs.hidden_draws import salt_digest

COLUMNS = ("bound", "bound_ratio", "known", "below_bound", "bound_runs")


def against_bound(
    lines: pd.DataFrame,
    grid: Grid,
    sensors: tuple[str, ...] | None,
    stored: Stored,
    confidence: float,
) -> pd.DataFrame:
    """Return the lines of a board with what the bound says of each method.

    Parameters
    ----------
    lines
        One line a method.
    grid
        The runs of the board.
    sensors
        Instruments of the board; None: any.
    stored
        Bounds.
    confidence
        With which a method is said to be below the bound.

    Returns
    -------
    With the columns `bound` (least RMS of any estimate, pooled over those of the board's runs whose
    bound is stored), `bound_ratio` (geometric mean over the scenarios of the RMS in these runs over
    the bound's), `known` (share of these drives in which the target can be known), `bound_runs`
    (their number) and `below_bound` (scenarios in which a method is below what the sensors allow,
    `all together` where it is so over all of them; empty: nowhere).
    """
    stored = {} if _drawn_otherwise(grid.rows) else stored
    text = EVERYTHING if sensors is None else ", ".join(sensors)
    cells = grid.rows[["scenario", "seed"]].drop_duplicates()
    least = {
        (name, seed): found
        for name, seed in zip(cells["scenario"], cells["seed"], strict=True)
        if (found := stored.get((name, int(seed), text, grid.target))) is not None
    }
    lines = lines.assign(
        bound=math.nan, bound_ratio=math.nan, known=math.nan, below_bound="", bound_runs=len(least)
    )
    if not least:
        return lines
    rows = grid.rows[(grid.rows["status"] == "ok") & grid.rows["label"].isin(grid.labels)]
    rows = rows.assign(
        least=[
            found.mean_square if (found := least.get((name, seed))) else math.nan
            for name, seed in zip(rows["scenario"], rows["seed"], strict=True)
        ]
    )
    rows = rows[rows["least"].notna()]
    lines["bound"] = _pooled(rows)
    lines["known"] = float(np.mean([one.known for one in least.values()]))
    for label, own in rows.groupby("label"):
        place = lines["label"] == label
        ratios = _ratios(own)
        if len(ratios) and np.isfinite(ratios).all():
            lines.loc[place, "bound_ratio"] = float(np.exp(np.mean(np.log(ratios))))
        lines.loc[place, "below_bound"] = _below(own, confidence)
    return lines


def _drawn_otherwise(rows: pd.DataFrame) -> bool:
    """Return whether rows come from other draws than bounds do: of another secret, or of none."""
    return any(salt != salt_digest() for salt in salts_of(rows))


def _pooled(rows: pd.DataFrame) -> float:
    """Return the bound over the runs of one method: all have the same."""
    own = rows[rows["label"] == rows["label"].iloc[0]] if len(rows) else rows
    total = float((own["least"] * own["count"]).sum())
    return math.sqrt(total / float(own["count"].sum())) if len(own) else math.nan


def _ratios(own: pd.DataFrame) -> np.ndarray:
    """Return RMS over the bound's by scenario, where the bound is not zero."""
    sums = (
        own.assign(allowed=own["least"] * own["count"])
        .groupby("scenario")[["sum_of_squares", "allowed"]]
        .sum()
    )
    sums = sums[sums["allowed"] > 0.0]
    return np.sqrt((sums["sum_of_squares"] / sums["allowed"]).to_numpy(float)).clip(min=1e-12)


def _below(own: pd.DataFrame, confidence: float) -> str:
    """Return where a method's errors are smaller than any can be."""
    from scipy.stats import chi2  # slow to import

    own = own[own["least"] > 0.0]
    if own.empty:
        return ""
    squares = own["sum_of_squares"] / own["count"] / own["least"]
    groups = squares.groupby(own["scenario"])
    level = 0.5 * (1.0 - confidence) / (1 + len(groups))  # of every claim, so that all hold
    found = [str(name) for name, part in groups if part.sum() < chi2.ppf(level, len(part))]
    if squares.sum() < chi2.ppf(level, len(squares)):
        found = ["all together", *found]
    return ", ".join(found)


def least_by_scenario(stored: Stored, target: str, rows: pd.DataFrame) -> dict[str, float]:
    """Return the least RMS that all sensors together allow, pooled over the stored seeds."""
    stored = {} if _drawn_otherwise(rows) else stored
    squares: dict[str, list[float]] = {}
    present = set(rows["scenario"])
    for (name, _, text, of), least in stored.items():
        if of == target and text == EVERYTHING and name in present:
            squares.setdefault(name, []).append(least.mean_square)
    return {name: math.sqrt(float(np.mean(each))) for name, each in squares.items()}


def wanted_bounds(
    rows: pd.DataFrame, targets: Iterable[str], chosen: Iterable[int]
) -> dict[str, tuple[set[int], set[str], set[str]]]:
    """Return what boards need: seeds, sets of instruments and targets by scenario.

    Parameters
    ----------
    rows
        Stored rows.
    targets
        Signals to rank by.
    chosen
        Seeds; of each scenario those that were run.
    """
    allowed = set(chosen)
    found: dict[str, tuple[set[int], set[str], set[str]]] = {}
    ran = rows[rows["status"] != "skipped"]
    for target in targets:
        own = ran[ran["target"] == target]
        texts = {EVERYTHING, *(", ".join(names) for names in sensor_sets(own))}
        for name, part in own.groupby("scenario"):
            seeds, sets, aims = found.setdefault(str(name), (set(), set(), set()))
            seeds |= allowed & set(map(int, part["seed"].unique()))
            sets |= texts
            aims.add(target)
    return found
