"""Units and signs by physics: every law that binds two channels gives the factor between them.

A law holds where its factor is near 1. Where some do not, the smallest change of the map (another
unit, the other sign, of one channel or two) that makes all of them hold is the mend to suggest.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from gripbench.envs.vehicles import GRAVITY
from gripbench.logs.series import Floats, Series
from gripbench.logs.units import UNITS

_TOLERANCE = math.log(1.6)
_LOOSE = math.log(2.5)  # where understeer, load transfer or a ramp of the road comes in
_STEPS = (0.1, 0.3, 1.0, 3.0)  # s; the coarser ones average noise away
_FEWEST = 20  # samples of the grid
_CORRELATED = 0.75
_EARTH_FIELD = 48e-6  # T, between 22 and 67 over the globe
_WHEELS = (
    "wheel_speed_front", "wheel_speed_rear", "wheel_speed_front_left", "wheel_speed_front_right",
    "wheel_speed_rear_left", "wheel_speed_rear_right",
)  # fmt: skip
_FIELD = ("magnetic_field_x", "magnetic_field_y", "magnetic_field_z")


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
    """

    text: str
    powers: dict[str, int]
    factor: float
    tolerance: float = _TOLERANCE

    def holds(self, changes: dict[str, float]) -> bool:
        """Whether the law holds once each series, by key, is multiplied by its change."""
        factor = self.factor
        for key, power in self.powers.items():
            change = changes.get(key, 1.0)
            factor *= math.copysign(abs(change) ** power, change if power % 2 else 1.0)
        return factor > 0.0 and abs(math.log(factor)) <= self.tolerance


@dataclass(frozen=True)
class Misfit:
    """A law that does not hold, and the change of the map that mends it."""

    key: str
    message: str
    suggestion: str = ""


def misfits(
    channels: dict[str, Series], reference: dict[str, Series], vehicle: dict[str, float]
) -> list[Misfit]:
    """Return what contradicts physics.

    Parameters
    ----------
    channels, reference
        Series by signal name.
    vehicle
        Vehicle parameters; the laws that need one that is missing are left out.
    """
    laws = list(_laws(channels, reference, vehicle))
    broken = [law for law in laws if not law.holds({})]
    if not broken:
        return []
    series = {s.key: s for s in [*channels.values(), *reference.values()]}
    found = [f"{law.text}: the left side is {law.factor:.3g} times the right one" for law in broken]
    mends = _mends(laws, broken, series)
    if not mends:
        return [
            Misfit(next(iter(law.powers)), text) for law, text in zip(broken, found, strict=True)
        ]
    best = mends[0]
    suggestion = " and ".join(f"{key}: {_change_text(series[key], best[key])}" for key in best)
    if len(mends) > 1:
        others = [
            " and ".join(f"{key}: {_change_text(series[key], mend[key])}" for key in mend)
            for mend in mends[1:3]
        ]
        suggestion += "; or " + "; or ".join(others)
    return [Misfit(" and ".join(best), "; ".join(found), suggestion)]


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


def _laws(
    channels: dict[str, Series], reference: dict[str, Series], vehicle: dict[str, float]
) -> Iterator[Law]:
    speed = speed_of(channels, reference, vehicle)
    yaw_rate, steer = channels.get("yaw_rate"), channels.get("steer_angle")
    if speed is not None:
        if yaw_rate is not None and "accel_y" in channels:
            yield from _moving_law(
                "accel_y = speed * yaw_rate",
                [(channels["accel_y"], 1), (speed, -1), (yaw_rate, -1)],
                lambda _, a, v, r: (a, v * r),
                _LOOSE,
            )
        if "accel_x" in channels:
            yield from _moving_law(
                "accel_x = rate of change of speed",
                [(channels["accel_x"], 1), (speed, -1)],
                lambda step, a, v: (a, np.gradient(v, step)),
                _LOOSE,
            )
        wheelbase = vehicle.get("cg_to_front", 0.0) + vehicle.get("cg_to_rear", 0.0)
        if steer is not None and yaw_rate is not None and wheelbase:
            yield from _moving_law(
                "yaw_rate = speed * steer_angle / wheelbase",
                [(yaw_rate, 1), (speed, -1), (steer, -1)],
                lambda _, r, v, d: (r, v * d / wheelbase),
                _LOOSE,
            )
        radius = vehicle.get("wheel_radius")
        for name in _WHEELS:
            if radius and name in channels and channels[name].key != speed.key:
                text = f"{name} * wheel_radius = {speed.name}"
                yield from _level_law(text, channels[name], speed, radius)
        for name in ("speed_x", "speed_gps"):
            if name in channels and channels[name].key != speed.key:
                yield from _level_law(f"{name} = {speed.key}", channels[name], speed)
    for name in ("yaw", "course"):
        angle = channels.get(name) or reference.get(name)
        if angle is not None and yaw_rate is not None:
            turning = replace(angle, values=np.unwrap(angle.values))
            yield from _moving_law(
                f"yaw_rate = rate of change of {name}",
                [(yaw_rate, 1), (turning, -1)],
                lambda step, r, h: (r, np.gradient(h, step)),
                _TOLERANCE,
            )
    for name in ("yaw_rate", "accel_x", "accel_y", "sideslip"):
        if name in channels and name in reference and channels[name].key != reference[name].key:
            yield from _moving_law(
                f"{name} = {reference[name].key}",
                [(channels[name], 1), (reference[name], -1)],
                lambda _, a, b: (a, b),
                _TOLERANCE,
            )
    slip, left, ahead = (reference.get(name) for name in ("sideslip", "speed_y", "speed_x"))
    if slip and left and ahead and "derived" not in slip.key:
        yield from _moving_law(
            "sideslip = atan2(speed_y, speed_x)",
            [(slip, 1), (left, -1), (ahead, 1)],
            lambda _, b, y, x: (b[x > 1.0], np.arctan2(y, x)[x > 1.0]),
            _TOLERANCE,
        )
    yield from _field_laws(channels)


def _field_laws(channels: dict[str, Series]) -> Iterator[Law]:
    """Yield what gravity and the earth's magnetic field say of their sensors."""
    if "accel_z" in channels:
        vertical = channels["accel_z"]
        level = float(np.median(vertical.values)) / GRAVITY
        if level:
            yield Law("accel_z = gravity", {vertical.key: 1}, level)
    if all(name in channels for name in _FIELD):
        medians = {name: abs(float(np.median(channels[name].values))) for name in _FIELD}
        strength = math.hypot(*medians.values())
        if strength:
            # One unit serves all three. Which way a component points is as may be: only the
            # magnitude is judged, and loosely, for a body's own field may exceed the earth's.
            strongest = channels[max(medians, key=lambda name: medians[name])]
            factor = (strength / _EARTH_FIELD) ** 2
            text = "magnetic field squared = the earth's squared"
            yield Law(text, {strongest.key: 2}, factor, 2.0 * math.log(6.0))


def _moving_law(
    text: str,
    terms: list[tuple[Series, int]],
    sides: Callable[..., tuple[Floats, Floats]],
    tolerance: float,
) -> Iterator[Law]:
    """Yield the law whose sides vary together, if the log excites it enough."""
    series = [one for one, _ in terms]
    best, factor = _CORRELATED, 0.0
    for step in _STEPS:
        grid = _on_grid(series, step)
        if grid is None:
            break
        left, right = sides(step, *grid)
        if len(left) < _FEWEST:
            continue
        left, right = left - left.mean(), right - right.mean()
        spread = float(np.std(left)), float(np.std(right))
        if min(spread) == 0.0:
            continue
        correlation = float(np.mean(left * right)) / (spread[0] * spread[1])
        if abs(correlation) > best:
            best, factor = abs(correlation), math.copysign(spread[0] / spread[1], correlation)
    if factor:
        yield Law(text, {one.key: power for one, power in terms}, factor, tolerance)


def _level_law(text: str, left: Series, right: Series, factor: float = 1.0) -> Iterator[Law]:
    """Yield the law whose sides are equal in level, as two speeds are."""
    grid = _on_grid([left, right], _STEPS[0])
    if grid is None:
        return
    a, b = grid
    moving = np.abs(b) > 0.2 * np.max(np.abs(b), initial=0.0)
    if moving.sum() < _FEWEST or not np.any(b[moving]):
        return
    ratio = float(np.median(a[moving] / b[moving])) * factor
    if ratio != 0.0:
        yield Law(text, {left.key: 1, right.key: -1}, ratio)


def _on_grid(series: list[Series], step: float) -> list[Floats] | None:
    """Return the means of the series over the same cells of time, or None if these are too few."""
    start = max(s.times[0] for s in series)
    end = min(s.times[-1] for s in series)
    count = int((end - start) / step) - 1
    if count < _FEWEST:
        return None
    centres = start + step * (1.0 + np.arange(count))
    columns = []
    for s in series:
        mean = np.interp(centres, s.times, s.values)
        total = np.concatenate([[0.0], np.cumsum(s.values)])
        first = np.searchsorted(s.times, centres - 0.5 * step)
        last = np.searchsorted(s.times, centres + 0.5 * step)
        averaged = last - first > 1  # a slower series has at most one sample in a cell
        mean[averaged] = (total[last] - total[first])[averaged] / (last - first)[averaged]
        columns.append(mean)
    return columns


def _mends(laws: list[Law], broken: list[Law], series: dict[str, Series]) -> list[dict[str, float]]:
    """Return the smallest changes after which every law holds, the likeliest first."""
    suspects = sorted({key for law in broken for key in law.powers if key in series})
    choices = {key: _changes(series[key]) for key in suspects}
    for size in (1, 2):
        mends = []
        for keys in itertools.combinations(suspects, size):
            for changes in itertools.product(*(choices[key] for key in keys)):
                mend = dict(zip(keys, changes, strict=True))
                if all(law.holds(mend) for law in laws):
                    mends.append((_misfit(laws, mend), mend))
        if mends:
            mends.sort(key=lambda item: item[0])
            return _one_a_series([mend for _, mend in mends])
    return []


def _one_a_series(mends: list[dict[str, float]]) -> list[dict[str, float]]:
    """Keep the best change for each set of series."""
    kept: dict[tuple[str, ...], dict[str, float]] = {}
    for mend in mends:
        kept.setdefault(tuple(mend), mend)
    return list(kept.values())


def _misfit(laws: list[Law], mend: dict[str, float]) -> float:
    """Return how far the mended laws are from holding exactly; mere signs come first."""
    total = 0.0
    for law in laws:
        factor = law.factor
        for key, power in law.powers.items():
            factor *= abs(mend.get(key, 1.0)) ** power
        total += math.log(abs(factor)) ** 2
    return total


def _changes(series: Series) -> list[float]:
    """Return the factors that another unit or sign of a series would bring."""
    given = UNITS[series.column.unit]
    factors = {
        round(unit.factor / given.factor, 12)
        for unit in UNITS.values()
        if unit.dimension == given.dimension
    }
    if series.name == "steer_angle":
        factors |= {factor / ratio for factor in list(factors) for ratio in (10.0, 15.0, 22.0)}
    return [
        sign * factor for factor in sorted(factors) for sign in (1.0, -1.0) if sign * factor != 1.0
    ]


def _change_text(series: Series, change: float) -> str:
    """Return a change of the map in the map's own words."""
    given = UNITS[series.column.unit]
    parts = []
    matches = [
        name
        for name, unit in UNITS.items()
        if unit.dimension == given.dimension
        and abs(unit.factor / given.factor / abs(change) - 1.0) < 1e-6
    ]
    if matches and matches[0] != series.column.unit and abs(abs(change) - 1.0) > 1e-9:
        parts.append(f'unit = "{matches[0]}"')
    elif not matches:
        parts.append(
            f"scale = {abs(change) * series.column.scale:.3g} "
            "(a steering wheel's angle? divide it by the steering ratio)"
        )
    if change < 0.0:
        parts.append(f"sign = {-series.column.sign}")
    return ", ".join(parts)
