"""Spreads: from a quantile of a uniform variable, the deviation of a cause from its value on paper.

A normal spread is cut off at three of its standard deviations (of the normal before the cut) and
widened so that the declared standard deviation is exact: every spread has a bounded support, over
which a car can be checked to be one.
"""

from __future__ import annotations

import math
from typing import Self

from pydantic import Field, model_validator

from gripbench.configuration import Configuration

CUT = 3.0
"""Where a normal spread ends, in standard deviations of the normal before the cut."""

_MASS = math.erf(CUT / math.sqrt(2.0))
_DENSITY = math.exp(-0.5 * CUT * CUT) / math.sqrt(2.0 * math.pi)
_KEPT = math.sqrt(1.0 - 2.0 * CUT * _DENSITY / _MASS)
"""Standard deviation of a standard normal that is cut off."""


class Spread(Configuration):
    """How one cause deviates from its value on paper at level 1; a higher level scales it.

    Either `std`, a normal around zero, or `low` and `high`, a uniform; with neither there is none.

    Attributes
    ----------
    std
        Standard deviation of a normal.
    low, high
        Ends of a uniform.
    centre
        Value around which the cause deviates where the car on paper has none (the place of a
        payload); no level scales it.
    source
        Where the spread comes from.
    guess
        Whether no source gives it.
    """

    std: float = Field(default=0.0, ge=0.0)
    low: float = 0.0
    high: float = 0.0
    centre: float = 0.0
    source: str
    guess: bool = False

    @model_validator(mode="after")
    def _check_kind(self) -> Self:
        if self.high < self.low:
            raise ValueError(f"high {self.high:g} is below low {self.low:g}: a negative spread")
        if self.std > 0.0 and self.high > self.low:
            raise ValueError("give either 'std' or 'low' and 'high'")
        return self

    def deviation(self, quantile: float) -> float:
        """Return the deviation that belongs to a quantile, 0 to 1."""
        if self.std > 0.0:
            from scipy.special import ndtri

            inside = 0.5 + (quantile - 0.5) * _MASS
            return float(self.std / _KEPT * ndtri(inside))
        return self.low + (self.high - self.low) * quantile

    @property
    def support(self) -> tuple[float, float]:
        """The least and the largest deviation."""
        if self.std > 0.0:
            return -CUT * self.std / _KEPT, CUT * self.std / _KEPT
        return self.low, self.high

    @property
    def moments(self) -> tuple[float, float]:
        """Mean and standard deviation of the deviation."""
        if self.std > 0.0:
            return 0.0, self.std
        return 0.5 * (self.low + self.high), (self.high - self.low) / math.sqrt(12.0)


class TyreChoice(Configuration):
    """How often each shape of the tyres' force curve occurs."""

    brush: float = Field(default=0.0, ge=0.0)
    dugoff: float = Field(default=0.0, ge=0.0)
    magic_formula: float = Field(default=0.0, ge=0.0)
    fitted_curve: float = Field(default=0.0, ge=0.0)
    source: str
    guess: bool = False

    @model_validator(mode="after")
    def _check_sum(self) -> Self:
        total = sum(self.shares.values())
        if abs(total - 1.0) > 1e-9:
            raise ValueError(f"the shares of the shapes sum up to {total:g}; it must be 1")
        return self

    @property
    def shares(self) -> dict[str, float]:
        """Share of each shape."""
        names = ("brush", "dugoff", "magic_formula", "fitted_curve")
        return {name: getattr(self, name) for name in names}

    def shape(self, quantile: float) -> str:
        """Return the shape that belongs to a quantile, 0 to 1."""
        reached = 0.0
        for name, share in self.shares.items():
            reached += share
            if quantile < reached:
                return name
        return next(name for name, share in reversed(self.shares.items()) if share > 0.0)
