"""Samples as sensors and clocks really give them in; samples that a step can take out.

A channel may be NaN in a sample, and a clock may stand still or step back. A step knows nothing
of it, because it is given

- the last finite value of a channel that is missing, with `<channel>_new` 0, and so every flag of
  the same instrument: part of a reading is no reading;
- no sample before every channel has been finite once; those of an instrument of which it declares
  a flag may come later, as 0 with flag 0;
- no sample whose time is not later than the last one's;
- a clock that goes on from where it was when the sensors' clock was set back by more than `LATE`;
  `gps_time`, which is of that clock, moves along.

Where a step is not called its estimates hold.
"""

from __future__ import annotations

from collections.abc import Container
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.compilation import compiled
from gripbench.envs.signals import NEW, signal
from gripbench.errors import UndeclaredChannelError, nearest

LATE = 1.0
"""Time [s] up to which a sample from the past is late; beyond it the clock has been set back."""

CLOCK_FIELDS = ("time", "elapsed", "first")
"""What a step is told of the clock: time [s], time since the sample that it took before, and 1 for
the first one."""

FLAG, OPTIONAL, CLOCK = 1, 2, 4


def is_given(channel: str, present: Container[str]) -> bool:
    """Return whether a method can be given a channel; a flag comes with its channel."""
    return channel in present or (channel.endswith(NEW) and channel.removesuffix(NEW) in present)


def select_channels(observations: npt.NDArray[Any], channels: tuple[str, ...]) -> npt.NDArray[Any]:
    """Return a copy of the observations that holds the given channels and `time` only.

    Parameters
    ----------
    observations
        Structured array, shape (n,).
    channels
        Names of the channels that a method declared. The `_new` flag of a sensor as fast as the
        samples need not be there: it is 1 wherever the channel is finite.

    Returns
    -------
    Structured array, shape (n,), with the fields `channels` in their order, then `time`.

    Raises
    ------
    UndeclaredChannelError
        If the observations lack a channel.
    """
    names = (*channels, "time")
    present = observations.dtype.names or ()
    for name in names:
        if not is_given(name, present):
            raise UndeclaredChannelError(
                f"the recording has no channel '{name}': {nearest(name, present)}"
            )
    selected = np.empty(observations.shape, [(name, np.float64) for name in names])
    for name in names:
        if name in present:
            selected[name] = observations[name]
        else:
            selected[name] = np.isfinite(observations[name.removesuffix(NEW)])
    return selected


def layout_of(names: tuple[str, ...]) -> npt.NDArray[np.int64]:
    """Return what `admit` has to know of the channels.

    Parameters
    ----------
    names
        The m channels that a method declares.

    Returns
    -------
    Array, shape (m + 1, m): what each channel is, then for each the flags that fall with it.
    """
    flags = {j: signal(name).instrument for j, name in enumerate(names) if name.endswith(NEW)}
    layout = np.zeros((len(names) + 1, len(names)), np.int64)
    for i, name in enumerate(names):
        own = [j for j, instrument in flags.items() if instrument == signal(name).instrument]
        if i in flags:
            layout[0, i] = FLAG
        else:
            layout[0, i] = (OPTIONAL if own else 0) | (CLOCK if signal(name).unit == "s" else 0)
            layout[i + 1, own] = 1
    return layout


def memory_of(names: tuple[str, ...]) -> npt.NDArray[np.float64]:
    """Return what `admit` keeps between the samples of these channels: nothing yet."""
    return np.append(np.full(len(names) + 1, np.nan), 0.0)


def regular(values: npt.NDArray[np.float64]) -> bool:
    """Return whether all samples, shape (n, m + 3), are whole and in order: `admit` takes all."""
    return bool(np.isfinite(values).all() and (values[1:, -2] > 0.0).all())


@compiled
def admit(row, memory, layout):
    """Complete a sample in place and return whether a step may take it.

    Parameters
    ----------
    row
        Values of the m channels, then `CLOCK_FIELDS`, of which the time is given.
    memory
        Last finite values of the channels, time of the last sample taken, what to add to the
        clock [s]; shape (m + 2,).
    layout
        As `layout_of` gives it.
    """
    clock = layout.shape[1]
    complete = True
    for i in range(clock):
        kind = layout[0, i]
        if kind & FLAG:
            if not np.isfinite(row[i]):
                row[i] = 0.0
            continue
        if kind & CLOCK:
            row[i] += memory[clock + 1]
        if np.isfinite(row[i]):
            memory[i] = row[i]
            continue
        for j in range(clock):
            if layout[i + 1, j] == 1:
                row[j] = 0.0
        row[i] = memory[i]
        if np.isnan(row[i]):
            row[i] = 0.0
            complete = complete and kind & OPTIONAL != 0
    time, before = row[clock] + memory[clock + 1], memory[clock]
    if not np.isfinite(time):
        return False
    if time <= before:
        if time < before - LATE:
            memory[clock + 1] += before - time
        return False
    row[clock] = time
    row[clock + 1] = time - before if np.isfinite(before) else 0.0
    row[clock + 2] = 0.0 if np.isfinite(before) else 1.0
    if complete:
        memory[clock] = time
    return complete
