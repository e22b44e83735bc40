"""The laws that bind the channels of a vehicle's log: series in, the factor of each law out.

A law holds where its factor, left side over right side, is near 1. Every channel and reference
stands in one that needs no other suspect.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from gripbench.envs.vehicles import GRAVITY
from gripbench.logs.grids import FEWEST, correlation, on_grid, without_trend
from gripbench.logs.series import Floats, Series

TOLERANCE = math.log(1.6)
LOOSE = math.log(2.5)
"""Where understeer, load transfer or a ramp of the road comes in."""

_ROUGH = math.log(5.0)  # where a parameter of an unknown car comes in
_ANY = math.inf  # where only the sign is told
_STEPS = (0.1, 0.3, 1.0, 3.0)  # s; the coarser ones average noise away
_CORRELATED = 0.75
_EARTH_FIELD = 48e-6  # T, between 22 and 67 over the globe
_WHEELBASE, _RADIUS = 2.7, 0.31  # m, of a passenger car
_ROLL_GRADIENT, _PITCH_GRADIENT = 0.008, 0.004  # rad s^2/m
_CAR_SPEED = 12.0  # m/s; what drives so fast is of a passenger car's size
_MOVING = 2.0  # m/s
_SLIDING = 0.1  # rad; at larger sideslip the course turns otherwise than the vehicle
_SMOOTH = 4.0  # s; slower parts of an integral are drift
_BODY_ROLL = np.linspace(0.9, 1.1, 21)  # what body roll does to a lateral accelerometer's scale
WHEELS = (
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


def laws_of(
    channels: dict[str, Series], reference: dict[str, Series], vehicle: dict[str, float]
) -> Iterator[Law]:
    """Yield every law that the log excites enough."""
    speed = speed_of(channels, reference, vehicle)
    if speed is not None:
        yield from _speed_laws(channels, reference, vehicle, speed)
    yield from _turning_laws(channels, reference)
    for name in ("yaw_rate", "accel_x", "accel_y", "sideslip", "roll_rate", "pitch_rate"):
        if name in channels and name in reference and channels[name].key != reference[name].key:
            yield from _moving(
                f"{name} = {reference[name].key}",
                [(channels[name], 1), (reference[name], -1)],
                lambda _, a, b: (a, b),
                TOLERANCE,
            )
    slip, left, ahead = (reference.get(name) for name in ("sideslip", "speed_y", "speed_x"))
    if slip and left and ahead and "derived" not in slip.key:
        yield from _moving(
            "sideslip = atan2(speed_y, speed_x)",
            [(slip, 1), (left, -1), (ahead, 1)],
            lambda _, b, y, x: (b[x > 1.0], np.arctan2(y, x)[x > 1.0]),
            TOLERANCE,
        )
    yield from _attitude_laws(channels, reference)
    yield from _field_laws(channels)


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
            if np.median(np.abs(v)) < _MOVING:
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


def _speed_laws(
    channels: dict[str, Series],
    reference: dict[str, Series],
    vehicle: dict[str, float],
    speed: Series,
) -> Iterator[Law]:
    yaw_rate, steer = channels.get("yaw_rate"), channels.get("steer_angle")
    fast = float(np.percentile(np.abs(speed.values), 90.0)) > _CAR_SPEED
    turn_law: list[Law] = []
    for source in (channels, reference):
        if "accel_y" in source and yaw_rate is not None:
            turn_law += _moving(
                "accel_y = speed * yaw_rate",
                [(source["accel_y"], 1), (speed, -1), (yaw_rate, -1)],
                lambda _, a, v, r: (a, v * r),
                LOOSE,
            )
        if "accel_x" in source:
            yield from _moving(
                "accel_x = rate of change of speed",
                [(source["accel_x"], 1), (speed, -1)],
                lambda step, a, v: (a, np.gradient(v, step)),
                LOOSE,
            )
    yield from turn_law
    if all(law.holds({}) for law in turn_law):  # the integral asks for right accel_y and yaw_rate
        for series, *parts in lateral_velocity(channels, reference, vehicle, _STEPS[0]):
            found, ratio = best_integral(*parts)
            if abs(found) > _CORRELATED:
                factor = math.copysign(ratio, found)
                name = "speed * sideslip" if series.name == "sideslip" else "speed_y"
                text = f"{name} = integral of accel_y - speed * yaw_rate"
                yield Law(text, {series.key: 1}, factor, LOOSE)
    wheelbase = vehicle.get("cg_to_front", 0.0) + vehicle.get("cg_to_rear", 0.0)
    if steer is not None and yaw_rate is not None and (wheelbase or fast):
        length = wheelbase or _WHEELBASE
        yield from _moving(
            "yaw_rate = speed * steer_angle / wheelbase",
            [(yaw_rate, 1), (speed, -1), (steer, -1)],
            lambda _, r, v, d: (r, v * d / length),
            LOOSE if wheelbase else _ROUGH,
        )
    radius = vehicle.get("wheel_radius", 0.0)
    for name in WHEELS:
        if name in channels and channels[name].key != speed.key and (radius or fast):
            text = f"{name} * wheel_radius = {speed.name}"
            wide = TOLERANCE if radius else LOOSE
            yield from _level(text, channels[name], speed, radius or _RADIUS, wide)
    for source in (channels, reference):
        for name in ("speed_x", "speed_gps"):
            if name in source and source[name].key != speed.key:
                yield from _level(f"{name} = {speed.key}", source[name], speed)
        north, west = source.get("velocity_north"), source.get("velocity_west")
        if north is not None and west is not None and "derived" not in north.key:
            yield from _vector_level("velocity_north and velocity_west", north, west, speed, False)
        north, west = source.get("position_x"), source.get("position_y")
        if north is not None and west is not None:
            yield from _vector_level("change of position", north, west, speed, True)
    torques = [s for name, s in channels.items() if name.startswith("torque_")]
    for torque in torques:
        if torque.name in ("torque_front", "torque_rear"):
            yield from _moving(
                f"{torque.name} moves with the rate of change of speed",
                [(torque, 1), (speed, -1)],
                lambda step, t, v: (t, np.gradient(v, step)),
                _ANY,
            )


def _turning_laws(channels: dict[str, Series], reference: dict[str, Series]) -> Iterator[Law]:
    yaw_rate = channels.get("yaw_rate", reference.get("yaw_rate"))
    if yaw_rate is None:
        return
    slip = reference.get("sideslip")
    sliding = slip is not None and float(np.percentile(np.abs(slip.values), 98.0)) > _SLIDING
    for name in ("yaw",) if sliding else ("yaw", "course"):
        for source in (channels, reference):
            if name in source and "derived" not in source[name].key:
                turning = replace(source[name], values=np.unwrap(source[name].values))
                yield from _moving(
                    f"yaw_rate = rate of change of {name}",
                    [(yaw_rate, 1), (turning, -1)],
                    lambda step, r, h: (r, np.gradient(h, step)),
                    TOLERANCE,
                )
    for source in (channels, reference):
        for pair, what in (
            (("velocity_north", "velocity_west"), "velocity's direction"),
            (("magnetic_field_x", "magnetic_field_y"), "field's direction"),
        ):
            if all(name in source and "derived" not in source[name].key for name in pair):
                x, y = (source[name] for name in pair)
                sense = 1.0 if what.startswith("velocity") else -1.0
                # Which of the two points the wrong way shows in the sense of rotation alone.
                yield from _moving(
                    f"yaw_rate = rate of change of the {what}",
                    [(yaw_rate, 1), (y, -1)],
                    lambda step, r, u, w, sense=sense: (
                        r, sense * np.gradient(np.unwrap(np.arctan2(w, u)), step)
                    ),
                    _ANY,
                    extra=[x, y],
                )  # fmt: skip


def _attitude_laws(channels: dict[str, Series], reference: dict[str, Series]) -> Iterator[Law]:
    """Yield what body roll and pitch under acceleration say of their sensors."""
    for rate, angle, accel, gradient in (
        ("roll_rate", "roll", "accel_y", _ROLL_GRADIENT),
        ("pitch_rate", "pitch", "accel_x", -_PITCH_GRADIENT),
    ):
        source = channels.get(accel, reference.get(accel))
        turned = reference.get(angle)
        if rate in channels and turned is not None:
            yield from _moving(
                f"{rate} = rate of change of {angle}",
                [(channels[rate], 1), (turned, -1)],
                lambda step, w, a: (w, np.gradient(a, step)),
                LOOSE,
            )
        elif rate in channels and source is not None:
            yield from _moving(
                f"{rate} moves with the rate of change of {accel}",
                [(channels[rate], 1), (source, -1)],
                lambda step, w, a, k=gradient: (w, k * np.gradient(a, step)),
                _ROUGH,
            )


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


def _moving(
    text: str,
    terms: list[tuple[Series, int]],
    sides: Callable[..., tuple[Floats, Floats]],
    tolerance: float,
    extra: list[Series] | None = None,
) -> Iterator[Law]:
    """Yield the law whose sides vary together, if the log excites it enough."""
    series = [terms[0][0], *extra] if extra else [one for one, _ in terms]
    best, factor = _CORRELATED, 0.0
    for step in _STEPS:
        grid = on_grid(series, step)
        if grid is None:
            break
        left, right = sides(step, *grid)
        if len(left) < FEWEST:
            continue
        left, right = left - left.mean(), right - right.mean()
        found = correlation(left, right)
        if abs(found) > best:
            ratio = 1.0 if tolerance == _ANY else float(np.std(left) / np.std(right))
            best, factor = abs(found), math.copysign(ratio, found)
    if factor:
        yield Law(text, {one.key: power for one, power in terms}, factor, tolerance)


def _level(
    text: str, left: Series, right: Series, factor: float = 1.0, tolerance: float = TOLERANCE
) -> Iterator[Law]:
    """Yield the law whose sides are equal in level, as two speeds are."""
    grid = on_grid([left, right], _STEPS[0])
    if grid is None:
        return
    a, b = grid
    moving = np.abs(b) > 0.2 * np.max(np.abs(b), initial=0.0)
    if moving.sum() < FEWEST or not np.any(b[moving]):
        return
    ratio = float(np.median(a[moving] / b[moving])) * factor
    if ratio != 0.0:
        yield Law(text, {left.key: 1, right.key: -1}, ratio, tolerance)


def _vector_level(
    what: str, north: Series, west: Series, speed: Series, position: bool
) -> Iterator[Law]:
    """Yield that a velocity's magnitude, or a position's change, is the speed."""
    grid = on_grid([north, west, speed], _STEPS[1])
    if grid is None:
        return
    x, y, v = grid
    if position:
        x, y = np.gradient(x, _STEPS[1]), np.gradient(y, _STEPS[1])
    moving = np.abs(v) > max(_MOVING, 0.2 * float(np.max(np.abs(v))))
    if moving.sum() < FEWEST:
        return
    ratio = float(np.median(np.hypot(x, y)[moving] / np.abs(v)[moving]))
    if ratio > 0.0:
        # One unit serves both components, so the speed is the other suspect.
        yield Law(f"{what} = {speed.key}", {speed.key: -1}, ratio, TOLERANCE)
