"""Recordings that a method has to survive: what buses, sensors and drivers really do."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.envs.signals import (
    ACCELEROMETER,
    BANK_MAP,
    GRADE_ESTIMATE,
    MAGNETOMETER,
    NEW,
    signal,
)

Records = npt.NDArray[Any]

PAUSE = 1.0
"""Duration [s] of a standstill or of a start without torque."""


def missing_samples(observations: Records) -> Records:
    """Return the recording without every seventh sample and without a stretch in the middle."""
    length = len(observations)
    keep = np.arange(length) % 7 != 6
    keep[length // 2 : length // 2 + length // 10] = False
    return observations[keep].copy()


def held_samples(observations: Records) -> Records:
    """Return the recording with every sample held for twenty; only the time goes on."""
    held = observations[(np.arange(len(observations)) // 20) * 20].copy()
    held["time"] = observations["time"]
    for name in observations.dtype.names or ():
        if name.endswith(NEW):
            held[name][np.arange(len(held)) % 20 != 0] = 0.0
    return held


def standstill(observations: Records) -> Records:
    """Return the recording after a time during which the vehicle stands."""
    pause = _pause(observations)
    for name in observations.dtype.names or ():
        if not _stays_at_rest(name):
            pause[name] = 0.0
    return _append(pause, observations)


def zero_torque_start(observations: Records) -> Records:
    """Return the recording after a time during which the vehicle rolls without any torque."""
    pause = _pause(observations)
    for name in observations.dtype.names or ():
        if name.startswith("torque") or signal(name).instrument == ACCELEROMETER:
            pause[name] = 0.0 if name != "accel_z" else pause[name]
    return _append(pause, observations)


def _stays_at_rest(name: str) -> bool:
    kept = (MAGNETOMETER, GRADE_ESTIMATE, BANK_MAP)
    return (
        name in ("time", "accel_z", "gps_time")
        or name.endswith(NEW)
        or signal(name).instrument in kept
    )


def _pause(observations: Records) -> Records:
    """Return the first sample, repeated in time."""
    times = observations["time"]
    step = float(times[1] - times[0])
    pause = np.repeat(observations[:1], max(round(PAUSE / step), 1))
    pause["time"] = times[0] + step * np.arange(len(pause))
    return pause


def _append(pause: Records, observations: Records) -> Records:
    times = observations["time"]
    later = observations.copy()
    duration = len(pause) * float(times[1] - times[0])
    later["time"] += duration
    if "gps_time" in (observations.dtype.names or ()):
        later["gps_time"] += duration
        pause["gps_time"] = pause["time"]
    return np.concatenate([pause, later])
