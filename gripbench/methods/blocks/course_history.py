"""What the course has done lately, so that a late GPS sample meets the prediction of its own time.

A filter adds up the course change that it predicts at each step. A sample that was true at
`gps_time` is then compared with the present prediction less the change since that time. Samples
that are not newer than the last one (repeated or out of order), from the future, or older than
the history are told apart, so that a filter can leave them out.
"""

from __future__ import annotations

from math import pi

import numpy as np

from gripbench.compilation import compiled

_LENGTH = 256
_SPACING = 0.005  # [s] between entries at most: 1.28 s at least are kept

HISTORY = np.dtype(
    [
        ("times", np.float64, (_LENGTH,)),
        ("values", np.float64, (_LENGTH,)),
        ("count", np.float64),
        ("newest_sample", np.float64),
        ("any_sample", np.float64),
    ]
)
"""A ring of times and predicted courses; all zero is empty."""


@compiled
def wrapped(angle):
    """Return an angle within -pi to pi."""
    return angle - 2.0 * pi * np.floor((angle + pi) / (2.0 * pi))


@compiled
def remember(history, time, value):
    """Add the predicted course (unwrapped) at a time; times must not decrease."""
    count = int(history.count)
    if count > 1 and time - history.times[(count - 2) % _LENGTH] < _SPACING:
        count -= 1  # the last entry moves along until it is a full spacing away
    history.times[count % _LENGTH] = time
    history.values[count % _LENGTH] = value
    history.count = count + 1.0


@compiled
def is_usable(history, sample_time):
    """Return whether a sample is newer than all before and within the history; note its time."""
    count = int(history.count)
    if count == 0:
        return False
    first = max(0, count - _LENGTH)
    tolerance = 1e-9
    if history.any_sample > 0.0 and sample_time <= history.newest_sample + tolerance:
        return False
    if sample_time > history.times[(count - 1) % _LENGTH] + tolerance:
        return False
    if sample_time < history.times[first % _LENGTH] - tolerance:
        return False
    history.newest_sample = sample_time
    history.any_sample = 1.0
    return True


@compiled
def change_since(history, sample_time):
    """Return the predicted change of course since a time within the history."""
    newest = int(history.count) - 1
    first = max(0, newest + 1 - _LENGTH)
    latest = history.values[newest % _LENGTH]
    at = newest
    while at > first and history.times[at % _LENGTH] > sample_time:
        at -= 1
    t0, v0 = history.times[at % _LENGTH], history.values[at % _LENGTH]
    if at == newest or sample_time <= t0:
        return latest - v0
    t1, v1 = history.times[(at + 1) % _LENGTH], history.values[(at + 1) % _LENGTH]
    return latest - (v0 + (v1 - v0) * (sample_time - t0) / (t1 - t0))
