"""The readings of a run and its faults in; what arrives instead out.

A fault acts in a window of the run, on readings as an instrument gives them: a channel of fewer
samples changes where it is new and is held in between. Several faults act one after the other.
Whatever is random is drawn for the seed before the run, in a stream of its own for each fault and
channel, so that a faulty run and its clean twin differ by the fault alone, and a run is the same
sample by sample as in one call.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.compilation import compiled
from gripbench.envs.hidden_draws import entropy
from gripbench.envs.instruments.faults import Chosen, Severity, check_present
from gripbench.envs.signals import NEW, signal
from gripbench.errors import InputError

LOSS, FREEZE, SPIKE, ADD, SCALE, CLIP, ROUND, LATE = range(8)

_CODES = {
    "loss": LOSS,
    "freeze": FREEZE,
    "spikes": SPIKE,
    "bias": ADD,
    "drift": ADD,
    "scale": SCALE,
    "saturation": CLIP,
    "quantisation": ROUND,
    "delay": LATE,
}

_EARLIEST, _LATEST, _SHARE = 0.3, 0.4, 0.3  # of the run: when a fault begins, how long it lasts

_OP = np.dtype(
    [
        ("code", np.int64),
        ("column", np.int64),
        ("flag", np.int64),  # column of the flag, -1: none
        ("size", np.float64),
        ("lag", np.int64),  # samples
        ("begin", np.int64),  # of its events
        ("end", np.int64),
    ]
)
_STATE = np.dtype([("cursor", np.int64), ("held", np.float64)])
_EVENT = np.dtype([(name, np.float64) for name in ("start", "end", "size", "slope")])
_CLOCK = np.dtype([("late", np.int64), ("filled", np.int64)])


@compiled
def _alter(op, state, events, time, value, inside):
    """Return a fresh reading as the fault leaves it, and whether it arrives."""
    if op.code == SPIKE:
        while state.cursor < op.end and events[state.cursor].start <= time:
            value += events[state.cursor].size
            state.cursor += 1
        return value, True
    if op.code == SCALE:
        return value * op.size if inside else value, True
    if op.code == CLIP:
        return min(max(value, -op.size), op.size) if inside else value, True
    if op.code == ROUND:
        return op.size * np.round(value / op.size) if inside else value, True
    while state.cursor < op.end and events[state.cursor].end <= time:
        state.cursor += 1
    if state.cursor >= op.end or events[state.cursor].start > time:
        return value, True
    event = events[state.cursor]
    if op.code == FREEZE:
        return state.held, True
    if op.code == ADD:
        return value + event.size + event.slope * (time - event.start), True
    return value, False


@compiled
def _act(k, row, window, ops, states, events, ring):
    time = row[0]
    inside = window[0] <= time < window[1]
    for j in range(ops.shape[0]):
        op = ops[j]
        state = states[j]
        value = row[op.column]
        fresh = row[op.flag] if op.flag >= 0 else 1.0
        if op.code == LATE:
            place = k % ring.shape[0]
            ring[place, j, 0] = value
            ring[place, j, 1] = fresh
            if inside and k >= op.lag:
                row[op.column] = ring[(k - op.lag) % ring.shape[0], j, 0]
                if op.flag >= 0:
                    row[op.flag] = ring[(k - op.lag) % ring.shape[0], j, 1]
            continue
        if fresh > 0.0 and np.isfinite(value):
            value, arrives = _alter(op, state, events, time, value, inside)
            if arrives:
                state.held = value
            elif op.flag >= 0:
                row[op.flag] = 0.0
                value = state.held
            else:
                value = np.nan
        elif op.flag >= 0:
            value = state.held  # between two readings
        row[op.column] = value


@compiled
def _apply(first, rows, window, ops, states, events, ring, jitter, swaps, clock, kept):
    for i in range(rows.shape[0]):
        row = rows[i]
        time = row[0]
        _act(first + i, row, window, ops, states, events, ring)
        inside = window[0] <= time < window[1]
        if inside and jitter.shape[0] > 0:
            row[0] = time + jitter[min(first + i, jitter.shape[0] - 1)]
        if swaps.shape[0] == 0:
            continue
        # A transport that is one sample late lets a sample overtake the one before.
        now = clock[0]
        kept[2] = row
        if inside and now.filled > 0:
            if now.late > 0:
                row[:] = kept[1]
                now.late = 0
            elif swaps[min(first + i, swaps.shape[0] - 1)] > 0.0:
                kept[1] = kept[0]
                now.late = 1
            else:
                row[:] = kept[0]
        kept[0] = kept[2]
        now.filled = 1


class Faults:
    """The faults of one run.

    Parameters
    ----------
    chosen
        Faults in the order in which they act.
    observation_type
        Structured type of the observations; its first field is `time`.
    sample_time
        Time [s] between samples.
    horizon
        Duration of the run [s].
    seed
        Seed of the run.

    Attributes
    ----------
    window
        When the faults begin and end [s].

    Raises
    ------
    InputError
        If a fault acts on nothing that the instruments give, or samples are not equally spaced.
    """

    def __init__(
        self,
        chosen: Sequence[Chosen],
        observation_type: np.dtype[Any],
        sample_time: float | None,
        horizon: float,
        seed: int,
    ) -> None:
        if sample_time is None:
            raise InputError("faults need equally spaced samples: the paper's solver has none")
        names = observation_type.names or ()
        begin = horizon * _draws(seed, "window").uniform(_EARLIEST, _LATEST)
        lengths = [one.strength.length for one in chosen if not one.strength.share]
        length = max(lengths) if lengths and all(lengths) else _SHARE * horizon
        self.window = np.array([begin, begin + length])
        self._samples = 0
        steps = round(horizon / sample_time) + 1
        self._jitter, self._swaps = np.zeros(0), np.zeros(0)
        ops: list[Any] = []
        events: list[tuple[float, float, float, float]] = []
        for one in chosen:
            check_present(one, names)
            strength = one.strength
            if one.fault.kind == "jitter":
                drawn = strength.jitter * _draws(seed, one.fault.name).standard_normal(steps)
                self._jitter = self._jitter + drawn if len(self._jitter) else drawn
            elif one.fault.kind == "disorder":
                drawn = _draws(seed, one.fault.name).random(steps)
                self._swaps = (drawn < strength.rate * sample_time).astype(float)
            else:
                for channel in one.channels(names):
                    op = np.zeros(1, _OP)[0]
                    op["code"] = _CODES[one.fault.kind]
                    op["column"] = names.index(channel)
                    op["flag"] = names.index(channel + NEW) if channel + NEW in names else -1
                    size = strength.size.get(signal(channel).unit, 0.0)
                    op["size"] = strength.factor if one.fault.kind == "scale" else size
                    op["lag"] = round(strength.delay / sample_time)
                    op["begin"] = len(events)
                    stream = _draws(seed, f"{one.fault.name} {channel}")
                    events += _events(one.fault.kind, strength, size, self.window, stream)
                    op["end"] = len(events)
                    ops.append(op)
        self._ops = np.array(ops, _OP)
        self._events = np.array(events or [(0.0, 0.0, 0.0, 0.0)], _EVENT)
        self._states = np.zeros(len(ops), _STATE)
        self._states["cursor"] = self._ops["begin"]
        longest = int(self._ops["lag"].max(initial=0))
        self._ring = np.zeros((longest + 1, len(ops), 2))
        self._clock = np.zeros(1, _CLOCK)
        self._kept = np.zeros((3, len(names)))

    def apply(self, observations: npt.NDArray[Any]) -> None:
        """Change the next observations in place; structured array, shape (n,)."""
        rows = observations.view(np.float64).reshape(len(observations), -1)
        _apply(
            self._samples, rows, self.window, self._ops, self._states, self._events, self._ring,
            self._jitter, self._swaps, self._clock, self._kept,
        )  # fmt: skip
        self._samples += len(observations)


def _draws(seed: int, name: str) -> np.random.Generator:
    words = entropy(seed, zlib.crc32(f"fault {name}".encode()))
    return np.random.default_rng(np.random.SeedSequence(words))


def _events(
    kind: str,
    strength: Severity,
    size: float,
    window: npt.NDArray[np.float64],
    stream: np.random.Generator,
) -> list[tuple[float, float, float, float]]:
    """Return when a fault happens to a channel: start, end, size and slope."""
    begin, end = map(float, window)
    sign = 1.0 if stream.random() < 0.5 else -1.0
    if kind == "bias":
        return [(begin, end, sign * size, 0.0)]
    if kind == "drift":
        return [(begin, end, 0.0, sign * size)]
    if kind == "spikes":
        count = int(stream.poisson(strength.rate * (end - begin)))
        starts = np.sort(stream.uniform(begin, end, count))
        signs = np.where(stream.random(count) < 0.5, -1.0, 1.0)
        return [
            (float(at), float(at), float(size * way), 0.0)
            for at, way in zip(starts, signs, strict=True)
        ]
    if not strength.share:
        return [(begin, begin + strength.length if strength.length else end, 0.0, 0.0)]
    found = []
    gap = strength.length * (1.0 - strength.share) / strength.share
    at = begin + stream.exponential(gap)
    while at < end:
        until = at + stream.exponential(strength.length)
        found.append((at, min(until, end), 0.0, 0.0))
        at = until + stream.exponential(gap)
    return found
