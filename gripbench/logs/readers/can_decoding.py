"""Decode CAN frames with databases: frames and DBC files in, one column a signal out.

A frame is known by its channel, its identifier and whether that is extended, never by the number
alone: streams that differ in one of these stay columns of their own.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gripbench.errors import InputError
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers.can_text import Trace
from gripbench.logs.readers.log import Content, LogColumn, optional
from gripbench.logs.readers.text_layout import MISSING

_UNAVAILABLE = ("sna", "not available", "notavailable", "signal not available", "not_available",
                "invalid", "error", "init", "snv", "fault")  # fmt: skip


@dataclass
class _Stream:
    """The frames of one channel, identifier and form, in their order."""

    channel: str
    identifier: int
    extended: bool
    times: list[float] = field(default_factory=list)
    data: list[bytes] = field(default_factory=list)


def decode(path: Path, trace: Trace, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Return the signals of a trace, called `Message.Signal`.

    Where a message comes in several streams, its name is led by what tells them apart: the channel
    (`0:Message.Signal`, counted from 0), or the identifier.

    Raises
    ------
    InputError
        If no database is named or readable, or none knows a frame of the trace.
    """
    if not file.database:
        raise InputError(
            f"{path}: key 'database': a CAN trace needs the DBC file that decodes it "
            "(with --inspect: --database FILE.dbc)"
        )
    cantools = optional("cantools", "a CAN trace")
    databases = [_database(cantools, path, entry) for entry in file.databases()]
    streams: dict[tuple[str, int, bool], _Stream] = {}
    for frame in trace.frames:
        key = (frame.channel, frame.identifier, frame.extended)
        stream = streams.get(key)
        if stream is None:
            stream = streams[key] = _Stream(*key)
        stream.times.append(frame.time)
        stream.data.append(frame.data)
    known = [
        (stream, message, by_group)
        for stream in streams.values()
        for message, by_group in [_message(stream, databases)]
        if message is not None
    ]
    if not known:
        seen = ", ".join(
            f"0x{s.identifier:X}{'x' if s.extended else ''}" for s in list(streams.values())[:8]
        )
        raise InputError(
            f"{path}: the database '{', '.join(file.databases())}' knows no frame of this trace "
            f"(it has {seen})"
        )
    content = Content(notes=list(trace.notes))
    odd = 0
    for stream, message, by_group in known:
        same = [one for one, other, _ in known if other.name == message.name]
        label = _label(stream, same)
        for signal in message.signals:
            plain, name = f"{message.name}.{signal.name}", f"{label}{message.name}.{signal.name}"
            content.names.append(name)
            if label:
                content.twins[plain] = (*content.twins.get(plain, ()), name)
        odd += _decode_stream(cantools, stream, message, by_group, label, wanted, content)
        if by_group:
            content.notes.append(
                f"frame 0x{stream.identifier:X} was taken for {message.name} by its J1939 group"
            )
    if odd:
        content.notes.append(f"{odd} frames do not fit the database and were left out")
    return content


def _database(cantools: Any, path: Path, entry: str) -> tuple[str, Any]:
    """Return the channel (empty: any) and the database of an entry `[CHANNEL=]FILE`."""
    channel, equals, name = entry.rpartition("=")
    if equals and (path.parent / entry).is_file():  # a file name with an equals sign
        channel, name = "", entry
    source = Path(name) if Path(name).is_absolute() else path.parent / name
    if not source.is_file():
        raise InputError(f"{source}: no such file (key 'database')")
    try:
        found = cantools.database.load_file(source, strict=False)
    except Exception as error:
        first = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise InputError(f"{source}: not a CAN database ({first[:200]})") from None
    if not hasattr(found, "messages"):
        raise InputError(f"{source}: not a CAN database but of diagnostics")
    return channel.strip(), found


def _message(stream: _Stream, databases: list[tuple[str, Any]]) -> tuple[Any, bool]:
    """Return the message of a stream, and whether only its J1939 group is the same."""
    fitting = [base for channel, base in databases if channel in ("", stream.channel)]
    messages = [message for base in fitting for message in base.messages]
    for message in messages:
        same = message.is_extended_frame == stream.extended
        if same and message.frame_id == stream.identifier:
            return message, message.protocol == "j1939"
    if stream.extended:
        for message in messages:
            if message.is_extended_frame and _group(message.frame_id) == _group(stream.identifier):
                return message, True
    return None, False


def _group(identifier: int) -> int:
    """Return the parameter group of a J1939 identifier, whatever its priority and addresses."""
    group = (identifier >> 8) & 0x3FFFF
    return group if (group >> 8) & 0xFF >= 240 else group & 0x3FF00


def _label(stream: _Stream, same: list[_Stream]) -> str:
    """Return what leads the names of a stream, among all streams of its message."""
    if len(same) == 1:
        return ""
    channels = [one.channel for one in same]
    label = f"{stream.channel}:" if len(set(channels)) > 1 else ""
    if channels.count(stream.channel) > 1:
        label += f"0x{stream.identifier:X}{'x' if stream.extended else ''}:"
    return label


def _decode_stream(
    cantools: Any,
    stream: _Stream,
    message: Any,
    by_group: bool,
    label: str,
    wanted: frozenset[str] | None,
    content: Content,
) -> int:
    """Add a stream's columns; return how many frames do not fit the database."""
    chosen = {
        signal.name: signal
        for signal in message.signals
        if wanted is None or f"{label}{message.name}.{signal.name}" in wanted
    }
    if not chosen:
        return 0
    samples: dict[str, tuple[list[float], list[float]]] = {name: ([], []) for name in chosen}
    odd = 0
    for time, data in zip(stream.times, stream.data, strict=True):
        try:
            raw = message.decode(data, decode_choices=False, scaling=False)
        except (cantools.database.DecodeError, ValueError, KeyError):
            odd += 1
            continue
        for name, (times, values) in samples.items():
            if name in raw:  # a multiplexed signal is not in every frame
                times.append(time)
                values.append(raw[name])
    for name, (times, values) in samples.items():
        if not times:
            continue
        signal = chosen[name]
        numbers = np.asarray(values, dtype=np.float64)
        scaled = numbers * float(signal.scale) + float(signal.offset)
        scaled[_unavailable(signal, numbers, by_group)] = np.nan
        content.columns[f"{label}{message.name}.{name}"] = LogColumn(
            scaled, np.asarray(times, dtype=np.float64), signal.unit or ""
        )
    return odd


def _unavailable(signal: Any, raw: Any, j1939: bool) -> Any:
    """Return which raw values stand for no value, by the database's words or by J1939."""
    words = [
        number
        for number, word in (signal.choices or {}).items()
        if str(word).strip().lower().replace("-", " ") in (*_UNAVAILABLE, *MISSING)
    ]
    blank = np.isin(raw, np.asarray(words, dtype=np.float64))
    if j1939 and not signal.is_signed and signal.length in (8, 16, 32):
        blank |= raw >= 0xFE << (signal.length - 8)  # error, and not available
    return blank
