"""The tables of a channel map that name times: windows, and what is known of a signal in them."""

from __future__ import annotations

import itertools
from typing import Self

from pydantic import ConfigDict, Field, model_validator

from gripbench.configuration import Configuration


class Bound(Configuration):
    """What is known of a signal that no instrument measured: it lay within an interval.

    Attributes
    ----------
    low, high
        The interval, in SI units.
    start, end
        When it holds [s], on the clock of the map's windows; by default always.
    source
        How it is known.
    """

    low: float
    high: float
    start: float | None = None
    end: float | None = None
    source: str

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        ordered = self.start is None or self.end is None or self.start < self.end
        if self.low > self.high or not ordered:
            raise ValueError("low must not exceed high, and start must come before end")
        return self


Intervals = tuple[tuple[float, float], ...]
"""Pairs of a start and an end [s]."""


class Windows(Configuration):
    """Named lists of intervals [s]: every key beside those below is the name of one.

    Attributes
    ----------
    from_start
        Whether times count from the first row; otherwise they are those of the log's own clock,
        as the quality report gives them.
    covered
        Share of each interval, from 0 to 1, in which every signal of the reference has to be
        known.
    """

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Intervals] = Field(init=False)

    from_start: bool = False
    covered: float = Field(default=0.9, ge=0.0, le=1.0)

    @property
    def intervals(self) -> dict[str, Intervals]:
        """Return the lists by name."""
        return dict(self.__pydantic_extra__)

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        for name, intervals in self.intervals.items():
            for start, end in intervals:
                if start >= end:
                    raise ValueError(f"{name}: an interval must start before it ends")
            for before, after in itertools.pairwise(sorted(intervals)):
                if after[0] < before[1]:
                    raise ValueError(f"{name}: {list(before)} and {list(after)} overlap")
        for one in self.intervals.get("train", ()):
            for other in self.intervals.get("test", ()):
                if max(one[0], other[0]) < min(one[1], other[1]):
                    raise ValueError(
                        f"train {list(one)} and test {list(other)} overlap: what a method is tuned "
                        "on says nothing of it"
                    )
        return self
