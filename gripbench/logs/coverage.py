"""An interval of a log in, what share of it has rows and a known reference out."""

from __future__ import annotations

import numpy as np

from gripbench.envs.recordings import Recording
from gripbench.envs.signals import NEW
from gripbench.errors import InputError

_LONGEST = 10.0
"""Mean distances between rows that a row stands for at most."""


def known_share(
    recording: Recording, interval: tuple[float, float]
) -> dict[str, tuple[int, float]]:
    """Return how many rows an interval has, and how many with each signal of the reference.

    Parameters
    ----------
    recording
        A run of a log.
    interval
        Times [s] on the clock of its rows.

    Returns
    -------
    By `row` and name of signal: their number, and the share of the interval's time that they stand
    for, 0 to 1; rows before `score_from` do not count.
    """
    low, high = interval
    truth, time = recording.truth, recording.truth["time"]
    longest = _LONGEST * float(time[-1]) / (len(time) - 1)
    first = int(np.searchsorted(time, max(low, recording.score_from), side="left"))
    last = max(first, int(np.searchsorted(time, high, side="right")))
    following = time[last] if last < len(time) else time[-1] + longest / _LONGEST
    worth = np.minimum(np.diff(time[first:last], append=following), longest)
    signals = [name for name in truth.dtype.names or () if name != "time" and NEW not in name]
    known = {"row": np.ones(last - first, dtype=bool)}
    known |= {name: np.isfinite(truth[name][first:last]) for name in signals}
    return {
        name: (int(each.sum()), min(float(worth[each].sum()) / (high - low), 1.0))
        for name, each in known.items()
    }


def too_little(
    recording: Recording, interval: tuple[float, float], least: float, key: str
) -> InputError | None:
    """Return what to say of an interval in which less is known than asked for; None: enough is.

    Parameters
    ----------
    recording, interval
        As `known_share` takes them.
    least
        Share of its time that was asked for.
    key
        Its key in the map.
    """
    low, high = interval
    origin = recording.notes.get("time_origin", 0.0)
    for name, (samples, share) in known_share(recording, interval).items():
        if share >= least and samples:
            continue
        what = name if name == "row" else f"reference '{name}'"
        later = recording.score_from > low and name == "row"
        cause = f"; score_from leaves out the first {recording.score_from:g} s" if later else ""
        return InputError(
            f"{recording.scenario}: key '{key}': {low + origin:.3f} to {high + origin:.3f} s of "
            f"the log's clock has {samples} samples with a {what}, {100.0 * share:.0f} % of its "
            f"time, fewer than asked for{cause}; choose another interval, or set windows.covered "
            f"below {least:g}"
        )
    return None
