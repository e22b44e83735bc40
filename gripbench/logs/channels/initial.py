"""The first standstill or straight stretch of a log, from which sensors take their zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gripbench.compilation import compiled
from gripbench.errors import InputError
from gripbench.logs.channels.series import Floats, Series

STANDSTILL_SPEED = 0.05
"""Speed [m/s], or circumferential speed where the wheels' is in rad/s, of a vehicle at rest."""

SHORTEST = {"standstill": 1.0, "straight": 2.0}
"""Shortest stretch [s] that serves."""

_STEER_RANGE = np.deg2rad(1.0)  # at the road wheels, peak to peak, on a straight stretch
_COURSE_RANGE = np.deg2rad(1.5)
_SPEEDS = (
    "speed_x", "speed_gps", "wheel_speed_rear", "wheel_speed_rear_left", "wheel_speed_front",
    "wheel_speed_front_left",
)  # fmt: skip
_ACROSS = ("accel_x", "accel_y")


def zeroed(channels: dict[str, Series]) -> tuple[dict[str, Series], dict[str, float]]:
    """Return the channels with the zeros taken off that their map asks for, and those zeros.

    Raises
    ------
    InputError
        If a channel asks for a stretch that the log does not have.
    """
    found = dict(channels)
    zeros: dict[str, float] = {}
    for name, series in channels.items():
        kind = series.column.zero
        if not kind:
            continue
        stretch = first_stretch(channels, kind)
        if stretch is None:
            raise InputError(
                f"channel map: key '{series.key}.zero': the log has no {kind} "
                f"of {SHORTEST[kind]:g} s"
            )
        inside = (series.times >= stretch[0]) & (series.times <= stretch[1])
        if not inside.any():
            raise InputError(
                f"channel map: key '{series.key}.zero': no sample within the first {kind}, "
                f"{stretch[0]:.3f} s to {stretch[1]:.3f} s"
            )
        zeros[name] = float(series.values[inside].mean())
        found[name] = replace(series, values=series.values - zeros[name])
    return found, zeros


def first_stretch(channels: dict[str, Series], kind: str) -> tuple[float, float] | None:
    """Return the first `standstill` or `straight` stretch as its start and end [s], or None."""
    if kind == "standstill":
        speed = next((channels[name] for name in _SPEEDS if name in channels), None)
        if speed is None:
            return None
        return _first_run(speed.times, np.abs(speed.values) < STANDSTILL_SPEED, SHORTEST[kind])
    if "steer_angle" in channels:
        return _first_level(channels["steer_angle"], _STEER_RANGE, SHORTEST[kind])
    if "course" in channels:
        course = channels["course"]
        unwrapped = replace(course, values=np.unwrap(course.values))
        return _first_level(unwrapped, _COURSE_RANGE, SHORTEST[kind])
    return None


def _first_run(
    times: Floats, holds: np.ndarray[tuple[int], np.dtype[np.bool_]], shortest: float
) -> tuple[float, float] | None:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], holds.astype(np.int8), [0]])))
    for start, end in zip(edges[::2], edges[1::2] - 1, strict=True):
        if times[end] - times[start] >= shortest:
            return float(times[start]), float(times[end])
    return None


def _first_level(series: Series, widest: float, shortest: float) -> tuple[float, float] | None:
    """Return the first stretch of at least `shortest` whose values span at most `widest`.

    A steering angle must also be near its median over the log: in a held curve it is level too.
    """
    middle = float(np.median(series.values)) if series.name == "steer_angle" else np.nan
    start, end = _level_rows(series.times, series.values, widest, shortest, middle)
    return (float(series.times[start]), float(series.times[end])) if start >= 0 else None


@compiled
def _level_rows(times, values, widest, shortest, middle):  # type: ignore[no-untyped-def]
    start = 0
    low = high = values[0]
    for row in range(1, len(times)):
        new_low, new_high = min(low, values[row]), max(high, values[row])
        if new_high - new_low > widest or abs(values[row] - middle) > widest:
            if times[row - 1] - times[start] >= shortest:
                return start, row - 1
            start = row
            low = high = values[row]
        else:
            low, high = new_low, new_high
    if times[-1] - times[start] >= shortest:
        return start, len(times) - 1
    return -1, -1
