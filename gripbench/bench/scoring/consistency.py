"""Is a filter as good as it believes: NEES, NIS and whiteness of innovations.

A consistent filter has normalised squared errors that follow a chi-square law, and innovations
without memory. The mean over n independent values with d degrees of freedom each lies, with the
given confidence, in a band of the chi-square law with n d degrees of freedom.

The samples of one run are not independent: a bias, or a car that differs from the one on paper,
stays for the whole run. So the runs are what is counted (`runs_test`), and how many degrees of
freedom each is worth is told by how far their means lie apart.

References
----------
Y. Bar-Shalom, X.-R. Li & T. Kirubarajan, Estimation with Applications to Tracking and Navigation,
Wiley 2001, section 5.4. G. M. Ljung & G. E. P. Box, Biometrika 65 (1978) 297.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gripbench.errors import InputError


@dataclass(frozen=True)
class ChiSquareTest:
    """Mean normalised square with the band of a consistent filter.

    Attributes
    ----------
    mean
        Mean over all values, per degree of freedom; 1 is ideal.
    low, high
        Band in which the mean of a consistent filter lies.
    count
        Number of values.
    consistent
        Whether `mean` is within the band. Below it a filter is too modest, above too confident.
    """

    mean: float
    low: float
    high: float
    count: int

    @property
    def consistent(self) -> bool:
        """Whether the mean is within the band."""
        return self.low <= self.mean <= self.high


def normalised_squares(errors: npt.ArrayLike, variances: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return errors^2 / variances, shape of `errors`.

    Raises
    ------
    InputError
        If a variance is not positive and finite.
    """
    error, variance = np.asarray(errors, np.float64), np.asarray(variances, np.float64)
    if not np.all(np.isfinite(variance) & (variance > 0.0)):
        raise InputError("variances have to be positive and finite")
    return np.asarray(error**2 / variance)


def chi_square_test(
    squares: npt.ArrayLike, degrees: int = 1, confidence: float = 0.95
) -> ChiSquareTest:
    """Test normalised squares (NEES or NIS) of independent samples.

    Parameters
    ----------
    squares
        Normalised squares, any shape. NEES values of one run are correlated in time; take one
        value a run or the runs' means.
    degrees
        Degrees of freedom of each value.
    confidence
        Probability of the band, between 0 and 1.

    Raises
    ------
    InputError
        If there is no value, or a value is not finite.
    """
    values = np.asarray(squares, np.float64).ravel()
    if values.size == 0 or not np.all(np.isfinite(values)):
        raise InputError("a chi-square test needs at least one value, all of them finite")
    freedom = values.size * degrees
    low, high = _band(freedom, (1.0 - confidence) / 2.0)
    return ChiSquareTest(float(values.mean()) / degrees, low, high, values.size)


def _band(freedom: float, tail: float) -> tuple[float, float]:
    """Return between which ends the mean of squares of that freedom lies, `tail` on either side."""
    from scipy.special import chdtri

    return float(chdtri(freedom, 1.0 - tail)) / freedom, float(chdtri(freedom, tail)) / freedom


CONSISTENT, SILENT = "consistent", "says nothing"
"""Verdicts on a filter within its band, and on a method that states no uncertainty."""

_FEWEST = 3
_SAME = 1e-9  # relative spread of runs that are one and the same but for rounding


@dataclass(frozen=True)
class RunsTest:
    """Mean normalised square of several runs with the band of a consistent filter.

    Attributes
    ----------
    mean
        Over all samples of all runs, per degree of freedom; 1 is ideal.
    low, high
        Band in which the mean of a consistent filter lies.
    runs
        Number of runs.
    degrees
        Degrees of freedom that the band rests on, all runs together.
    """

    mean: float
    low: float
    high: float
    runs: int
    degrees: float

    @property
    def factor(self) -> float:
        """What the stated deviation is short of the errors: above 1 it is too small."""
        return math.sqrt(self.mean)

    @property
    def factor_interval(self) -> tuple[float, float]:
        """Interval of the factor, at the confidence of the band."""
        return math.sqrt(self.mean / self.high), math.sqrt(self.mean / self.low)

    @property
    def verdict(self) -> str:
        """In plain words what the mean says of the stated uncertainty."""
        if self.low <= self.mean <= self.high:
            return CONSISTENT
        if self.mean > 1.0:
            return f"overconfident by a factor {self.factor:.3g}"
        if self.mean == 0.0:
            return "cautious: there is no error"
        return f"cautious by a factor {1.0 / self.factor:.3g}"


def runs_test(
    totals: npt.ArrayLike, counts: npt.ArrayLike, confidence: float = 0.95
) -> RunsTest | None:
    """Test the normalised squares (NEES or NIS) of independent runs.

    Parameters
    ----------
    totals, counts
        Sum over the samples of each run, and their number.
    confidence
        Probability of the band, between 0 and 1.

    Returns
    -------
    None where a run has no value, or there is none: such a method says nothing.

    Notes
    -----
    If a run is worth v degrees of freedom, the relative variance of the runs' means is 2 / v
    (Satterthwaite). That variance is estimated from the runs themselves and widened by Student's
    factor, because it is an estimate; the band is that of the chi-square law with v degrees for
    each run, and leaves out two thirds of the share that it might, because runs may have heavier
    tails than a normal law. With fewer than three runs, or where all are the same, each counts as
    one degree of freedom: the errors of a whole run are one error. `python
    tests/bench/nees_coverage.py` prints how often a consistent filter lies within.
    """
    total, number = np.asarray(totals, np.float64), np.asarray(counts, np.float64)
    runs = total.size
    if runs == 0 or not np.all(np.isfinite(total)) or not np.all(number > 0.0):
        return None
    mean = float(total.sum() / number.sum())
    tail = (1.0 - confidence) / 3.0
    freedom = float(runs)
    if runs >= _FEWEST and mean > 0.0:
        from scipy.special import ndtri, stdtrit

        share = number * (total / number / mean - 1.0) / number.mean()
        spread = math.sqrt(float(np.sum(share**2)) / (runs - 1))
        if spread > _SAME:
            student = float(stdtrit(runs - 1, 1.0 - tail) / ndtri(1.0 - tail))
            freedom = runs * 2.0 / (student * spread) ** 2
    low, high = _band(freedom, tail)
    return RunsTest(mean, low, high, runs, freedom)


LAGS = 10
"""Lags of a whiteness test."""


@dataclass(frozen=True)
class WhitenessTest:
    """Autocorrelation of normalised innovations, with the Ljung-Box test.

    Attributes
    ----------
    autocorrelation
        Of lags 1 to the number of lags.
    band
        Half width of the 95 % band around zero of a white sequence.
    p_value
        Probability of so much memory in a white sequence; small: not white.
    """

    autocorrelation: npt.NDArray[np.float64]
    band: float
    p_value: float

    @property
    def white(self) -> bool:
        """Whether whiteness stands at the 5 % level."""
        return self.p_value >= 0.05


def whiteness_test(innovations: npt.ArrayLike, lags: int = LAGS) -> WhitenessTest:
    """Test whether innovations are white.

    The mean is not removed: the innovations of a right model have none, and one that stays is
    just what a wrong model shows.

    Parameters
    ----------
    innovations
        Innovations, each over its standard deviation, shape (n,), n above `lags`.
    lags
        Number of lags.

    Raises
    ------
    InputError
        If there are too few values, one is not finite, or all are zero.
    """
    from scipy.special import chdtrc  # slow to import, as in the whole module

    values = np.asarray(innovations, np.float64)
    n = len(values)
    if lags < 1 or n <= lags:
        raise InputError(f"a whiteness test of {lags} lags needs more than {lags} innovations")
    power = float(values @ values)
    if not np.isfinite(power) or power == 0.0:
        raise InputError("a whiteness test needs finite innovations that are not all zero")
    correlation = np.array([values[lag:] @ values[:-lag] for lag in range(1, lags + 1)]) / power
    statistic = n * (n + 2.0) * float(np.sum(correlation**2 / (n - np.arange(1, lags + 1))))
    return WhitenessTest(correlation, 1.96 / np.sqrt(n), float(chdtrc(lags, statistic)))
