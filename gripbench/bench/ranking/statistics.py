"""Statistics of a comparison: what a finite number of runs can tell and what it cannot.

The unit that is drawn again is a run (a seed), never a sample: samples of one run share its noise
and its bias. A resample takes the same seeds for all methods and all scenarios, because a seed
gives every method the same recording and every scenario the same sensor streams.

References
----------
Efron and Tibshirani, An Introduction to the Bootstrap, 1993: the paired bootstrap, bootstrap-t.
Satterthwaite, An approximate distribution of estimates of variance components, Biometrics 2, 1946.
Holm, A simple sequentially rejective multiple test procedure, Scand. J. Statist. 6, 1979.
Al Mohamad, Goeman and van Zwet, Simultaneous confidence intervals for ranks with application to
ranking institutions, Biometrics 78, 2022: ranks from simultaneous pairwise comparisons.
Piepho, An algorithm for a letter-based representation of all-pairwise comparisons, J. Comput.
Graph. Statist. 13, 2004.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from gripbench.errors import InputError

RESAMPLES = 2000
"""Bootstrap resamples unless told otherwise."""

CONFIDENCE = 0.95
"""Confidence unless told otherwise."""

FEWEST_RUNS = 10
"""Runs below which the pooled RMS has no interval: none that we know holds its confidence."""

INDISTINGUISHABLE = 1e-9
"""Relative difference of two RMS values below which they are rounding of one and the same."""

_SMALLEST_SHARE = 1e-12  # of a scenario's largest RMS: stands for a perfect estimate's zero

Floats = npt.NDArray[np.float64]
Booleans = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Scores:
    """Mean log RMS of several methods with their paired bootstrap.

    Attributes
    ----------
    estimate
        Mean over the scenarios of the logarithm of the pooled RMS, shape (methods,).
    replicates
        The same of each resample of the runs, shape (resamples, methods).
    runs
        Number of runs that were resampled; with fewer than two nothing can be said.
    by_scenario
        Logarithm of the pooled RMS in each scenario, shape (scenarios, methods).
    """

    estimate: Floats
    replicates: Floats
    runs: int
    by_scenario: Floats

    def standard_errors(self, reference: Floats | None = None) -> Floats:
        """Return standard errors of the estimates less a reference, shape (methods,).

        Parameters
        ----------
        reference
            Replicates of what is subtracted, shape (resamples, 1); None: nothing.
        """
        shifted = self.replicates if reference is None else self.replicates - reference
        return _unbiased(shifted.std(axis=0), self.runs)


def mean_log_rms(
    sums_of_squares: Floats,
    counts: Floats,
    fixed_rms: Floats | None = None,
    resamples: int = RESAMPLES,
    seed: int = 0,
    smallest: float = 0.0,
    rooted: bool = True,
) -> Scores:
    """Return the methods' mean log RMS over scenarios, and its paired bootstrap over the runs.

    Within a scenario runs are pooled by the mean of squares; over the scenarios logarithms are
    averaged, so that neither a scenario's unit nor its difficulty weighs.

    Parameters
    ----------
    sums_of_squares, counts
        Of each run, shape (scenarios, runs, methods).
    fixed_rms
        RMS of scenarios that were run once, shape (scenarios, methods): they enter the mean but
        not its uncertainty.
    resamples
        Number of resamples.
    seed
        Seed of the resampling. The resamples depend on it and the number of runs only, so that
        another method on the board changes nothing between two others.
    smallest
        RMS below which no scenario counts as better.
    rooted
        Whether a value is the root of the mean, as of the RMS; else it is the mean itself.
    """
    scenarios, runs, methods = sums_of_squares.shape
    fixed = np.empty((0, methods)) if fixed_rms is None else fixed_rms
    if scenarios + len(fixed) == 0:
        raise InputError("statistics: no scenario to compare in")
    of_mean: Callable[[Floats], Floats] = np.sqrt if rooted else np.asarray
    pooled = of_mean(sums_of_squares.sum(axis=1) / counts.sum(axis=1))
    floor = _SMALLEST_SHARE * np.concatenate([pooled, fixed]).max(axis=1, initial=0.0)
    floor = np.maximum(floor, max(smallest, np.finfo(float).tiny))[:, None]
    constant = np.log(np.maximum(fixed, floor[scenarios:]))
    by_scenario = np.concatenate([np.log(np.maximum(pooled, floor[:scenarios])), constant])
    runs = runs if scenarios else 1
    drawn = draws(runs, resamples, seed)
    logs = np.zeros((resamples, methods))
    for squares, count, low in zip(sums_of_squares, counts, floor, strict=False):
        logs += np.log(np.maximum(of_mean((drawn @ squares) / (drawn @ count)), low))
    replicates = (logs + constant.sum(axis=0)) / (scenarios + len(fixed))
    return Scores(by_scenario.mean(axis=0), replicates, runs, by_scenario)


@lru_cache(maxsize=8)
def draws(runs: int, resamples: int = RESAMPLES, seed: int = 0) -> Floats:
    """Return how often each run is drawn in each resample, shape (resamples, runs)."""
    counts = np.random.default_rng(seed).multinomial(runs, np.full(runs, 1.0 / runs), resamples)
    result = counts.astype(np.float64)
    result.flags.writeable = False
    return result


def p_better(scores: Scores, margin: float = 0.0) -> Floats:
    """Return one-sided p-values that one method's RMS is lower than another's.

    Parameters
    ----------
    scores
        Scores with their bootstrap.
    margin
        Logarithm of the ratio by which it has to be lower.

    Returns
    -------
    Shape (methods, methods): entry (i, j) is small where i is better than j. The statistic is
    the difference over its bootstrap standard error, held against Student's t with one degree of
    freedom fewer than runs: the share of resamples with the other sign would be too small with
    few runs, and no finer than one over the number of resamples. Without two runs all are 1.
    """
    methods = len(scores.estimate)
    p = np.ones((methods, methods))
    if scores.runs < 2:
        return p
    for j in range(methods):
        others = scores.replicates - scores.replicates[:, j : j + 1]
        errors = _unbiased(others.std(axis=0), scores.runs)
        differences = scores.estimate - scores.estimate[j] + margin
        p[:, j] = _p_below_zero(differences, errors, scores.runs)
    np.fill_diagonal(p, 1.0)
    return p


def _p_below_zero(differences: Floats, errors: Floats, runs: int) -> Floats:
    """One-sided p-values; equal but for rounding counts as equal, whatever the error."""
    from scipy.special import stdtr  # slow to import, and `gripbench run` tests nothing

    same = np.abs(differences) < INDISTINGUISHABLE
    statistic = np.divide(
        differences,
        errors,
        out=np.where(differences < 0.0, -np.inf, np.inf),
        where=errors > INDISTINGUISHABLE,
    )
    return np.where(same, 1.0, stdtr(runs - 1, statistic))


def _unbiased(deviations: Floats, runs: int) -> Floats:
    # the bootstrap divides by the number of runs where an unbiased variance has one fewer
    return deviations * np.sqrt(runs / max(runs - 1, 1))


def holm(p: Floats) -> Floats:
    """Return p-values adjusted by Holm's step-down method, in their order.

    The chance that any rejection among all of them is wrong is at most the level, under any
    dependence.

    Examples
    --------
    >>> holm(np.array([0.01, 0.04, 0.03])).tolist()
    [0.03, 0.06, 0.06]
    """
    flat = np.asarray(p, float).ravel()
    order = np.argsort(flat, kind="stable")
    factors = np.arange(len(flat), 0, -1)
    adjusted = np.minimum(np.maximum.accumulate(flat[order] * factors), 1.0)
    result = np.empty_like(flat)
    result[order] = adjusted
    return result.reshape(np.shape(p))


def adjusted_p_better(scores: Scores) -> Floats:
    """Return `p_better` after Holm's correction over all ordered pairs.

    Both directions of a pair are hypotheses of their own, so that a difference claimed in the
    wrong direction counts as an error as well.
    """
    p = p_better(scores)
    pairs = ~np.eye(len(p), dtype=bool)
    p[pairs] = holm(p[pairs])
    return p


def rank_intervals(better: Booleans) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return lowest and highest rank that each method may have.

    Where all claims hold together with a confidence, so do all these intervals together.

    Parameters
    ----------
    better
        Shape (methods, methods): whether row is significantly better than column.
    """
    return 1 + better.sum(axis=0), len(better) - better.sum(axis=1)


def tied_groups(better: Booleans, order: npt.NDArray[np.int64]) -> list[str]:
    """Return letters such that two methods share one exactly if neither is better.

    Parameters
    ----------
    better
        Shape (methods, methods): whether row is significantly better than column.
    order
        Indices of the methods from best to worst; the best one has `a`.

    Notes
    -----
    Insert and absorb (Piepho): each significant pair splits the groups that hold both, and a group
    that is part of another is dropped.
    """
    groups = [frozenset(range(len(better)))]
    for i, j in zip(*np.nonzero(better), strict=True):
        split: list[frozenset[int]] = []
        for group in groups:
            split += [group - {i}, group - {j}] if i in group and j in group else [group]
        unique = list(dict.fromkeys(split))
        groups = [one for one in unique if not any(one < other for other in unique)]
    place = {int(method): position for position, method in enumerate(order)}
    groups.sort(key=lambda group: sorted(place[method] for method in group))
    letters = [""] * len(better)
    for number, group in enumerate(groups):
        for method in group:
            letters[method] += _letter(number)
    return letters


def _letter(number: int) -> str:
    """Return a, b, ..., z, a1, b1, ..."""
    return chr(ord("a") + number % 26) + (str(number // 26) if number >= 26 else "")


def wins(rms: Floats) -> Floats:
    """Return in how many runs each method beats each other one.

    Parameters
    ----------
    rms
        Shape (runs, methods); NaN where a method failed.

    Returns
    -------
    Shape (methods, methods): runs in which row is lower than column, half for a draw. A failure
    loses against any result; two failures are a draw. The diagonal is NaN.
    """
    values = np.where(np.isnan(rms), np.inf, rms)
    lower = (values[:, :, None] < values[:, None, :]).sum(axis=0)
    equal = (values[:, :, None] == values[:, None, :]).sum(axis=0)
    result = lower + 0.5 * equal
    np.fill_diagonal(result, np.nan)
    return result


def interval(
    estimate: Floats, errors: Floats, runs: int, confidence: float = CONFIDENCE
) -> tuple[Floats, Floats]:
    """Return the ends of Student's interval, NaN without two runs."""
    if runs < 2:
        nothing = np.full(len(estimate), np.nan)
        return nothing, nothing
    from scipy.special import stdtrit  # slow to import

    width = stdtrit(runs - 1, 0.5 + confidence / 2.0) * errors
    return estimate - width, estimate + width


def pooled_rms_interval(
    sums_of_squares: npt.ArrayLike,
    counts: npt.ArrayLike,
    confidence: float = CONFIDENCE,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> tuple[float, float]:
    """Return the interval of the RMS pooled over runs.

    Parameters
    ----------
    sums_of_squares, counts
        Of each run.
    confidence
        Confidence of the interval.
    resamples, seed
        Number of resamples and their seed.

    Returns
    -------
    Ends of the interval; NaN with fewer than `FEWEST_RUNS` runs, from which no interval holds, or
    where one run outweighs all others.

    Notes
    -----
    The hull of two intervals of the logarithm of the mean square. Bootstrap-t (Efron & Tibshirani,
    chapter 12) follows the skewness of the runs, but misses tails that few of them show;
    chi-square with the degrees of freedom of the observed spread (Satterthwaite), widened by
    Student's factor for a spread that is estimated itself, knows that mean squares are skewed but
    not how. Each fails where the other holds. Runs with cars of their own have tails that ten
    runs seldom show, so each leaves out two thirds of the share that it might: `tests/bench/
    interval_coverage.py` prints the coverage of the result, at least 93 % from ten runs on.
    """
    squares, number = np.asarray(sums_of_squares, float), np.asarray(counts, float)
    runs = len(squares)
    if runs < FEWEST_RUNS:
        return float("nan"), float("nan")
    mean = squares.sum() / number.sum()
    if np.ptp(squares / number) <= INDISTINGUISHABLE * np.max(squares / number):
        return math.sqrt(mean), math.sqrt(mean)  # every resample gives it: nothing to draw
    from scipy.special import chdtri, stdtrit  # slow to import

    tail = (1.0 - confidence) / 3.0
    error = float(_relative_errors(np.ones((1, runs)), squares, number)[0])
    drawn = draws(runs, resamples, seed)
    replicates = np.log(np.maximum((drawn @ squares) / (drawn @ number), np.finfo(float).tiny))
    errors = _relative_errors(drawn, squares, number)
    pivots = (replicates - math.log(mean)) / np.maximum(errors, 1e-3 * error)
    low, high = np.quantile(pivots, [tail, 1.0 - tail])
    student = float(stdtrit(runs - 1, 1.0 - tail)) / NormalDist().inv_cdf(1.0 - tail)
    freedom = 2.0 / (student * error) ** 2
    with np.errstate(over="ignore", divide="ignore"):
        lower = np.minimum(np.exp(-high * error), freedom / chdtri(freedom, tail))
        upper = np.maximum(np.exp(-low * error), freedom / chdtri(freedom, 1.0 - tail))
    if not np.isfinite(upper):
        return float("nan"), float("nan")  # one run outweighs all others: the rest says nothing
    return math.sqrt(mean * float(lower)), math.sqrt(mean * float(upper))


def _relative_errors(drawn: Floats, squares: Floats, number: Floats) -> Floats:
    """Return the standard error of the log mean square of each resample, shape (resamples,).

    Of the ratio of two sums, by its linear approximation.
    """
    runs = drawn.sum(axis=1)
    total, count = drawn @ squares, drawn @ number
    mean = total / count
    spread = drawn @ squares**2 - 2.0 * mean * (drawn @ (squares * number))
    spread += mean**2 * (drawn @ number**2)
    variance = np.maximum(spread, 0.0) * runs / (runs - 1.0)
    return np.sqrt(variance) / np.maximum(total, np.finfo(float).tiny)


def performance_profile(rms: Floats, factors: Floats) -> Floats:
    """Return in which share of the runs each method is within a factor of the best.

    Parameters
    ----------
    rms
        Shape (runs, methods); NaN where a method failed: within no factor.
    factors
        Factors from 1, shape (n,).

    Returns
    -------
    Shape (n, methods), rising with the factor (Dolan & More, Math. Program. 91, 2002).
    """
    values = np.where(np.isnan(rms), np.inf, rms)
    best = values.min(axis=1, keepdims=True)
    worst = np.where(np.isfinite(values), values, np.inf)
    with np.errstate(invalid="ignore"):
        ratio = np.where(best > 0.0, worst / np.maximum(best, np.finfo(float).tiny), 1.0)
        ratio = np.where((best == 0.0) & (values > 0.0), np.inf, ratio)
    ratio = np.where(np.isfinite(values), ratio, np.inf)
    return np.asarray((ratio[None] <= factors[:, None, None] * (1.0 + 1e-12)).mean(axis=1))
