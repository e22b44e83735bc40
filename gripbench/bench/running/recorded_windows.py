"""A log in, the windows that its methods are scored on out: parts of its test time, the seeds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from gripbench.envs.recordings import Recording
from gripbench.errors import InputError
from gripbench.logs.coverage import known_share

if TYPE_CHECKING:
    from gripbench.logs.importing import ImportedLog

SHORTEST = 3.0
"""Length [s] of a window, longer where there would be more than `MOST`."""

MOST = 20
"""Windows that a recording has at most, about."""

_LEAST = 0.5  # of what is known of the test time on the average, is known of each window
_Interval = tuple[float, float]


@dataclass(frozen=True)
class Window:
    """One run of a recorded scenario: an interval [s] of one of the log's recordings.

    Attributes
    ----------
    recording
        Which of the log's recordings.
    start, end
        The interval on the clock of its rows, which starts at 0.
    last
        Whether its end belongs to it; where another window follows, the sample is that one's.
    """

    recording: int
    start: float
    end: float
    last: bool = True


@lru_cache(maxsize=8)
def windows_of(imported: ImportedLog) -> tuple[Window, ...]:
    """Return the windows of a log: its test time, cut where an interval begins or ends to be known.

    A window in which less than half as much of the reference is known as of the whole joins its
    neighbour; that enough of the whole is known the import has checked.

    Raises
    ------
    InputError
        If nothing is to be scored.
    """
    recordings = imported.recordings
    pieces = [
        (index, start, end)
        for index, recording in enumerate(recordings)
        for start, end in _pieces(recording)
    ]
    if not pieces:
        raise InputError(f"{recordings[0].scenario}: no sample lies in a window 'test'")
    length = max(SHORTEST, sum(end - start for _, start, end in pieces) / MOST)
    windows = [
        Window(index, low, high)
        for index, start, end in pieces
        for low, high in _parts(recordings[index], start, end, length)
    ]
    windows = [
        replace(one, last=(one.recording, one.end) != (after.recording, after.start))
        for one, after in pairwise([*windows, Window(-1, 0.0, 0.0)])
    ]
    return tuple(windows)


def _parts(recording: Recording, start: float, end: float, length: float) -> list[_Interval]:
    """Return an interval in parts of about a length, in each of which enough is known."""
    edges = np.linspace(start, end, max(1, round((end - start) / length)) + 1).tolist()
    whole = known_share(recording, (start, end))

    def enough(part: _Interval) -> bool:
        found = known_share(recording, part)
        return all(found[name][1] >= _LEAST * share for name, (_, share) in whole.items())

    kept = [start]
    for edge in edges[1:]:
        if enough((kept[-1], edge)):
            kept.append(edge)
    while kept[-1] != end and not enough((kept[-1], end)):
        kept.pop()  # what is left joins the part before it
    return list(pairwise([*(edge for edge in kept if edge != end), end]))


def _pieces(recording: Recording) -> list[_Interval]:
    time = recording.truth["time"]
    last = float(time[-1])
    given = recording.windows.get("test", ()) if recording.windows else ((0.0, last),)
    cuts = {cut for bound in recording.bounds for cut in (bound.start, bound.end)}
    found = []
    for start, end in sorted(given):
        first, final = max(start, recording.score_from), min(end, last)
        edges = [first, *sorted(cut for cut in cuts if first < cut < final), final]
        found += [
            (low, high) for low, high in pairwise(edges) if ((time >= low) & (time <= high)).any()
        ]
    return found
