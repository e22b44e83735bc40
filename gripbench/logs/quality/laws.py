"""The laws that bind the channels of a vehicle's log: series in, the factor of each law out.

A law holds where its factor, left side over right side, is near 1. Every channel and reference
stands in one that needs no other suspect.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gripbench.envs.vehicles import GRAVITY
from gripbench.logs.channels.series import Series
from gripbench.logs.quality.law_forms import (
    ANY,
    CORRELATED,
    LOOSE,
    STEPS,
    TOLERANCE,
    Law,
    equal_level,
    equal_magnitude,
    moving_together,
)
from gripbench.logs.quality.speeds import best_integral, lateral_velocity, speed_of

_ROUGH = math.log(5.0)  # where a parameter of an unknown car comes in
_EARTH_FIELD = 48e-6  # T, between 22 and 67 over the globe
_WHEELBASE, _RADIUS = 2.7, 0.31  # m, of a passenger car
_ROLL_GRADIENT, _PITCH_GRADIENT = 0.008, 0.004  # rad s^2/m
_CAR_SPEED = 12.0  # m/s; what drives so fast is of a passenger car's size
_SLIDING = 0.1  # rad; at larger sideslip the course turns otherwise than the vehicle
WHEELS = (
    "wheel_speed_front", "wheel_speed_rear", "wheel_speed_front_left", "wheel_speed_front_right",
    "wheel_speed_rear_left", "wheel_speed_rear_right",
)  # fmt: skip
_FIELD = ("magnetic_field_x", "magnetic_field_y", "magnetic_field_z")


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
            yield from moving_together(
                f"{name} = {reference[name].key}",
                [(channels[name], 1), (reference[name], -1)],
                lambda _, a, b: (a, b),
                TOLERANCE,
            )
    slip, left, ahead = (reference.get(name) for name in ("sideslip", "speed_y", "speed_x"))
    if slip and left and ahead and "derived" not in slip.key:
        yield from moving_together(
            "sideslip = atan2(speed_y, speed_x)",
            [(slip, 1), (left, -1), (ahead, 1)],
            lambda _, b, y, x: (b[x > 1.0], np.arctan2(y, x)[x > 1.0]),
            TOLERANCE,
        )
    yield from _attitude_laws(channels, reference)
    yield from _field_laws(channels)


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
            turn_law += moving_together(
                "accel_y = speed * yaw_rate",
                [(source["accel_y"], 1), (speed, -1), (yaw_rate, -1)],
                lambda _, a, v, r: (a, v * r),
                LOOSE,
            )
        if "accel_x" in source:
            yield from moving_together(
                "accel_x = rate of change of speed",
                [(source["accel_x"], 1), (speed, -1)],
                lambda step, a, v: (a, np.gradient(v, step)),
                LOOSE,
            )
    yield from turn_law
    if all(law.holds({}) for law in turn_law):  # the integral asks for right accel_y and yaw_rate
        for series, *parts in lateral_velocity(channels, reference, vehicle, STEPS[0]):
            found, ratio = best_integral(*parts)
            if abs(found) > CORRELATED:
                factor = math.copysign(ratio, found)
                name = "speed * sideslip" if series.name == "sideslip" else "speed_y"
                text = f"{name} = integral of accel_y - speed * yaw_rate"
                yield Law(text, {series.key: 1}, factor, LOOSE)
    wheelbase = vehicle.get("cg_to_front", 0.0) + vehicle.get("cg_to_rear", 0.0)
    if steer is not None and yaw_rate is not None and (wheelbase or fast):
        length = wheelbase or _WHEELBASE
        yield from moving_together(
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
            yield from equal_level(text, channels[name], speed, radius or _RADIUS, wide)
    for source in (channels, reference):
        for name in ("speed_x", "speed_gps"):
            if name in source and source[name].key != speed.key:
                yield from equal_level(f"{name} = {speed.key}", source[name], speed)
        north, west = source.get("velocity_north"), source.get("velocity_west")
        if north is not None and west is not None and "derived" not in north.key:
            yield from equal_magnitude(
                "velocity_north and velocity_west", north, west, speed, False
            )
        north, west = source.get("position_x"), source.get("position_y")
        if north is not None and west is not None:
            yield from equal_magnitude("change of position", north, west, speed, True)
    torques = [s for name, s in channels.items() if name.startswith("torque_")]
    for torque in torques:
        if torque.name in ("torque_front", "torque_rear"):
            yield from moving_together(
                f"{torque.name} moves with the rate of change of speed",
                [(torque, 1), (speed, -1)],
                lambda step, t, v: (t, np.gradient(v, step)),
                ANY,
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
                yield from moving_together(
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
                yield from moving_together(
                    f"yaw_rate = rate of change of the {what}",
                    [(yaw_rate, 1), (y, -1)],
                    lambda step, r, u, w, sense=sense: (
                        r, sense * np.gradient(np.unwrap(np.arctan2(w, u)), step)
                    ),
                    ANY,
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
            yield from moving_together(
                f"{rate} = rate of change of {angle}",
                [(channels[rate], 1), (turned, -1)],
                lambda step, w, a: (w, np.gradient(a, step)),
                LOOSE,
            )
        elif rate in channels and source is not None:
            yield from moving_together(
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
