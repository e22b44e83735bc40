"""Is a filter as good as it believes: NEES, NIS and whiteness of innovations.

A consistent filter has normalised squared errors that follow a chi-square law, and innovations
without memory. The mean over n independent values with d degrees of freedom each lies, with the
given confidence, in a band of the chi-square law with n d degrees of freedom.

References
----------
Y. Bar-Shalom, X.-R. Li & T. Kirubarajan, Estimation with Applications to Tracking and Navigation,
Wiley 2001, section 5.4. G. M. Ljung & G. E. P. Box, Biometrika 65 (1978) 297.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import stats

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
    low = float(stats.chi2.ppf(0.5 - confidence / 2.0, freedom)) / freedom
    high = float(stats.chi2.ppf(0.5 + confidence / 2.0, freedom)) / freedom
    return ChiSquareTest(float(values.mean()) / degrees, low, high, values.size)


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


def whiteness_test(innovations: npt.ArrayLike, lags: int = 10) -> WhitenessTest:
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
    values = np.asarray(innovations, np.float64)
    n = len(values)
    if lags < 1 or n <= lags:
        raise InputError(f"a whiteness test of {lags} lags needs more than {lags} innovations")
    power = float(values @ values)
    if not np.isfinite(power) or power == 0.0:
        raise InputError("a whiteness test needs finite innovations that are not all zero")
    correlation = np.array([values[lag:] @ values[:-lag] for lag in range(1, lags + 1)]) / power
    statistic = n * (n + 2.0) * float(np.sum(correlation**2 / (n - np.arange(1, lags + 1))))
    return WhitenessTest(correlation, 1.96 / np.sqrt(n), float(stats.chi2.sf(statistic, lags)))
