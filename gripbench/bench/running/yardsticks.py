"""Trivial estimators: what a figure on a real recording has to be compared with."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from gripbench.compilation import compiled
from gripbench.envs.recordings import Recording
from gripbench.envs.vehicles import GRAVITY

Floats = npt.NDArray[np.float64]

_FORGETTING = 1.0  # s, of the kinematic integration; without it every bias grows for ever
_SMOOTHING = 0.3  # s, of the accelerometer


def zero(recording: Recording) -> Floats | None:
    """Return zero sideslip."""
    return np.zeros(len(recording.observations))


def kinematic_sideslip(recording: Recording) -> Floats | None:
    """Return the sideslip that follows from integrating a_y - r v_x, forgetting within a second."""
    speed = _speed(recording)
    if speed is None or not _has(recording, "accel_y", "yaw_rate"):
        return None
    seen = recording.observations
    rate = seen["accel_y"] - seen["yaw_rate"] * speed
    lateral = _leaky_integral(np.ascontiguousarray(seen["time"]), rate, _FORGETTING)
    return np.arctan2(lateral, np.maximum(speed, 0.1))


def course_as_heading(recording: Recording) -> Floats | None:
    """Return the last GPS course."""
    return recording.observations["course"].copy() if _has(recording, "course") else None


def gyro_heading(recording: Recording) -> Floats | None:
    """Return the first GPS course plus the integral of the yaw rate."""
    if not _has(recording, "course", "yaw_rate"):
        return None
    seen = recording.observations
    turned = np.cumsum(seen["yaw_rate"][:-1] * np.diff(seen["time"]))
    return seen["course"][0] + np.append(0.0, turned)


def specific_force(recording: Recording) -> Floats | None:
    """Return |a|/g of the accelerometer, smoothed over 0.3 s."""
    if not _has(recording, "accel_x", "accel_y"):
        return None
    seen = recording.observations
    time = np.ascontiguousarray(seen["time"])
    parts = [_smooth(time, np.ascontiguousarray(seen[n])) for n in ("accel_x", "accel_y")]
    return np.hypot(*parts) / GRAVITY


def largest_specific_force(recording: Recording) -> Floats | None:
    """Return the largest smoothed |a|/g so far: no road has given less than that."""
    used = specific_force(recording)
    return None if used is None else np.maximum.accumulate(used)


YARDSTICKS: dict[str, dict[str, Callable[[Recording], Floats | None]]] = {
    "sideslip": {"zero sideslip": zero, "kinematic integration": kinematic_sideslip},
    "yaw": {"course as heading": course_as_heading, "gyroscope from first course": gyro_heading},
    "mu_used": {"|a|/g": specific_force},
    "mu": {"largest |a|/g so far": largest_specific_force},
}
"""Trivial estimators by target and name; None where a recording lacks their channels."""


def _has(recording: Recording, *names: str) -> bool:
    return set(names) <= set(recording.observations.dtype.names or ())


def _speed(recording: Recording) -> Floats | None:
    seen = recording.observations
    radius = recording.vehicle.get("wheel_radius")
    for name in ("speed_gps", "speed_x", "wheel_speed_rear", "wheel_speed_rear_left"):
        if name in (seen.dtype.names or ()):
            if not name.startswith("wheel"):
                return np.ascontiguousarray(seen[name])
            if radius:
                return np.ascontiguousarray(seen[name]) * radius
    return None


def _smooth(time: Floats, values: Floats) -> Floats:
    return np.asarray(_leaky_integral(time, values, _SMOOTHING)) / _SMOOTHING


@compiled
def _leaky_integral(time, rate, forgetting):  # type: ignore[no-untyped-def]
    out = np.zeros(len(time))
    for k in range(1, len(time)):
        kept = np.exp(-(time[k] - time[k - 1]) / forgetting)
        out[k] = kept * out[k - 1] + (1.0 - kept) * forgetting * rate[k - 1]
    return out
