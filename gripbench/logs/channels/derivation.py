"""What follows from the columns of a reference: velocity from pose, sideslip, acceleration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gripbench.envs.vehicles import GRAVITY
from gripbench.errors import InputError
from gripbench.logs.channels.series import Floats, Series, wrapped
from gripbench.logs.mapping.source_tables import Derived


def derive_reference(reference: dict[str, Series], derived: Derived) -> dict[str, Series]:
    """Return the reference with what follows from it; a column of its own is never replaced.

    Parameters
    ----------
    reference
        Series by signal name.
    derived
        What to derive.

    Raises
    ------
    InputError
        If what is asked for lacks its sources, or these have different times.
    """
    found = dict(reference)
    if derived.velocity_window > 0.0:
        _velocity(found, derived.velocity_window)
    if derived.reference_ahead != 0.0:
        if "speed_y" not in found and "sideslip" in found and "speed_x" in found:
            slip, ahead = _together(found, ("sideslip", "speed_x"), "derived.reference_ahead")
            values = ahead.values * np.tan(slip.values)
            found["speed_y"] = replace(slip, name="speed_y", key="derived speed_y", values=values)
        left, turning = _together(found, ("speed_y", "yaw_rate"), "derived.reference_ahead")
        moved = left.values - derived.reference_ahead * turning.values
        found["speed_y"] = replace(left, values=moved)
        if "sideslip" in found:
            slip, ahead, turn = _together(
                found, ("sideslip", "speed_x", "yaw_rate"), "derived.reference_ahead"
            )
            sideways = ahead.values * np.tan(slip.values) - derived.reference_ahead * turn.values
            moving = np.abs(ahead.values) >= derived.sideslip_above
            at = np.where(moving, np.arctan2(sideways, ahead.values), slip.values)
            found["sideslip"] = replace(slip, values=at)
    if derived.acceleration_window > 0.0:
        _acceleration(found, derived.acceleration_window)
    if "speed_x" in found and "speed_y" in found and "sideslip" not in found:
        forward, left = _together(found, ("speed_x", "speed_y"), "reference.sideslip")
        moving = np.hypot(forward.values, left.values) >= derived.sideslip_above
        if moving.any():
            _add(
                found,
                "sideslip",
                forward,
                forward.times[moving],
                np.arctan2(left.values, forward.values)[moving],
            )
    if "sideslip" not in found and "course" in found and "yaw" in found:
        course, yaw = _together(found, ("course", "yaw"), "reference.course")
        angle = wrapped(course.values - yaw.values)
        fast = np.ones(len(angle), dtype=bool)
        if "speed_x" in found and np.array_equal(found["speed_x"].times, course.times):
            fast = found["speed_x"].values >= derived.sideslip_above
        if fast.any():
            _add(found, "sideslip", course, course.times[fast], angle[fast])
    return found


def derive_channels(channels: dict[str, Series], derived: Derived) -> dict[str, Series]:
    """Return the channels with the velocity components that follow from GPS speed and course.

    Raises
    ------
    InputError
        If they are asked for and speed or course is missing, or these come at different times.
    """
    if not derived.gps_velocity:
        return channels
    found = dict(channels)
    key = "derived.gps_velocity"
    speed, course = _together(found, ("speed_gps", "course"), key, "channels have")
    _add(found, "velocity_north", course, course.times, speed.values * np.cos(course.values))
    _add(found, "velocity_west", course, course.times, speed.values * np.sin(course.values))
    return found


def slope(times: Floats, values: Floats, window: float) -> Floats:
    """Return the slope of the straight line through the samples within `window` of each time.

    Parameters
    ----------
    times, values
        The samples, shape (n,), times increasing.
    window
        Full width [s].
    """
    centred = times - times.mean()
    first = np.searchsorted(times, times - 0.5 * window - 1e-9)
    last = np.searchsorted(times, times + 0.5 * window + 1e-9, side="right")
    # At an end the window has one side only; mirror the side so that it stays symmetric.
    here = np.arange(len(times))
    half = np.minimum(here - first, last - 1 - here)
    half = np.maximum(half, 1)
    first = np.maximum(here - half, 0)
    last = np.minimum(here + half + 1, len(times))

    def within(quantity: Floats) -> Floats:
        total = np.concatenate([[0.0], np.cumsum(quantity)])
        return total[last] - total[first]

    count = (last - first).astype(np.float64)
    mean = within(centred) / count
    level = values - values.mean()
    covariance = within(centred * level) / count - mean * within(level) / count
    variance = within(centred**2) / count - mean**2
    return covariance / variance


def _velocity(found: dict[str, Series], window: float) -> None:
    north, west, yaw = _together(
        found, ("position_x", "position_y", "yaw"), "derived.velocity_window"
    )
    heading = np.unwrap(yaw.values)
    along = slope(north.times, north.values, window)
    across = slope(west.times, west.values, window)
    _add(found, "speed_x", north, north.times, np.cos(heading) * along + np.sin(heading) * across)
    _add(found, "speed_y", north, north.times, np.cos(heading) * across - np.sin(heading) * along)
    _add(found, "yaw_rate", north, north.times, slope(yaw.times, heading, window))
    _add(found, "velocity_north", north, north.times, along)
    _add(found, "velocity_west", north, north.times, across)
    _add(found, "speed_gps", north, north.times, np.hypot(along, across))
    _add(found, "course", north, north.times, np.arctan2(across, along))


def _acceleration(found: dict[str, Series], window: float) -> None:
    forward, left, turning = _together(
        found, ("speed_x", "speed_y", "yaw_rate"), "derived.acceleration_window"
    )
    ahead = slope(forward.times, forward.values, window) - turning.values * left.values
    aside = slope(left.times, left.values, window) + turning.values * forward.values
    _add(found, "accel_x", forward, forward.times, ahead)
    _add(found, "accel_y", forward, forward.times, aside)
    _add(found, "mu_used", forward, forward.times, np.hypot(ahead, aside) / GRAVITY)


def _together(
    found: dict[str, Series], names: tuple[str, ...], key: str, who: str = "reference has"
) -> list[Series]:
    for name in names:
        if name not in found:
            raise InputError(f"channel map: key '{key}': the {who} no '{name}'")
    series = [found[name] for name in names]
    for other in series[1:]:
        if not np.array_equal(other.times, series[0].times):
            raise InputError(
                f"channel map: key '{key}': '{names[0]}' and '{other.name}' have different times"
            )
    if len(series[0].times) < 3:
        raise InputError(f"channel map: key '{key}': fewer than three samples")
    return series


def _add(
    found: dict[str, Series], name: str, source: Series, times: Floats, values: Floats
) -> None:
    if name not in found:
        found[name] = replace(
            source, name=name, key=f"{source.key} (derived {name})", times=times, values=values
        )
