"""Windows and bounds of a map in, the same on the clock of a recording's rows out, checked.

A map counts on the log's own clock, as the quality report does, or from the first row where it says
so. A window that lies outside the log, or in which less is known than was asked for, is refused:
scored in silence on what is left, it would be a wrong figure.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gripbench.envs.recordings import Bounds, Recording
from gripbench.errors import InputError
from gripbench.logs.coverage import too_little
from gripbench.logs.mapping.channel_map import Bound, ChannelMap
from gripbench.logs.mapping.interval_tables import Intervals

_EDGE = 1.5
"""Mean distances between rows by which an interval may reach beyond the first or last row."""

Floats = npt.NDArray[np.float64]


def placed_windows(channel_map: ChannelMap, rows: Floats) -> dict[str, Intervals]:
    """Return the windows that lie in a run, on the clock of its rows, which starts at 0.

    Parameters
    ----------
    channel_map
        The map.
    rows
        Times of the run's rows [s] on the log's clock, shape (n,).

    Raises
    ------
    InputError
        If an interval lies partly in the run and partly outside.
    """
    windows = channel_map.windows
    origin = 0.0 if windows.from_start else float(rows[0])
    end = float(rows[-1] - rows[0])
    edge = _EDGE * end / (len(rows) - 1)
    found: dict[str, Intervals] = {}
    for name, intervals in windows.intervals.items():
        kept = []
        for index, (start, stop) in enumerate(intervals):
            low, high = start - origin, stop - origin
            if high <= 0.0 or low >= end:
                continue  # of another run, or of none: `check_windows` sees it
            if low < -edge or high > end + edge:
                raise _outside(
                    f"windows.{name}[{index}]", (start, stop), origin, end, windows.from_start
                )
            kept.append((max(low, 0.0), high))
        found[name] = tuple(kept)  # empty in another run: nothing of this one counts
    return found


def placed_bound(channel_map: ChannelMap, signal: str, bound: Bound, origin: float) -> Bounds:
    """Return a bound on the clock of a run's rows; `origin` is the first row [s]."""
    origin = 0.0 if channel_map.windows.from_start else origin
    start = -np.inf if bound.start is None else bound.start - origin
    end = np.inf if bound.end is None else bound.end - origin
    return Bounds(signal, bound.low, bound.high, start, end)


def windows_text(recordings: Sequence[Recording]) -> str:
    """Return the windows of a log on its own clock as one line."""
    parts = []
    for name in dict.fromkeys(name for one in recordings for name in one.windows):
        spans = [
            f"{start + origin:.3f} to {end + origin:.3f} s"
            for one in recordings
            for origin in [one.notes.get("time_origin", 0.0)]
            for start, end in one.windows.get(name, ())
        ]
        parts.append(f"{name} {', '.join(spans)}")
    return f"windows on the log's clock: {'; '.join(parts) or 'none, the whole log is scored'}"


def check_windows(channel_map: ChannelMap, recordings: Sequence[Recording]) -> None:
    """Refuse a window that no run holds, or in which too little of the reference is known.

    Raises
    ------
    InputError
        With the key of the window, what the log covers and what to do.
    """
    windows = channel_map.windows
    for name, intervals in windows.intervals.items():
        for index, (start, stop) in enumerate(intervals):
            key, held = f"windows.{name}[{index}]", False
            for recording in recordings:
                origin = 0.0 if windows.from_start else recording.notes["time_origin"]
                low, high = start - origin, stop - origin
                end = float(recording.observations["time"][-1])
                if high <= 0.0 or low >= end:
                    continue
                held = True
                error = too_little(recording, (low, high), windows.covered, key)
                if error is not None:
                    raise error
            if not held:
                first = recordings[0]
                origin = 0.0 if windows.from_start else first.notes["time_origin"]
                end = max(
                    float(one.observations["time"][-1])
                    + (0.0 if windows.from_start else one.notes["time_origin"])
                    for one in recordings
                )
                raise _outside(key, (start, stop), origin, end - origin, windows.from_start)
    for signal, bounds in channel_map.bounds.items():
        for index, bound in enumerate(bounds):
            placed = [
                placed_bound(channel_map, signal, bound, recording.notes["time_origin"])
                for recording in recordings
            ]
            if not any(
                one.start < recording.observations["time"][-1] and one.end > 0.0
                for one, recording in zip(placed, recordings, strict=True)
            ):
                origin = 0.0 if windows.from_start else recordings[0].notes["time_origin"]
                end = float(recordings[-1].observations["time"][-1])
                times = (bound.start or 0.0, bound.end or np.inf)
                raise _outside(f"bounds.{signal}[{index}]", times, origin, end, windows.from_start)


def _outside(
    key: str, interval: tuple[float, float], origin: float, length: float, from_start: bool
) -> InputError:
    start, stop = interval
    clock = "counted from the first row" if from_start else "on its own clock"
    hint = ""
    if not from_start and origin != 0.0 and start >= 0.0 and stop <= length + 1.0:
        hint = "; for times from the first row set windows.from_start = true"
    return InputError(
        f"channel map: key '{key}': {start:.3f} to {stop:.3f} s is outside the log, which covers "
        f"{origin:.3f} to {origin + length:.3f} s {clock}{hint}"
    )
