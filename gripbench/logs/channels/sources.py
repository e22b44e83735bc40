"""Signals that no single column holds: torques, positions from GPS, attitude, course.

The map's tables in; series as if columns had had them out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gripbench.errors import InputError
from gripbench.logs.channels.series import Floats, Series, wrapped
from gripbench.logs.mapping.channel_map import ChannelMap
from gripbench.logs.mapping.map_tables import Column
from gripbench.logs.mapping.source_tables import Brake, Drive
from gripbench.logs.readers.log import optional

Reader = Callable[[str, str, Column, str], Series]
"""Reads a column: signal's name, key, column, unit that it comes out in."""


def add_sources(
    channel_map: ChannelMap,
    read: Reader,
    channels: dict[str, Series],
    reference: dict[str, Series],
) -> None:
    """Add what the map's tables `brake`, `drive`, `geodetic` and `attitude` give.

    Raises
    ------
    InputError
        If a column is missing, a gear has no ratio, or a library is.
    """
    for axle in ("front", "rear"):
        name = f"torque_{axle}"
        parts = []
        if axle in channel_map.brake:
            parts.append(_brake(channel_map.brake[axle], f"brake.{axle}", name, read))
        if channel_map.drive is not None and channel_map.drive.axle == axle:
            parts.append(_drive(channel_map.drive, name, read))
        if parts:
            times = parts[0].times
            total = sum(np.interp(times, one.times, one.values) for one in parts)
            channels[name] = replace(parts[0], values=np.asarray(total))
    if channel_map.geodetic is not None:
        _positions(channel_map, read, channels, reference)
    if channel_map.attitude is not None:
        _attitude(channel_map, read, reference)
    if "course" not in channels and {"velocity_north", "velocity_west"} <= set(channels):
        if channel_map.derived.course_from_velocity:
            north, west = channels["velocity_north"], channels["velocity_west"]
            side = np.interp(north.times, west.times, west.values)
            channels["course"] = replace(
                north, name="course", key="channels.velocity_north (derived course)",
                values=np.arctan2(side, north.values),
            )  # fmt: skip
    elif channel_map.derived.course_from_velocity:
        raise InputError(
            "channel map: key 'derived.course_from_velocity': needs the channels 'velocity_north' "
            "and 'velocity_west' and none of 'course'"
        )


def _brake(brake: Brake, key: str, name: str, read: Reader) -> Series:
    pressure = read(name, f"{key}.pressure", brake.pressure, "bar")
    return replace(
        pressure, key=f"{key} (derived {name})", values=-brake.torque_per_bar * pressure.values
    )


def _drive(drive: Drive, name: str, read: Reader) -> Series:
    engine = read(name, "drive.engine", drive.engine, "N m")
    factor: float | Floats = 1.0
    if drive.gear is not None:
        gear = read(name, "drive.gear", drive.gear, "-")
        at = np.searchsorted(gear.times, engine.times, side="right") - 1
        held = gear.values[np.maximum(at, 0)]
        factor = np.zeros(len(held))
        for value in np.unique(held):
            ratio = drive.ratios.get(f"{value:g}")
            if ratio is None:
                raise InputError(
                    f"channel map: key 'drive.ratios': the log has gear {value:g}, the ratios are "
                    f"of {', '.join(drive.ratios) or 'none'} (0 for an open clutch)"
                )
            factor[held == value] = ratio
    total = engine.values * factor * drive.final_drive
    total = np.where(total >= 0.0, total * drive.efficiency, total / drive.efficiency)
    return replace(engine, key=f"drive (derived {name})", values=total)


def _positions(
    channel_map: ChannelMap,
    read: Reader,
    channels: dict[str, Series],
    reference: dict[str, Series],
) -> None:
    geodetic = channel_map.geodetic
    assert geodetic is not None
    pymap3d = optional("pymap3d", "a position in latitude and longitude")
    latitude = read("position_x", "geodetic.latitude", geodetic.latitude, "deg")
    longitude = read("position_y", "geodetic.longitude", geodetic.longitude, "deg")
    lon = np.interp(latitude.times, longitude.times, np.unwrap(longitude.values, period=360.0))
    height = np.zeros(len(lon))
    if geodetic.height is not None:
        above = read("position_x", "geodetic.height", geodetic.height, "m")
        height = np.interp(latitude.times, above.times, above.values)
    origin = geodetic.origin or (float(latitude.values[0]), float(lon[0]), float(height[0]))
    east, north, _ = pymap3d.geodetic2enu(latitude.values, lon, height, *origin)
    target = channels if geodetic.to == "channels" else reference
    for name, values in (("position_x", north), ("position_y", -east)):
        target[name] = replace(
            latitude, name=name, key=f"geodetic (derived {name})", values=np.asarray(values)
        )


def _attitude(channel_map: ChannelMap, read: Reader, reference: dict[str, Series]) -> None:
    attitude = channel_map.attitude
    assert attitude is not None
    parts = [
        read("yaw", key, column, "-")
        for key, column in channel_map.source_columns().items()
        if key.startswith("attitude.")
    ]
    times = parts[0].times
    x, y, z, w = (np.interp(times, one.times, one.values) for one in parts)
    size = np.sqrt(x * x + y * y + z * z + w * w)
    if not np.all(size > 0.5):
        raise InputError("channel map: key 'attitude.quaternion': a quaternion has no length")
    x, y, z, w = x / size, y / size, z / size, w / size
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    if attitude.counts_from == "east":
        yaw = wrapped(yaw - 0.5 * np.pi)
    for name, values in (("yaw", yaw), ("pitch", pitch), ("roll", roll)):
        if name not in reference:
            reference[name] = replace(
                parts[0], name=name, key=f"attitude (derived {name})", values=values
            )
