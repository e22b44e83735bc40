"""Biases of gyroscope and accelerometer from a log, with their uncertainty.

At standstill a gyroscope should read zero, and so should a level accelerometer along and across
the vehicle. Where a log never stands still, the readings are compared with what the reference or
the GPS say of the motion: the turn of the heading, the change of speed, and the centripetal
acceleration. Either way the mean over blocks of time gives the bias, and the scatter of the blocks
its standard deviation. An accelerometer's bias includes the slope of the road, which it cannot tell
from a bias.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gripbench.envs.recordings import Recording
from gripbench.errors import InputError
from gripbench.logs.channels.initial import STANDSTILL_SPEED

Floats = npt.NDArray[np.float64]
_Difference = Callable[[Recording, slice], float | None]

BLOCKS = {"standstill": 0.5, "motion": 2.0}
"""Length [s] of the blocks, by what the bias is found from."""

FEWEST = 3
"""Blocks below which nothing is said."""

_ZERO_AT_REST = ("yaw_rate", "roll_rate", "pitch_rate", "accel_x", "accel_y")


@dataclass(frozen=True)
class Bias:
    """The bias of one channel.

    Attributes
    ----------
    channel
        Name of the channel.
    value, deviation
        Bias and its standard deviation, in the channel's SI unit.
    found_from
        `standstill` or `motion`.
    blocks
        Blocks of time behind it.
    test_rms
        RMS of what is left over blocks of the test windows; None where these have none.
    """

    channel: str
    value: float
    deviation: float
    found_from: str
    blocks: int
    test_rms: float | None


def identify_biases(recordings: Sequence[Recording]) -> list[Bias]:
    """Find the biases that a log can tell; the test windows are judged, never fitted.

    Standstill counts wherever it is outside the test windows, motion in the training windows only.

    Parameters
    ----------
    recordings
        The runs of a log.

    Raises
    ------
    InputError
        If the log has neither a standstill nor a training window with a reference.
    """
    found = []
    for channel in _ZERO_AT_REST:
        bias = _bias(recordings, channel, "standstill", _mean_of(channel))
        if bias is None and channel in _IN_MOTION:
            bias = _bias(recordings, channel, "motion", _IN_MOTION[channel])
        if bias is not None:
            found.append(bias)
    if not found:
        raise InputError(
            f"{recordings[0].scenario}: no bias can be told: there is no standstill of "
            f"{FEWEST * BLOCKS['standstill']:g} s, and nothing to compare a gyroscope or "
            f"accelerometer with on {FEWEST * BLOCKS['motion']:g} s of the windows 'train'"
        )
    return found


def _bias(
    recordings: Sequence[Recording], channel: str, kind: str, difference: _Difference
) -> Bias | None:
    parts: dict[str, list[float]] = {"train": [], "test": []}
    for recording in recordings:
        if channel not in (recording.observations.dtype.names or ()):
            continue
        tested = _inside(recording, "test")
        if kind == "standstill":
            still = _at_rest(recording)
            chosen = {"train": still & ~tested, "test": still & tested}
        else:
            chosen = {"train": _inside(recording, "train"), "test": tested}
        for name, inside in chosen.items():
            for block in _blocks(recording.observations["time"], inside, BLOCKS[kind]):
                value = difference(recording, block)
                if value is not None and np.isfinite(value):
                    parts[name].append(value)
    train, test = np.array(parts["train"]), np.array(parts["test"])
    if len(train) < FEWEST:
        return None
    value = float(train.mean())
    return Bias(
        channel,
        value,
        float(train.std(ddof=1) / np.sqrt(len(train))),
        kind,
        len(train),
        float(np.sqrt(np.mean((test - value) ** 2))) if len(test) else None,
    )


def _blocks(time: Floats, inside: npt.NDArray[np.bool_], length: float) -> list[slice]:
    """Return the blocks of a length that lie inside whole, row by row."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(np.int8), [0]])))
    found = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        start = first
        while start < last - 1:
            end = int(np.searchsorted(time[:last], time[start] + length))
            if end >= last or end - start < 2:
                break
            found.append(slice(int(start), end + 1))
            start = end
    return found


def _mean_of(channel: str) -> _Difference:
    return lambda recording, block: float(recording.observations[channel][block].mean())


def _turning(recording: Recording, block: slice) -> float | None:
    """Return the mean yaw rate less that of the reference's heading, or of the GPS course."""
    for name in ("yaw", "course"):
        if name in (recording.truth.dtype.names or ()):
            heading = recording.truth[name][block]
            break
    else:
        if "course" not in (recording.observations.dtype.names or ()):
            return None
        heading = recording.observations["course"][block]
    turned = np.unwrap(heading)[[0, -1]]
    return _mean(recording, "yaw_rate", block) - float(turned[1] - turned[0]) / _span(
        recording, block
    )


def _along(recording: Recording, block: slice) -> float | None:
    """Return the mean of a_x less the change of speed, and less -r v_y where v_y is known."""
    speed = _speed(recording, block)
    if speed is None:
        return None
    expected = float(speed[-1] - speed[0]) / _span(recording, block)
    if {"speed_y", "yaw_rate"} <= set(recording.truth.dtype.names or ()):
        truth = recording.truth[block]
        expected -= float(np.mean(truth["speed_y"] * truth["yaw_rate"]))
    return _mean(recording, "accel_x", block) - expected


def _across(recording: Recording, block: slice) -> float | None:
    """Return the mean of a_y less r v_x, and less the change of v_y where it is known."""
    speed = _speed(recording, block)
    names = set(recording.truth.dtype.names or ())
    if speed is None:
        return None
    if "yaw_rate" in names:
        rate = recording.truth["yaw_rate"][block]
    elif "yaw_rate" in (recording.observations.dtype.names or ()):
        rate = recording.observations["yaw_rate"][block]
    else:
        return None
    expected = float(np.mean(rate * speed))
    if "speed_y" in names:
        left = recording.truth["speed_y"][block]
        expected += float(left[-1] - left[0]) / _span(recording, block)
    return _mean(recording, "accel_y", block) - expected


_IN_MOTION: dict[str, _Difference] = {
    "yaw_rate": _turning,
    "accel_x": _along,
    "accel_y": _across,
}


def _speed(recording: Recording, block: slice) -> Floats | None:
    for records, name in (
        (recording.truth, "speed_x"),
        (recording.observations, "speed_gps"),
    ):
        if name in (records.dtype.names or ()):
            return np.ascontiguousarray(records[name][block])
    return None


def _mean(recording: Recording, channel: str, block: slice) -> float:
    return float(recording.observations[channel][block].mean())


def _span(recording: Recording, block: slice) -> float:
    time = recording.observations["time"][block]
    return float(time[-1] - time[0])


def _at_rest(recording: Recording) -> npt.NDArray[np.bool_]:
    """Return where every speed that the log knows is zero; nowhere if it knows none."""
    seen, truth = recording.observations, recording.truth
    known = [
        np.abs(records[name])
        for records, names in (
            (truth, ("speed_x", "speed_y")),
            (seen, ("speed_x", "speed_gps", "wheel_speed_rear", "wheel_speed_rear_left")),
        )
        for name in names
        if name in (records.dtype.names or ())
    ]
    if not known:
        return np.zeros(len(seen), dtype=bool)
    return np.asarray(np.all(np.array(known) < STANDSTILL_SPEED, axis=0))


def _inside(recording: Recording, window: str) -> npt.NDArray[np.bool_]:
    time = recording.observations["time"]
    inside = np.zeros(len(time), dtype=bool)
    for start, end in recording.windows.get(window, ()):
        inside |= (time >= start) & (time <= end)
    return inside
