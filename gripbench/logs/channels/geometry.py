"""Where a sensor sits and how it is turned: series as measured in, series of the vehicle out.

A channel map names sensors with their position before, left of and above the centre of gravity and
their mounting angles; what they measured is carried to the centre of gravity (`v - omega x p`,
`a - alpha x p - omega x (omega x p)`) and into the vehicle's axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gripbench.envs.vehicles import GRAVITY
from gripbench.errors import InputError
from gripbench.logs.channels.derivation import slope
from gripbench.logs.channels.series import Floats, Series, wrapped
from gripbench.logs.mapping.source_tables import Level, Sensor

_VECTORS = (
    ("accel_x", "accel_y", "accel_z"),
    ("roll_rate", "pitch_rate", "yaw_rate"),
    ("magnetic_field_x", "magnetic_field_y", "magnetic_field_z"),
    ("speed_x", "speed_y", ""),
)
_RATES = ("roll_rate", "pitch_rate", "yaw_rate")
_DERIVATIVE = 0.1  # s, the window of a slope that gives an angular acceleration
_MOVING = 0.5  # m/s; below, a direction of motion means nothing

SAE_TURNED = frozenset(
    (
        "accel_y", "accel_z", "pitch_rate", "yaw_rate", "speed_y", "sideslip", "steer_angle",
        "course", "yaw", "pitch", "velocity_west", "velocity_up", "position_y",
        "magnetic_field_y", "magnetic_field_z", "road_grade",
        *(f"force_{axis}{wheel}" for axis in ("y_", "z_") for wheel in
          ("front", "rear", "front_left", "front_right", "rear_left", "rear_right")),
        *(f"slip_angle_{wheel}" for wheel in
          ("front_left", "front_right", "rear_left", "rear_right")),
    )
)  # fmt: skip
"""Signals whose sign axes forward, right, down (SAE J670) turn: all but those along x."""


def placed(
    channels: dict[str, Series], reference: dict[str, Series], sensors: dict[str, Sensor]
) -> tuple[dict[str, Series], dict[str, Series]]:
    """Return channels and reference as at the centre of gravity, in the vehicle's axes.

    Raises
    ------
    InputError
        If a sensor's rotation or lever arm needs a component or a channel that is not mapped.
    """
    channels, reference = dict(channels), dict(reference)
    for name, sensor in sensors.items():
        key = f"sensors.{name}"
        for source in (channels, reference):
            own = {one for one, series in source.items() if series.column.sensor == name}
            _turn(source, own, sensor, key)
    turning = _turning(channels, reference)
    # All arms with the angular velocity of the whole vehicle, which no arm changes.
    carried = [dict(channels), dict(reference)]
    for name, sensor in sensors.items():
        for old, new in zip((channels, reference), carried, strict=True):
            own = {one for one, series in old.items() if series.column.sensor == name}
            if own and any(sensor.position):
                _carry(old, new, own, sensor, turning, (channels, reference), f"sensors.{name}")
    return carried[0], carried[1]


def levelled(
    channels: dict[str, Series], reference: dict[str, Series], level: Level
) -> dict[str, Series]:
    """Return the channels with gravity's component taken off accelerometers that roll and pitch.

    Raises
    ------
    InputError
        If a named angle or the accelerometer is not mapped.
    """
    found = dict(channels)
    for accel, angle, sign, key in (
        ("accel_y", level.roll, 1.0, "roll"),
        ("accel_x", level.pitch, -1.0, "pitch"),
    ):
        if not angle:
            continue
        turned = reference.get(angle, channels.get(angle))
        for name, series in ((accel, found.get(accel)), (angle, turned)):
            if series is None:
                raise InputError(f"channel map: key 'level.{key}': '{name}' is not mapped")
        one = found[accel]
        assert turned is not None
        lean = np.interp(one.times, turned.times, turned.values)
        found[accel] = replace(one, values=one.values - sign * GRAVITY * np.sin(lean))
    return found


def rotation(angles: Sequence[float]) -> Floats:
    """Return the matrix from a sensor's axes to the vehicle's, for roll, pitch and yaw [deg].

    The sensor is turned about the vehicle's z by yaw, then about its new y, then its new x.
    """
    roll, pitch, yaw = np.deg2rad(np.asarray(angles, dtype=np.float64))
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    return np.asarray(about_z @ about_y @ about_x)


def _turn(source: dict[str, Series], own: set[str], sensor: Sensor, key: str) -> None:
    """Turn the vectors of one sensor into the vehicle's axes."""
    if not any(sensor.rotation):
        return
    matrix = rotation(sensor.rotation)
    for names in _VECTORS:
        if not own & set(names):
            continue
        present = [source.get(name) if name in own else None for name in names]
        times = next(one.times for one in present if one is not None)
        turned = {}
        for row, name in enumerate(names):
            if name not in own:
                continue
            value = np.zeros(len(times))
            for column, part in enumerate(names):
                weight = matrix[row, column]
                if abs(weight) < 1e-9:
                    continue
                one = present[column]
                if one is None:
                    if part:
                        raise InputError(
                            f"channel map: key '{key}.rotation': needs '{part}' of the same sensor"
                        )
                    continue
                value += weight * np.interp(times, one.times, one.values)
            base = source[name]
            turned[name] = replace(base, times=times, values=value)
        source |= turned
    if "sideslip" in own:
        one = source["sideslip"]
        source["sideslip"] = replace(one, values=one.values + np.deg2rad(sensor.rotation[2]))


def _turning(channels: dict[str, Series], reference: dict[str, Series]) -> list[Series | None]:
    return [channels.get(name, reference.get(name)) for name in _RATES]


def _carry(
    old: dict[str, Series],
    new: dict[str, Series],
    own: set[str],
    sensor: Sensor,
    turning: list[Series | None],
    both: tuple[dict[str, Series], dict[str, Series]],
    key: str,
) -> None:
    """Carry what one sensor measured from its place to the centre of gravity."""
    place = np.asarray(sensor.position, dtype=np.float64)
    if turning[2] is None:
        raise InputError(f"channel map: key '{key}.position': needs a 'yaw_rate'")

    def omega(times: Floats) -> Floats:
        return np.stack(
            [np.interp(times, s.times, s.values) if s else np.zeros(len(times)) for s in turning]
        )

    for axis, name in enumerate(("accel_x", "accel_y", "accel_z")):
        if name in own:
            times = old[name].times
            rate = omega(times)
            spin = np.stack([slope(times, one, _DERIVATIVE) for one in rate])
            arm = np.broadcast_to(place[:, None], rate.shape)
            extra = np.cross(spin, arm, axis=0) + np.cross(
                rate, np.cross(rate, arm, axis=0), axis=0
            )
            new[name] = replace(old[name], values=old[name].values - extra[axis])

    def swing(times: Floats) -> Floats:
        rate = omega(times)
        return np.cross(rate, np.broadcast_to(place[:, None], rate.shape), axis=0)

    for axis, name in enumerate(("speed_x", "speed_y")):
        if name in own:
            one = old[name]
            new[name] = replace(one, values=one.values - swing(one.times)[axis])
    if "sideslip" in own:
        one = old["sideslip"]
        ahead = _speed(both, one.times, key, "sideslip")
        sideways = ahead * np.tan(one.values) - swing(one.times)[1]
        moving = np.abs(ahead) > _MOVING
        at = np.arctan2(sideways, ahead - swing(one.times)[0])
        new["sideslip"] = replace(one, values=np.where(moving, at, one.values))
    if "speed_gps" in own:
        one = old["speed_gps"]
        new["speed_gps"] = replace(one, values=one.values - swing(one.times)[0])
    if "course" in own:
        one = old["course"]
        ahead = np.maximum(np.abs(_speed(both, one.times, key, "course")), _MOVING)
        turned = np.arctan2(swing(one.times)[1], ahead)
        new["course"] = replace(one, values=wrapped(one.values - turned))
    for pair, is_position in (
        (("velocity_north", "velocity_west"), False),
        (("position_x", "position_y"), True),
    ):
        if not set(pair) & own:
            continue
        heading = both[1].get("yaw", both[0].get("yaw"))
        if heading is None or not set(pair) <= own:
            raise InputError(f"channel map: key '{key}.position': '{pair[0]}' needs '{pair[1]}' "
                             "and a 'yaw'")  # fmt: skip
        for axis, name in enumerate(pair):
            one = old[name]
            yaw = np.interp(one.times, heading.times, np.unwrap(heading.values))
            arm = (
                np.broadcast_to(place[:, None], (3, len(yaw))) if is_position else swing(one.times)
            )
            turned = (
                np.cos(yaw) * arm[0] - np.sin(yaw) * arm[1],
                np.sin(yaw) * arm[0] + np.cos(yaw) * arm[1],
            )
            new[name] = replace(one, values=one.values - turned[axis])


def _speed(
    both: tuple[dict[str, Series], dict[str, Series]], times: Floats, key: str, name: str
) -> Floats:
    for source in (both[1], both[0]):
        for speed in ("speed_x", "speed_gps"):
            if speed in source:
                return np.interp(times, source[speed].times, source[speed].values)
    raise InputError(f"channel map: key '{key}.position': '{name}' needs a speed")
