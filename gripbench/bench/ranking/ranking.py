"""Rank methods, with the confidence that the runs allow.

One board for each target and each set of instruments (see `ranking.grids`). The score of
a method is the geometric mean over the scenarios of its pooled RMS, relative to the same of a
reference: by default the geometric mean of all methods on the board that finished every run. Ranks
and claims do not depend on that reference. A method that failed a run ranks behind all that
did not, and the more it failed the further behind.

See docs/ranking.md for what is computed, and `gripbench.bench.ranking.statistics` for how.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from gripbench.bench.bounds.stored import Stored
from gripbench.bench.ranking import statistics
from gripbench.bench.ranking.against_bound import against_bound
from gripbench.bench.ranking.degradation import without_faults
from gripbench.bench.ranking.grids import (
    ANY,
    Grid,
    chosen_instruments,
    grid_of,
    on_board,
    salts_of,
    sensor_sets,
)
from gripbench.bench.ranking.log_windows import scored_windows
from gripbench.bench.ranking.measures import RMS, measure_of
from gripbench.bench.ranking.method_lines import Settings, method_line
from gripbench.bench.ranking.pareto import pareto_front
from gripbench.bench.ranking.plans import hiding_of, plan_of
from gripbench.bench.ranking.skill import against_guess, best_baseline
from gripbench.bench.running.recorded_scenarios import PREFIX
from gripbench.bench.scoring.metrics import metrics
from gripbench.errors import InputError, unknown

_BEFORE = (
    "target", "sensors", "by", "rank", "rank_from", "rank_to", "group", "label", "method",
    "variant", "title", "reads", "idealised", "baseline", "computed_outside", "training",
    "over_prefixes",
    "score", "score_from", "score_to", "elsewhere_from", "elsewhere_to", "skill", "verdict",
    "beats_guess", "beats_next", "worse_than_guess", "uncertainty", "nees_low", "nees_high",
    "rms", "rms_from", "rms_to", "bound", "bound_ratio", "known", "bound_runs", "below_bound",
)  # fmt: skip
_SCORES = ("score", "score_from", "score_to", "elsewhere_from", "elsewhere_to")
_BEHIND = (
    "training_time", "step_batch", "step_p50", "step_p99", "step_max", "deadline_misses", "pareto",
    "failures", "reason", "cells", "seeds", "scenarios", "salt",
)  # fmt: skip


def columns() -> tuple[str, ...]:
    """Return the columns of a ranking; docs/ranking.md describes each.

    Each metric has one of its name, and one of the share of runs in which it is reached.
    """
    pooled = (
        name
        for metric in metrics().values()
        for name in (metric.reached, metric.name)
        if name and name != "rms"
    )
    return (*_BEFORE, *pooled, *_BEHIND)


@dataclass(frozen=True)
class Board:
    """A ranking of the methods that estimate one target with one set of instruments.

    Attributes
    ----------
    target
        Signal that is estimated.
    sensors
        Instruments that a method on this board may read; empty with `ANY`.
    title
        Target and instruments in words, and the scenarios where another board has the same.
    confidence
        Confidence of all its claims together, and of each interval.
    scenarios
        Names of the scenarios.
    seeds
        Seeds common to all methods.
    lines
        One line a method from best to worst, with `columns()`.
    guess
        The best baseline that these instruments allow; empty: none was run.
    runs
        RMS (or CRPS) of each run (index scenario, seed) and method; NaN for a failure.
    p_better
        Adjusted p-value that the method of the row has a lower one than that of the column.
    wins
        Runs in which the method of the row has a lower one than that of the column, half for a
        draw; a failure loses.
    notes
        What was left out, one sentence each.
    by
        What it ranks by: `rms`, or `crps` for a board of uncertainty.
    salt
        Digest of the secret that its drives were drawn with; empty: none, seeds are public.
    """

    target: str
    sensors: tuple[str, ...]
    title: str
    confidence: float
    scenarios: tuple[str, ...]
    seeds: tuple[int, ...]
    lines: pd.DataFrame
    guess: str
    runs: pd.DataFrame
    p_better: pd.DataFrame
    wins: pd.DataFrame
    notes: tuple[str, ...]
    by: str = "rms"
    salt: str = ""

    @property
    def hiding(self) -> str:
        """Whether its seeds were hidden, one sentence."""
        return hiding_of(self.scenarios, self.salt)


def rank(
    rows: pd.DataFrame,
    target: str | Iterable[str] = (),
    sensors: str | Iterable[str] = (),
    *,
    scenarios: Iterable[str] = (),
    labels: Iterable[str] = (),
    reference: str = "",
    confidence: float = statistics.CONFIDENCE,
    resamples: int = statistics.RESAMPLES,
    seed: int = 0,
    by: str = "rms",
    bounds: Stored | None = None,
) -> pd.DataFrame:
    """Rank methods from their rows.

    Parameters
    ----------
    rows
        Frame as `gripbench.run` or `gripbench.read_rows` returns it.
    target
        Signal or signals to rank by, each on boards of its own; empty: all.
    sensors
        Instruments that a method may read, names or one text with commas; empty: one board for
        each set of instruments that a method reads; `any`: one board with all methods.
    scenarios, labels
        Only these scenarios and methods; empty: all.
    reference
        Method to which scores are relative; empty: the board's geometric mean.
    confidence
        Confidence that all claims of a board hold together, and of each interval of score and RMS.
    resamples, seed
        Bootstrap resamples and their seed.
    by
        What to rank by: `rms`, the errors; `crps`, what the methods state of their errors.
    bounds
        Least errors that the sensors allow, see `gripbench.bench.bounds.stored`; None: not known.

    Returns
    -------
    One line a board and method, best first, with `columns()`.

    Raises
    ------
    InputError
        If a name is unknown, or the methods have no runs in common.
    """
    found = boards(
        rows,
        target,
        sensors,
        scenarios=scenarios,
        labels=labels,
        reference=reference,
        confidence=confidence,
        resamples=resamples,
        seed=seed,
        by=by,
        bounds=bounds,
    )
    return pd.concat([board.lines for board in found], ignore_index=True)


def boards(
    rows: pd.DataFrame,
    target: str | Iterable[str] = (),
    sensors: str | Iterable[str] = (),
    *,
    scenarios: Iterable[str] = (),
    labels: Iterable[str] = (),
    reference: str = "",
    confidence: float = statistics.CONFIDENCE,
    resamples: int = statistics.RESAMPLES,
    seed: int = 0,
    by: str = "rms",
    bounds: Stored | None = None,
) -> list[Board]:
    """Return the boards behind `rank`, with their comparisons; parameters and errors as there."""
    if not 0.5 <= confidence < 1.0:
        raise InputError(f"confidence is {confidence:g}; it must be from 0.5 to below 1")
    measure = measure_of(by)
    rows = without_faults(_only(_only(rows, "scenario", scenarios), "label", labels))
    rows = measure.scored(rows)
    targets = [target] if isinstance(target, str) else list(target)
    known = [str(name) for name in rows["target"].unique() if name]
    for name in targets:
        if name and name not in known:
            raise unknown("target", name, known)
    if not known:
        raise InputError("nothing to rank: no row has a target; run a method first")
    settings = Settings(reference, confidence, resamples, seed)
    given = None if sensors == ANY else chosen_instruments(sensors)
    found = []
    for name in [name for name in targets if name] or sorted(known):
        ran = rows[(rows["target"] == name) & (rows["status"] != "skipped")]
        for allowed in sensor_sets(ran) if given == () else [given]:
            parts = on_board(rows, name, allowed)
            for lines, notes in parts:
                grid = grid_of(lines, name, notes, measure)
                found.append(_board(grid, allowed, len(parts) > 1, settings, bounds or {}))
    if not found:
        raise InputError("nothing to rank: every run was skipped")
    return found


def _only(rows: pd.DataFrame, column: str, chosen: Iterable[str]) -> pd.DataFrame:
    names = [chosen] if isinstance(chosen, str) else list(chosen)
    known = set(rows[column])
    for name in names:
        if name not in known:
            raise unknown({"label": "method"}.get(column, column), name, known)
    return rows[rows[column].isin(names)] if names else rows


def _board(
    grid: Grid,
    allowed: tuple[str, ...] | None,
    one_of_several: bool,
    settings: Settings,
    bounds: Stored,
) -> Board:
    target = grid.target
    scenarios = tuple(sorted((*grid.scenarios, *grid.single)))
    with_ = "any sensors" if allowed is None else ", ".join(allowed) or "no sensors"
    plan = plan_of(scenarios[0]) if scenarios else ""
    named = bool(plan) and not plan.startswith(PREFIX)
    what = target if grid.measure is RMS else f"Uncertainty of {target}"
    title = f"{what} with {with_}" + (f" ({plan})" if named else "")
    ranks, p_better = _ranks(grid, settings)
    lines = pd.DataFrame(
        [
            {**method_line(group, str(label) in grid.labels, settings), **ranks[str(label)]}
            for label, group in grid.rows.groupby("label")
        ]
    )
    lines["target"] = target
    lines["sensors"] = ANY if allowed is None else ", ".join(allowed)
    lines["by"] = grid.measure.name
    lines["cells"] = grid.cells
    lines["seeds"] = len(grid.seeds) or 1
    lines["scenarios"] = len(grid.scenarios) + len(grid.single)
    lines["salt"] = salt = next(iter(salts_of(grid.rows)), "")
    lines["pareto"] = pareto_front(lines["score"], lines["step_batch"])
    lines = lines.sort_values(["rank", "label"], ignore_index=True)
    order = list(lines["label"])
    value = grid.measure.name
    runs = grid.rows.assign(**{value: grid.rows[value].where(grid.rows["status"] == "ok")})
    matrix = runs.pivot_table(
        index=["scenario", "seed"], columns="label", values=value, dropna=False
    ).reindex(columns=order)
    wins = statistics.wins(matrix.to_numpy(float))
    lines = against_guess(lines, matrix, wins, grid)
    lines = against_bound(lines, grid, allowed, bounds, settings.confidence)[list(columns())]
    complete = [label for label in order if label in grid.labels]
    return Board(
        target=target,
        sensors=allowed or (),
        title=title + (f" in {', '.join(scenarios)}" if one_of_several and not named else ""),
        confidence=settings.confidence,
        scenarios=scenarios,
        seeds=grid.seeds,
        lines=lines,
        guess=best_baseline(lines),
        runs=matrix,
        p_better=p_better.reindex(index=complete, columns=complete),
        wins=pd.DataFrame(wins, index=order, columns=order),
        notes=(*(f"Scored: {text}." for text in scored_windows(grid.rows).values()), *grid.notes),
        by=grid.measure.name,
        salt=salt,
    )


def _ranks(grid: Grid, settings: Settings) -> tuple[dict[str, dict[str, Any]], pd.DataFrame]:
    """Return rank, interval, group and score of each method, and the adjusted p-values."""
    labels = grid.labels
    by_label: dict[str, dict[str, Any]] = {}
    p = np.ones((len(labels), len(labels)))
    if labels:
        scores = statistics.mean_log_rms(
            grid.totals,
            grid.counts,
            grid.single_values,
            settings.resamples,
            settings.seed,
            grid.measure.floor(grid.target),
            grid.measure.rooted,
        )
        p = statistics.adjusted_p_better(scores)
        better = p <= 1.0 - settings.confidence
        order = np.argsort(scores.estimate, kind="stable")
        first, last = statistics.rank_intervals(better)
        groups = statistics.tied_groups(better, order)
        places = _places(scores.estimate, order)
        score, low, high, far_low, far_high = _relative(scores, labels, settings)
        for i, label in enumerate(labels):
            by_label[label] = {
                "rank": places[i],
                "rank_from": int(first[i]),
                "rank_to": int(last[i]),
                "group": groups[i],
                "score": score[i],
                "score_from": low[i],
                "score_to": high[i],
                "elsewhere_from": far_low[i],
                "elsewhere_to": far_high[i],
                "failures": 0,
            }
    elif settings.reference:
        raise unknown(f"reference on the board of {grid.target}", settings.reference, labels)
    everyone = len(labels) + len(grid.incomplete)
    for label, failures in grid.incomplete.items():
        fewer = sum(other < failures for other in grid.incomplete.values())
        by_label[label] = {
            "rank": len(labels) + 1 + fewer,
            "rank_from": len(labels) + 1,
            "rank_to": everyone,
            "group": "",
            **dict.fromkeys(_SCORES, np.nan),
            "failures": failures,
        }
    return by_label, pd.DataFrame(p, index=list(labels), columns=list(labels))


def _places(estimate: npt.NDArray[np.float64], order: npt.NDArray[np.int64]) -> list[int]:
    """Return ranks from 1; those that are equal but for rounding share the better one."""
    places = [0] * len(order)
    for position, index in enumerate(order):
        before = order[position - 1]
        same = position and (estimate[index] - estimate[before] < statistics.INDISTINGUISHABLE)
        places[index] = places[before] if same else position + 1
    return places


def _relative(
    scores: statistics.Scores, labels: tuple[str, ...], settings: Settings
) -> tuple[npt.NDArray[np.float64], ...]:
    """Return scores relative to the reference with the ends of both their intervals.

    The first interval is over other runs of these scenarios; the second over other scenarios of
    their kind, from the scatter of the scenarios themselves.
    """
    if settings.reference and settings.reference not in labels:
        raise unknown("reference on the board", settings.reference, labels)
    chosen = [labels.index(settings.reference)] if settings.reference else slice(None)
    shift = scores.estimate[chosen].mean()
    base = scores.replicates[:, chosen].mean(axis=1, keepdims=True)
    relative = scores.estimate - shift
    errors = scores.standard_errors(base)
    low, high = statistics.interval(relative, errors, scores.runs, settings.confidence)
    each = scores.by_scenario - scores.by_scenario[:, chosen].mean(axis=1, keepdims=True)
    number = len(each)
    scatter = each.std(axis=0, ddof=1) / np.sqrt(number) if number > 1 else np.zeros_like(relative)
    far = statistics.interval(relative, scatter, number, settings.confidence)
    return tuple(np.exp(values) for values in (relative, low, high, *far))
