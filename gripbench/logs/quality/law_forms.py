"""Two sides of a law as series in, the factor between them out.

A law holds where its factor, left side over right side, is near 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from gripbench.logs.channels.grids import FEWEST, correlation, on_grid
from gripbench.logs.channels.series import Floats, Series

TOLERANCE = math.log(1.6)
LOOSE = math.log(2.5)
"""Where understeer, load transfer or a ramp of the road comes in."""


ANY = math.inf
"""Where only the sign is told."""

CORRELATED = 0.75
"""Correlation of two sides from which they say something of each other."""

STEPS = (0.1, 0.3, 1.0, 3.0)
"""Steps [s] of the grids; the coarser ones average noise away."""

MOVING = 2.0
"""Speed [m/s] above which a vehicle moves."""


@dataclass(frozen=True)
class Law:
    """One law of physics, evaluated.

    Attributes
    ----------
    text
        The law in words of signals.
    powers
        Exponent with which each series, by key, enters the factor.
    factor
        Left side over right side; 1 where the law holds.
    tolerance
        How far the factor's logarithm may be from 0.
    limit
        Whether the factor is a magnitude over what is possible: any below 1 will do.
    """

    text: str
    powers: dict[str, int]
    factor: float
    tolerance: float = TOLERANCE
    limit: bool = False

    def changed(self, changes: dict[str, float]) -> float:
        """Return the factor once each series, by key, is multiplied by its change."""
        factor = self.factor
        for key, power in self.powers.items():
            change = changes.get(key, 1.0)
            factor *= math.copysign(abs(change) ** power, change if power % 2 else 1.0)
        return factor

    def holds(self, changes: dict[str, float]) -> bool:
        """Whether the law holds once each series, by key, is multiplied by its change."""
        factor = self.changed(changes)
        if self.limit:
            return abs(factor) <= 1.0
        return factor > 0.0 and abs(math.log(factor)) <= self.tolerance

    def fault(self) -> str:
        """Return in words how the law does not hold."""
        if self.limit:
            return self.text
        return f"{self.text}: the left side is {self.factor:.3g} times the right one"


def moving_together(
    text: str,
    terms: list[tuple[Series, int]],
    sides: Callable[..., tuple[Floats, Floats]],
    tolerance: float,
    extra: list[Series] | None = None,
) -> Iterator[Law]:
    """Yield the law whose sides vary together, if the log excites it enough."""
    series = [terms[0][0], *extra] if extra else [one for one, _ in terms]
    best, factor = CORRELATED, 0.0
    for step in STEPS:
        grid = on_grid(series, step)
        if grid is None:
            break
        left, right = sides(step, *grid)
        if len(left) < FEWEST:
            continue
        left, right = left - left.mean(), right - right.mean()
        found = correlation(left, right)
        if abs(found) > best:
            ratio = 1.0 if tolerance == ANY else float(np.std(left) / np.std(right))
            best, factor = abs(found), math.copysign(ratio, found)
    if factor:
        yield Law(text, {one.key: power for one, power in terms}, factor, tolerance)


def equal_level(
    text: str, left: Series, right: Series, factor: float = 1.0, tolerance: float = TOLERANCE
) -> Iterator[Law]:
    """Yield the law whose sides are equal in level, as two speeds are."""
    grid = on_grid([left, right], STEPS[0])
    if grid is None:
        return
    a, b = grid
    moving = np.abs(b) > 0.2 * np.max(np.abs(b), initial=0.0)
    if moving.sum() < FEWEST or not np.any(b[moving]):
        return
    ratio = float(np.median(a[moving] / b[moving])) * factor
    if ratio != 0.0:
        yield Law(text, {left.key: 1, right.key: -1}, ratio, tolerance)


def equal_magnitude(
    what: str, north: Series, west: Series, speed: Series, position: bool
) -> Iterator[Law]:
    """Yield that a velocity's magnitude, or a position's change, is the speed."""
    grid = on_grid([north, west, speed], STEPS[1])
    if grid is None:
        return
    x, y, v = grid
    if position:
        x, y = np.gradient(x, STEPS[1]), np.gradient(y, STEPS[1])
    moving = np.abs(v) > max(MOVING, 0.2 * float(np.max(np.abs(v))))
    if moving.sum() < FEWEST:
        return
    ratio = float(np.median(np.hypot(x, y)[moving] / np.abs(v)[moving]))
    if ratio > 0.0:
        # One unit serves both components, so the speed is the other suspect.
        yield Law(f"{what} = {speed.key}", {speed.key: -1}, ratio, TOLERANCE)
