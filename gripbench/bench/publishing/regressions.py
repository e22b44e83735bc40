"""Compare a leaderboard with an earlier one: what became worse, by how much, how surely.

RMS is compared for each method, target and scenario, paired over the seeds that both have: the
same seed is the same recording, so unchanged code differs by nothing at all. A method has become
worse where its pooled RMS rose by more than a margin, significantly at the stated confidence after
Holm's correction over all comparisons. Runtime is compared by the time of a step relative to the
reference kernel, timed in the same run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.publishing.leaderboard import Leaderboard, Runs
from gripbench.bench.publishing.timings import RelativeRuntime
from gripbench.bench.ranking.statistics import CONFIDENCE, holm, mean_log_rms, p_better
from gripbench.errors import InputError

MARGIN = 0.001
"""Relative rise of the RMS that is no matter: other processors and libraries round otherwise."""

FACTOR = 1.5
"""Factor by which a relative runtime may rise."""

Verdict = Literal["worse", "failed", "missing", "slower", "better", "faster", "new", "undecided"]

REGRESSIONS: tuple[Verdict, ...] = ("worse", "failed", "missing", "slower")
"""Verdicts that fail a comparison."""


@dataclass(frozen=True)
class Change:
    """One thing that differs between two leaderboards.

    Attributes
    ----------
    verdict
        `worse` or `better` RMS, `failed` runs that were ok, `missing` from the current one, `new`
        in it, `slower` or `faster`, `undecided` where a change is beyond its limit but cannot be
        told from chance.
    label, target, scenario
        Where; target and scenario are empty for a runtime.
    ratio
        Current over base, of the pooled RMS or the relative runtime; NaN where there is none.
    confidence
        Confidence that the limit is exceeded: one less Holm's adjusted p-value; NaN where it is a
        matter of fact.
    detail
        In words.
    """

    verdict: Verdict
    label: str
    target: str
    scenario: str
    ratio: float
    confidence: float
    detail: str

    @property
    def regression(self) -> bool:
        """Whether it fails the comparison."""
        return self.verdict in REGRESSIONS


def compare(
    base: Leaderboard,
    current: Leaderboard,
    factor: float = FACTOR,
    margin: float = MARGIN,
    confidence: float = CONFIDENCE,
) -> list[Change]:
    """Return what differs, regressions first; empty: nothing.

    Parameters
    ----------
    base, current
        The leaderboards.
    factor
        Factor by which a relative runtime may rise.
    margin
        Share by which the RMS may rise.
    confidence
        Confidence that no unchanged method is called worse.

    Raises
    ------
    InputError
        If a limit makes no sense.
    """
    if not (factor > 1.0 and margin >= 0.0 and 0.5 <= confidence < 1.0):
        raise InputError(
            f"compare: factor {factor:g}, margin {margin:g}, confidence {confidence:g}; the factor "
            "must be above 1, the margin not negative, the confidence from 0.5 to below 1"
        )
    changes = [
        *_presence(base, current),
        *_rms_changes(base, current, margin, confidence),
        *_runtime_changes(base, current, factor),
    ]
    order = (*REGRESSIONS, "undecided", "better", "faster", "new")
    return sorted(changes, key=lambda c: (order.index(c.verdict), c.label, c.target, c.scenario))


def changes_table(changes: list[Change]) -> Table:
    """Return changes as a table."""
    columns = (
        Column("verdict", "Verdict"),
        Column("label", "Method"),
        Column("target", "Target"),
        Column("scenario", "Scenario"),
        Column("ratio", "Current / base", format=".4f"),
        Column("confidence", "Confidence"),
        Column("detail", "Detail"),
    )
    rows = tuple({**vars(change), "confidence": _percent(change.confidence)} for change in changes)
    failing = sum(change.regression for change in changes)
    caption = f"Regressions: {failing}; other changes: {len(changes) - failing}."
    return Table(columns, rows, caption=caption if changes else "No change.")


def _percent(confidence: float) -> str | None:
    if math.isnan(confidence):
        return None
    return "> 99.99 %" if confidence > 0.9999 else f"{100.0 * confidence:.4g} %"


def _by_cell(leaderboard: Leaderboard) -> dict[tuple[str, str, str], Runs]:
    return {(runs.label, runs.target, runs.scenario): runs for runs in leaderboard.runs}


def _presence(base: Leaderboard, current: Leaderboard) -> list[Change]:
    """Return what is in one of them only, and runs that were ok and no longer are."""
    before, after = _by_cell(base), _by_cell(current)
    changes = []
    for cell in before.keys() - after.keys():
        changes.append(_fact("missing", cell, "was run in the base, not now"))
    for cell in after.keys() - before.keys():
        changes.append(_fact("new", cell, "was not run in the base"))
    for cell in before.keys() & after.keys():
        if before[cell].salt != after[cell].salt:
            changes.append(_fact("missing", cell, "drawn with another secret than the base's"))
            continue
        broken = sorted(set(before[cell].seeds) & after[cell].failed.keys())
        if broken:
            detail = f"{len(broken)} runs that were ok, first seed {broken[0]}: "
            changes.append(_fact("failed", cell, detail + after[cell].failed[broken[0]]))
        elif before[cell].seeds and not set(before[cell].seeds) & set(after[cell].seeds):
            changes.append(_fact("missing", cell, "no seed in common with the base"))
    return changes


def _fact(verdict: Verdict, cell: tuple[str, str, str], detail: str) -> Change:
    return Change(verdict, *cell, ratio=math.nan, confidence=math.nan, detail=detail)


def _rms_changes(
    base: Leaderboard, current: Leaderboard, margin: float, confidence: float
) -> list[Change]:
    before, after = _by_cell(base), _by_cell(current)
    cells, ratios, p_worse, p_improved, numbers = [], [], [], [], []
    for cell in sorted(before.keys() & after.keys()):
        seeds = sorted(set(before[cell].seeds) & set(after[cell].seeds))
        if not seeds or before[cell].salt != after[cell].salt:
            continue
        sums = np.stack([_columns(runs, seeds) for runs in (before[cell], after[cell])], axis=-1)
        scores = mean_log_rms(sums[None, 0], sums[None, 1])
        p = p_better(scores, math.log1p(margin))
        cells.append(cell)
        ratios.append(math.exp(scores.estimate[1] - scores.estimate[0]))
        p_worse.append(p[0, 1])
        p_improved.append(p[1, 0])
        numbers.append(len(seeds))
    changes = []
    for cell, ratio, worse, improved, number in zip(
        cells, ratios, holm(np.array(p_worse)), holm(np.array(p_improved)), numbers, strict=True
    ):
        up = ratio > 1.0
        if (ratio if up else 1.0 / ratio) <= 1.0 + margin:
            continue
        p_value = float(worse if up else improved)
        verdict: Verdict = "worse" if up else "better"
        if p_value > 1.0 - confidence:
            verdict = "undecided"
        detail = f"RMS {100.0 * (ratio - 1.0):+.2f} % over {number} common seeds"
        changes.append(Change(verdict, *cell, ratio=ratio, confidence=1.0 - p_value, detail=detail))
    return changes


def _columns(runs: Runs, seeds: list[int]) -> np.ndarray:
    """Return sums of squares and counts of these seeds, shape (2, seeds)."""
    places = {seed: index for index, seed in enumerate(runs.seeds)}
    chosen = [places[seed] for seed in seeds]
    return np.array([runs.sums_of_squares, runs.counts], float)[:, chosen]


def _runtime_changes(base: Leaderboard, current: Leaderboard, factor: float) -> list[Change]:
    changes = []
    for label, forms in base.runtimes.items():
        for form, before in forms.items():
            after = current.runtimes.get(label, {}).get(form)
            if after is not None:
                changes += _runtime_change(label, form, before, after, factor)
            elif current.runtimes:
                cell = (label, "", "")
                changes.append(
                    _fact("missing", cell, f"{form} step was timed in the base, not now")
                )
    return changes


def _runtime_change(
    label: str, form: str, before: RelativeRuntime, after: RelativeRuntime, factor: float
) -> list[Change]:
    ratio = after.relative / before.relative
    if 1.0 / factor <= ratio <= factor:
        return []
    least = _quotient(after.low, before.high)
    most = _quotient(after.high, before.low)
    verdict: Verdict = "slower" if ratio > 1.0 else "faster"
    sure = least > factor if ratio > 1.0 else most < 1.0 / factor
    detail = (
        f"{form} step {before.relative:.3g} -> {after.relative:.3g} reference kernels, "
        f"ratio {least:.3g} to {most:.3g}"
    )
    return [
        Change(
            verdict if sure else "undecided",
            label,
            "",
            "",
            ratio=ratio,
            confidence=0.95 if sure else math.nan,
            detail=detail,
        )
    ]


def _quotient(first: float | None, second: float | None) -> float:
    return math.nan if first is None or second is None else first / second
