"""Names of faults and their TOML files in; what happens to which channel, and how hard, out."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from gripbench.configuration import CONFIGS, Configuration, parse, read_toml
from gripbench.envs.signals import NEW, signal
from gripbench.errors import InputError, nearest, unknown

SEVERITIES = (1, 2, 3, 4, 5)
"""From what happens every day to what a workshop has to mend."""

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
