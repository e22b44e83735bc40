"""Profiles over time as TOML gives them: pieces of line and sine, with jumps between them."""

from __future__ import annotations

from math import pi, sin
from typing import Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from gripbench.compilation import compiled, inlined
from gripbench.configuration import Configuration

SEGMENT_TYPE = np.dtype(
    [(name, np.float64) for name in ("start", "end", "first", "last", "amplitude", "period")]
)


class Segment(Configuration):
    """One piece: a line from `first` to `last`, plus `amplitude * sin(2 pi (t - start) / period)`.

    Times are in seconds; the values have the unit of what the profile drives.
    """

    start: float = Field(ge=0.0)
    end: float = Field(gt=0.0)
    first: float = 0.0
    last: float = 0.0
    amplitude: float = 0.0
    period: float = Field(default=1.0, gt=0.0)

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if self.end <= self.start:
            raise ValueError(f"end {self.end:g} s is not after start {self.start:g} s")
        return self


def check_range(segments: tuple[Segment, ...], low: float, high: float) -> None:
    """Raise a ValueError if a piece may leave the range, its sine at full amplitude."""
    for piece in segments:
        for value in (
            min(piece.first, piece.last) - abs(piece.amplitude),
            max(piece.first, piece.last) + abs(piece.amplitude),
        ):
            if not low <= value <= high:
                raise ValueError(
                    f"the piece from {piece.start:g} s reaches {value:g}; "
                    f"allowed is {low:g} to {high:g}"
                )


def segment_records(segments: tuple[Segment, ...]) -> npt.NDArray[np.void]:
    """Return the pieces as a structured array; times that no piece covers have the value 0."""
    rows = [(s.start, s.end, s.first, s.last, s.amplitude, s.period) for s in segments]
    return np.array(rows, SEGMENT_TYPE)


def breakpoints(segments: tuple[Segment, ...]) -> set[float]:
    """Return the times at which a profile or its slope may jump."""
    return {time for s in segments for time in (s.start, s.end)}


@inlined
def _piece_value(time, piece):
    share = (time - piece.start) / (piece.end - piece.start)
    value = piece.first + (piece.last - piece.first) * share
    if piece.amplitude != 0.0:
        value += piece.amplitude * sin(2.0 * pi * (time - piece.start) / piece.period)
    return value


@compiled
def profile_value(time, segments):
    """Return the value of a profile; at a jump, the value after it."""
    value = 0.0
    for i in range(segments.shape[0]):
        piece = segments[i]
        if piece.start <= time < piece.end:
            value += _piece_value(time, piece)
    return value


@compiled
def profile_values(times, segments):
    """Return the values of a profile at ascending times, the bytes of `profile_value`."""
    values = np.zeros(times.shape[0])
    for i in range(segments.shape[0]):
        piece = segments[i]
        begin = np.searchsorted(times, piece.start)
        end = np.searchsorted(times, piece.end)
        for k in range(begin, end):
            values[k] += _piece_value(times[k], piece)
    return values
