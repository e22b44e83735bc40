"""What a method states of its error, a variance or quantiles, and the errors; their scores out.

Both forms are a distribution of the estimated signal around the method's own estimate. A variance
is read as that of a normal distribution. Quantiles are read as a distribution function that rises
straight from one to the next and has what is left at the two outermost: nothing is added that was
not said, and since the score is proper a method cannot gain by saying less.

References
----------
T. Gneiting & A. E. Raftery, J. Amer. Statist. Assoc. 102 (2007) 359, eq. 20 and 21 (CRPS).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from gripbench.bench.scoring.consistency import LAGS, WhitenessTest, whiteness_test

Floats = npt.NDArray[np.float64]

LEVELS = (0.5, 0.9, 0.95)
"""Probabilities of the stated intervals."""


class Stated(Protocol):
    """What a method states of each sample's error; every result has the shape (n,)."""

    def crps(self) -> Floats:
        """Return the continuous ranked probability score, in the unit of the signal."""

    def inside(self, level: float) -> Floats | None:
        """Return 1 where the central interval of a probability holds the truth, None: not told."""

    def width(self, level: float) -> Floats | None:
        """Return the width of that interval, None where the method does not tell it."""

    def normalised(self) -> Floats | None:
        """Return the error in units of the stated deviation, None where there is none."""

    def below(self, level: float) -> Floats | None:
        """Return 1 where the truth is not above the quantile of a level, None: not told."""


@dataclass(frozen=True)
class Normal:
    """A normal distribution around the estimate.

    Attributes
    ----------
    error
        Estimate less truth, shape (n,).
    deviation
        Stated standard deviation, shape (n,), positive.
    variance
        Its square as it was stated.
    """

    error: Floats
    deviation: Floats
    variance: Floats

    def crps(self) -> Floats:
        """Return the scores by their closed form."""
        from scipy.special import ndtr

        z = np.abs(self.error) / self.deviation
        with np.errstate(over="ignore"):
            density = np.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
        inner = z * (2.0 * ndtr(z) - 1.0) + 2.0 * density - 1.0 / math.sqrt(math.pi)
        return np.asarray(self.deviation * inner)

    def inside(self, level: float) -> Floats | None:
        """Return where the interval holds the truth."""
        return np.asarray(
            (np.abs(self.error) <= _normal_quantile(0.5 + level / 2.0) * self.deviation) * 1.0
        )

    def width(self, level: float) -> Floats | None:
        """Return the width of the interval."""
        return np.asarray(2.0 * _normal_quantile(0.5 + level / 2.0) * self.deviation)

    def normalised(self) -> Floats | None:
        """Return the error over the stated deviation."""
        return np.asarray(self.error / self.deviation)

    def below(self, level: float) -> Floats | None:
        """Return where the truth is not above the quantile."""
        return np.asarray((-self.error <= _normal_quantile(level) * self.deviation) * 1.0)


@dataclass(frozen=True)
class Quantiles:
    """Quantiles of the signal.

    Attributes
    ----------
    truth
        Truth less estimate, shape (n,).
    levels
        Levels between 0 and 1, rising, shape (k,).
    values
        Quantiles less estimate, shape (k, n), not falling with the level.
    """

    truth: Floats
    levels: tuple[float, ...]
    values: Floats

    def crps(self) -> Floats:
        """Return the scores, exact for the distribution function as it is read."""
        y, values = self.truth, self.values
        score = np.maximum(values[0] - y, 0.0) + np.maximum(y - values[-1], 0.0)
        for k in range(len(self.levels) - 1):
            low, high = values[k], values[k + 1]
            first, last = self.levels[k], self.levels[k + 1]
            width = high - low
            split = np.clip(y, low, high)
            share = np.divide(split - low, width, out=np.zeros_like(width), where=width > 0.0)
            middle = first + share * (last - first)  # the distribution function at the truth
            score += (split - low) * _mean_square(first, middle)
            score += (high - split) * _mean_square(1.0 - middle, 1.0 - last)
        return score

    def inside(self, level: float) -> Floats | None:
        """Return where it holds the truth, if both its ends were stated."""
        low, high = self._at(0.5 - level / 2.0), self._at(0.5 + level / 2.0)
        if low is None or high is None:
            return None
        return np.asarray(((low <= self.truth) & (self.truth <= high)) * 1.0)

    def width(self, level: float) -> Floats | None:
        """Return it where both ends are quantiles that were stated."""
        low, high = self._at(0.5 - level / 2.0), self._at(0.5 + level / 2.0)
        return None if low is None or high is None else np.asarray(high - low)

    def normalised(self) -> Floats | None:
        """Return the error over the deviation of a normal of two halves.

        Each half has the median and the outermost quantile of its side. None without a level on
        either side of one half, or where a half has no width.
        """
        first, last = self.levels[0], self.levels[-1]
        if not first < 0.5 < last:
            return None
        median = self._median
        down = (median - self.values[0]) / -_normal_quantile(first)
        up = (self.values[-1] - median) / _normal_quantile(last)
        if not (np.all(down > 0.0) and np.all(up > 0.0)):
            return None
        error = median - self.truth
        return np.asarray(error / np.where(error > 0.0, down, up))

    def below(self, level: float) -> Floats | None:
        """Return where the truth is not above the quantile."""
        at = self._at(level)
        return None if at is None else np.asarray((self.truth <= at) * 1.0)

    def _at(self, level: float) -> Floats | None:
        for k, stated in enumerate(self.levels):
            if abs(stated - level) < 1e-9:
                return np.asarray(self.values[k])
        return None

    @cached_property
    def _median(self) -> Floats:
        k = int(np.searchsorted(self.levels, 0.5, side="left"))
        low, high = self.levels[k - 1], self.levels[k]
        share = (0.5 - low) / (high - low)
        return np.asarray((1.0 - share) * self.values[k - 1] + share * self.values[k])


def _mean_square(first: float | Floats, last: float | Floats) -> Floats:
    """Return the mean of the square of what goes straight from `first` to `last`."""
    return np.asarray((first * first + first * last + last * last) / 3.0)


def _normal_quantile(probability: float) -> float:
    from scipy.special import ndtri  # slow to import, and few methods state a variance

    return float(ndtri(probability))


@dataclass(frozen=True)
class Innovations:
    """What a filter showed of its innovations in the samples that count, by channel.

    Attributes
    ----------
    residuals, variances
        Last reading less its prediction and the variance expected of it, each of shape (n,).
    """

    residuals: dict[str, Floats]
    variances: dict[str, Floats]

    @cached_property
    def normalised(self) -> dict[str, Floats]:
        """Return the error over the stated deviation."""
        """Innovations over their deviation, where the filter took a reading, shape (m,) each.

        A sample without one has the variance 0, or both values of the sample before.
        """
        found = {}
        for channel, residual in self.residuals.items():
            variance = self.variances[channel]
            fresh = variance > 0.0
            fresh[1:] &= (np.diff(residual) != 0.0) | (np.diff(variance) != 0.0)
            found[channel] = residual[fresh] / np.sqrt(variance[fresh])
        return found

    @cached_property
    def whiteness(self) -> tuple[WhitenessTest, ...]:
        """Test of each channel that has enough innovations for one, not all of them zero."""
        return tuple(
            whiteness_test(values)
            for values in self.normalised.values()
            if len(values) > LAGS and np.any(values) and np.all(np.isfinite(values))
        )
