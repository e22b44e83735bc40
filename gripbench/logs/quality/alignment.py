"""Clocks within a log: series in, how late each is against what it must move with out.

The offset is where the correlation with its law's other side is highest; its uncertainty is the
spread over parts of the log. Nothing is moved here: a map says `delay` or `shift`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.logs.channels.grids import correlation, on_grid, without_trend
from gripbench.logs.channels.series import Floats, Series
from gripbench.logs.quality.speeds import best_integral, lateral_velocity, speed_of

_STEP = 0.02  # s
_FARTHEST = 1.6  # s
_CORRELATED = 0.8
_CLEARER = 2e-4  # by which the best offset must correlate better than none
_ALIKE = 3e-3  # peaks so near are equally good: the smallest offset counts
_PARTS = 5
_SMOOTH = 6.0  # s
_LEAST = 0.06  # s
_LEAST_OF_LIKE = 0.25  # s, of sides that are alike only: slip or the sideslip's change comes in
_CORRELATED_LIKE = 0.9
_SLIDING = 0.1  # rad; at larger sideslip the sides that are alike are so no more
_GPS = ("course", "speed_gps", "velocity_north", "velocity_west")
_LEAST_OF_STEERING = 0.35  # s; tyres and body answer a steering angle that late


@dataclass(frozen=True)
class Lag:
    """How late a series is.

    Attributes
    ----------
    key
        The series, by its key in the map.
    lag, deviation
        By how much it comes late [s], negative: early, and the standard deviation.
    against
        What it was compared with.
    """

    key: str
    lag: float
    deviation: float
    against: str


def lags(
    channels: dict[str, Series], reference: dict[str, Series], vehicle: dict[str, float]
) -> list[Lag]:
    """Return the series that are clearly late or early, each once, by their best comparison."""
    found: dict[str, Lag] = {}
    best: dict[str, float] = {}
    for key, against, least, left, right in _pairs(channels, reference, vehicle):
        measured = _lag(left, right)
        if measured is None:
            continue
        lag, deviation, strength = measured
        if least > _LEAST and strength < _CORRELATED_LIKE:
            continue
        if strength <= best.get(key, 0.0):
            continue
        best[key] = strength
        if abs(lag) > max(least, 4.0 * deviation):
            found[key] = Lag(key, lag, deviation, against)
        else:
            found.pop(key, None)
    return list(found.values())


def shifted(series: dict[str, Series], found: list[Lag]) -> dict[str, Series]:
    """Return series by name with the offsets taken off."""
    by_key = {lag.key: lag.lag for lag in found}
    return {
        name: replace(one, times=one.times - by_key[one.key]) if one.key in by_key else one
        for name, one in series.items()
    }


def _pairs(
    channels: dict[str, Series], reference: dict[str, Series], vehicle: dict[str, float]
) -> Iterator[tuple[str, str, float, Floats, list[Floats]]]:
    """Yield a suspect's key, what it is compared with, the least lag that counts, and both."""
    # A channel whose map tells its delay stays where it arrived; its age is the method's matter.
    seen = {
        name: series
        for name, series in channels.items()
        if not series.column.delay and not ("gps_time" in channels and name in _GPS)
    }
    reference = {name: s for name, s in reference.items() if "derived" not in s.key}
    for series, left, *right in lateral_velocity(seen, reference, vehicle, _STEP):
        yield series.key, "integral of accel_y - speed * yaw_rate", _LEAST, left, right
    yaw_rate = seen.get("yaw_rate")
    speed = speed_of(seen, reference, vehicle)
    for name in ("yaw_rate", "accel_y", "accel_x", "speed_x"):
        if name in seen and name in reference and seen[name].key != reference[name].key:
            least = _LEAST if name != "speed_x" else _LEAST_OF_LIKE
            yield from _pair(
                reference[name], f"channels.{name}", [seen[name]], lambda a, b: (a, b), least
            )
    slip = reference.get("sideslip")
    if slip is not None and float(np.percentile(np.abs(slip.values), 98.0)) > _SLIDING:
        return
    for source in (reference, seen):
        for name in ("yaw", "course"):
            if yaw_rate is not None and name in source and "derived" not in source[name].key:
                turning = replace(source[name], values=np.unwrap(source[name].values))
                yield from _pair(
                    turning, "yaw rate", [yaw_rate],
                    lambda h, r: (np.gradient(h, _STEP), r),
                    _LEAST if name == "yaw" else _LEAST_OF_LIKE,
                )  # fmt: skip
        for name in ("speed_x", "speed_gps"):
            if "accel_x" in seen and name in source:
                yield from _pair(
                    source[name], "longitudinal acceleration", [seen["accel_x"]],
                    lambda v, a: (np.gradient(v, _STEP), a), _LEAST_OF_LIKE,
                )  # fmt: skip
    if speed is not None and yaw_rate is not None and "accel_y" in seen:
        yield from _pair(
            seen["accel_y"], "speed * yaw_rate", [yaw_rate, speed], lambda a, r, v: (a, v * r),
            _LEAST_OF_LIKE,
        )  # fmt: skip
    if yaw_rate is not None and "steer_angle" in seen:
        yield from _pair(
            seen["steer_angle"], "yaw rate", [yaw_rate], lambda d, r: (d, r),
            _LEAST_OF_STEERING,
        )  # fmt: skip


def _pair(suspect, against, others, sides, least=_LEAST):  # type: ignore[no-untyped-def]
    grid = on_grid([suspect, *others], _STEP)
    if grid is None:
        return
    left, right = sides(*grid)
    width = round(_SMOOTH / _STEP)
    spacing = float(np.median(np.diff(suspect.times)))
    floor = max(least, 0.75 * spacing)
    yield suspect.key, against, floor, without_trend(left, width), [without_trend(right, width)]


def _lag(left: Floats, right: list[Floats]) -> tuple[float, float, float] | None:
    """Return by how much the left side is late, its deviation, and the correlation there."""
    reach = round(_FARTHEST / _STEP)
    if len(left) < 6 * reach:
        return None
    # The smallest offset within a little of the best: a periodic signal fits at several.
    offsets = np.arange(-reach, reach + 1)
    values = np.array([_shifted_correlation(left, right, int(offset)) for offset in offsets])
    best = float(np.max(np.abs(values)))
    if best < _CORRELATED:
        return None
    if best - abs(values[reach]) < _CLEARER:
        return 0.0, _STEP, best
    peaks = [
        i
        for i in range(1, len(offsets) - 1)
        if abs(values[i]) >= abs(values[i - 1])
        and abs(values[i]) >= abs(values[i + 1])
        and best - abs(values[i]) < _ALIKE
    ]
    if not peaks:
        return None
    at = min(peaks, key=lambda i: abs(offsets[i]))
    lag = _refined(offsets, np.abs(values), at) * _STEP
    parts = [
        part
        for rows in np.array_split(np.arange(len(left)), _PARTS)
        if (part := _near(left[rows], [one[rows] for one in right], int(offsets[at]))) is not None
    ]
    spread = float(np.std(parts, ddof=1)) / math.sqrt(len(parts)) if len(parts) > 1 else _STEP
    return lag, max(spread, 0.1 * _STEP), best


def _near(left: Floats, right: list[Floats], around: int) -> float | None:
    """Return the offset [s] of a part of the log, near that of the whole."""
    reach = round(0.3 / _STEP)
    if len(left) < 3 * (abs(around) + reach):
        return None
    offsets = np.arange(around - reach, around + reach + 1)
    values = np.array([abs(_shifted_correlation(left, right, int(o))) for o in offsets])
    at = int(np.argmax(values))
    if values[at] < 0.5 * _CORRELATED or at in (0, len(offsets) - 1):
        return None
    return _refined(offsets, values, at) * _STEP


def _refined(offsets: npt.NDArray[Any], values: Floats, at: int) -> float:
    """Return the top of the parabola through a peak and its neighbours."""
    low, top, high = values[at - 1], values[at], values[at + 1]
    curvature = low - 2.0 * top + high
    return float(offsets[at]) + (0.5 * (low - high) / curvature if curvature < 0.0 else 0.0)


def _shifted_correlation(left: Floats, right: list[Floats], offset: int) -> float:
    if offset >= 0:
        seen, others = left[offset:], [one[: len(one) - offset] for one in right]
    else:
        seen, others = left[:offset], [one[-offset:] for one in right]
    if len(others) == 1:
        return correlation(seen, others[0])
    return best_integral(seen, *others)[0]
