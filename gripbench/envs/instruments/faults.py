"""Faults of instruments: from the readings of a run and a list of faults to what arrives instead.

A fault acts in a window of the run, on readings as an instrument gives them: a channel of fewer
samples changes where it is new and is held in between. Several faults act one after the other.
Whatever is random is drawn for the seed before the run, in a stream of its own for each fault and
channel, so that a faulty run and its clean twin differ by the fault alone, and a run is the same
sample by sample as in one call.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from gripbench.compilation import compiled
from gripbench.configuration import CONFIGS, Configuration, parse, read_toml
from gripbench.envs.signals import NEW, signal
from gripbench.errors import InputError, nearest, unknown

SEVERITIES = (1, 2, 3, 4, 5)
"""From what happens every day to what a workshop has to mend."""

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

_SUFFIX = re.compile(r"\+(?P<fault>[^+@/\\.]+)$")


class Severity(Configuration):
    """One severity of a fault.

    Attributes
    ----------
    size
        By unit of the channel: size of a spike, bias, limit or step; of a drift for each second.
    factor
        What a reading is multiplied by.
    share, length
        Share of the time that is lost, in bursts of this mean length [s]; without a share there is
        one gap of the length.
    rate
        Spikes a second.
    delay
        Additional age of a reading [s].
    jitter
        Standard deviation of the time stamps [s].
    source
        Where the figures come from.
    guess
        Whether no source gives them.
    """

    size: dict[str, float] = {}
    factor: float = 1.0
    share: float = Field(default=0.0, ge=0.0, lt=1.0)
    length: float = Field(default=0.0, ge=0.0)
    rate: float = Field(default=0.0, ge=0.0)
    delay: float = Field(default=0.0, ge=0.0, le=10.0)
    jitter: float = Field(default=0.0, ge=0.0)
    source: str
    guess: bool = False


class Fault(Configuration):
    """A kind of fault, as its file gives it.

    Attributes
    ----------
    name, description
        Unique name; the file has the same.
    kind
        What happens to a reading; `jitter` and `disorder` happen to the time stamps.
    channels, instruments
        On what it acts: these channels, or those of these instruments.
    first
        Whether it acts on the first of the channels that is there only.
    severities
        Five, the mildest first.
    """

    name: str = Field(pattern=r"^[a-z][a-z_]*$")
    description: str
    kind: Literal[
        "loss", "freeze", "spikes", "bias", "drift", "scale", "saturation", "quantisation",
        "delay", "jitter", "disorder",
    ]  # fmt: skip
    channels: tuple[str, ...] = ()
    instruments: tuple[str, ...] = ()
    first: bool = False
    severities: tuple[Severity, ...]

    @model_validator(mode="after")
    def _check_severities(self) -> Self:
        if len(self.severities) != len(SEVERITIES):
            raise ValueError(f"severities has {len(self.severities)} tables; it must have 5")
        return self

    def acts_on(self, present: Sequence[str]) -> tuple[str, ...]:
        """Return the channels among those present on which it acts."""
        found = [name for name in present if not name.endswith(NEW) and self._meets(name)]
        ordered = [name for name in self.channels if name in found] or found
        return tuple(ordered[:1] if self.first else ordered)

    def _meets(self, channel: str) -> bool:
        known = signal(channel)
        units = set(self.severities[0].size)
        if units and known.unit not in units:
            return False
        return channel in self.channels or known.instrument in self.instruments


@dataclass(frozen=True)
class Chosen:
    """A fault at a severity, on one channel or on all that it acts on.

    Attributes
    ----------
    fault, severity, channel
        What was chosen; no channel: all of the fault's.
    """

    fault: Fault
    severity: int
    channel: str = ""

    @property
    def name(self) -> str:
        """What names it behind a scenario's name."""
        return ":".join(filter(None, (self.fault.name, str(self.severity), self.channel)))

    @property
    def strength(self) -> Severity:
        """The severity's figures."""
        return self.fault.severities[self.severity - 1]

    def channels(self, present: Sequence[str]) -> tuple[str, ...]:
        """Return the channels on which it acts; those of a clock act on `time`."""
        if self.fault.kind in ("jitter", "disorder"):
            return ("time",)
        if self.channel:
            return (self.channel,) if self.channel in present else ()
        return self.fault.acts_on(present)


def fault_files() -> dict[str, Any]:
    """Return the faults' files that ship with gripbench, by name."""
    return {path.stem: path for path in sorted((CONFIGS / "faults").glob("*.toml"))}


@lru_cache(maxsize=64)
def load_fault(name: str) -> Fault:
    """Return a fault by name.

    Raises
    ------
    InputError
        If there is none; the message names the nearest one.
    """
    files = fault_files()
    if name not in files:
        raise unknown("fault", name, files)
    return parse(Fault, read_toml(files[name]), files[name])


def choose_fault(text: str) -> Chosen:
    """Return the fault that `NAME:SEVERITY` or `NAME:SEVERITY:CHANNEL` names.

    Raises
    ------
    InputError
        If there is no such fault, severity or channel.
    """
    name, *rest = text.split(":")
    fault = load_fault(name)
    if not rest or rest[0] not in map(str, SEVERITIES) or len(rest) > 2:
        raise InputError(f"fault '{text}': give a severity from 1 to 5, such as {name}:3")
    channel = rest[1] if len(rest) == 2 else ""
    if channel:
        unit = signal(channel).unit
        units = fault.severities[0].size
        if units and unit not in units:
            raise InputError(
                f"fault '{text}': {name} has no size in {unit}, only in {', '.join(units)}"
            )
        if fault.kind in ("jitter", "disorder"):
            raise InputError(f"fault '{text}': {name} acts on the clock, not on a channel")
    return Chosen(fault, int(rest[0]), channel)


def split_faults(name: str) -> tuple[str, tuple[str, ...]]:
    """Split `SCENARIO+FAULT:SEVERITY+...` into the scenario's name and the faults.

    Examples
    --------
    >>> split_faults("slalom_snow@1+dropout:3+freeze:1:yaw_rate")
    ('slalom_snow@1', ('dropout:3', 'freeze:1:yaw_rate'))
    """
    faults: list[str] = []
    while found := _SUFFIX.search(name):
        faults.insert(0, found["fault"])
        name = name[: found.start()]
    return name, tuple(faults)


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


def check_present(one: Chosen, names: Sequence[str]) -> None:
    """Check that a fault acts on something that the instruments give.

    Raises
    ------
    InputError
        If it does not.
    """
    if one.channels(names):
        return
    if one.channel:
        raise InputError(
            f"fault '{one.name}': the instruments give no '{one.channel}': "
            f"{nearest(one.channel, names)}"
        )
    wanted = ", ".join((*one.fault.channels, *one.fault.instruments))
    raise InputError(f"fault '{one.name}': the instruments give none of {wanted}")


def _draws(seed: int, name: str) -> np.random.Generator:
    entropy = [seed, zlib.crc32(f"fault {name}".encode())]
    return np.random.default_rng(np.random.SeedSequence(entropy))


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
