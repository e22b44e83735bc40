"""Channels and reference in, the forward speed and the integrals of the lateral velocity out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gripbench.logs.channels.grids import on_grid, without_trend
from gripbench.logs.channels.series import Floats, Series
from gripbench.logs.quality.law_forms import MOVING

_SMOOTH = 4.0  # s; slower parts of an integral are drift
_BODY_ROLL = np.linspace(0.9, 1.1, 21)  # what body roll does to a lateral accelerometer's scale


def speed_of(
    channels: dict[str, Series], reference: dict[str, Series], vehicle: dict[str, float]
) -> Series | None:
    """Return the best series of the forward speed [m/s], or None."""
    for source in (reference, channels):
        for name in ("speed_x", "speed_gps"):
            if name in source:
                return source[name]
    radius = vehicle.get("wheel_radius")
    for name in ("wheel_speed_rear", "wheel_speed_rear_left", "wheel_speed_front"):
        if radius and name in channels:
            return replace(channels[name], values=channels[name].values * radius)
    return None


def lateral_velocity(
    channels: dict[str, Series],
    reference: dict[str, Series],
    vehicle: dict[str, float],
    step: float,
) -> Iterator[tuple[Series, Floats, Floats, Floats]]:
    """Yield what measures the lateral velocity, and the integrals that give it.

    All are without what is slower than 4 s, so that drift and a bank of the road drop out.

    Yields
    ------
    The series, its lateral velocity, and the integrals of accel_y and of speed * yaw_rate [m/s], on
    a grid of `step`.
    """
    speed = speed_of(channels, reference, vehicle)
    accel = channels.get("accel_y", reference.get("accel_y"))
    turning = channels.get("yaw_rate", reference.get("yaw_rate"))
    if speed is None or accel is None or turning is None:
        return
    width = round(_SMOOTH / step)
    for source in (reference, channels):
        for name in ("sideslip", "speed_y"):
            series = source.get(name)
            if series is None or "derived" in series.key:
                continue
            grid = on_grid([series, accel, turning, speed], step)
            if grid is None or len(grid[0]) < 3 * width:
                continue
            value, a, r, v = grid
            if np.median(np.abs(v)) < MOVING:
                continue
            sideways = v * np.tan(np.clip(value, -1.5, 1.5)) if name == "sideslip" else value
            if name == "sideslip" and np.max(np.abs(value)) > 1.5:
                sideways = v * value
            yield (
                series,
                without_trend(sideways, width),
                without_trend((np.cumsum(a) - 0.5 * a) * step, width),
                without_trend((np.cumsum(v * r) - 0.5 * v * r) * step, width),
            )


def best_integral(seen: Floats, accel: Floats, turn: Floats) -> tuple[float, float]:
    """Return the correlation of a lateral velocity with k * accel - turn, and their ratio.

    k, what body roll does to an accelerometer's scale, is the one that correlates best.
    """
    s = float(np.mean(seen * seen))
    sa, st = float(np.mean(seen * accel)), float(np.mean(seen * turn))
    aa, at, tt = (float(np.mean(x * y)) for x, y in ((accel, accel), (accel, turn), (turn, turn)))
    size = np.sqrt(np.maximum(_BODY_ROLL**2 * aa - 2.0 * _BODY_ROLL * at + tt, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.nan_to_num((_BODY_ROLL * sa - st) / (size * math.sqrt(s)))
    best = int(np.argmax(np.abs(found)))
    ratio = math.sqrt(s) / float(size[best]) if size[best] > 0.0 else math.inf
    return float(found[best]), ratio
