"""Read CAN frames from the texts of other tools: ASC, candump, and tables of frames as CSV.

Own readers, for a kept library drops frames of such files: those before time 0, those of a trace
whose date it cannot read, those after the header of another tool.
"""

from __future__ import annotations

import base64
import binascii
import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from gripbench.errors import InputError


@dataclass(frozen=True, slots=True)
class Frame:
    """One data frame: time [s], channel, identifier, whether that is extended, and the bytes."""

    time: float
    channel: str
    identifier: int
    extended: bool
    data: bytes


@dataclass
class Trace:
    """Frames of a text, and what its reader should know about it."""

    frames: list[Frame]
    notes: list[str]


_TIME = r"(-?\d+(?:[.,]\d+)?)"
_ASC = re.compile(rf"\s*{_TIME}\s+(\d+)\s+([0-9A-Fa-f]+)(x?)\s+(?:Rx|Tx|TxRq)\s+d\s+(\w+)\s*(.*)$")
_ASC_FD = re.compile(
    rf"\s*{_TIME}\s+CANFD\s+(\d+)\s+(?:Rx|Tx|TxRq)\s+([0-9A-Fa-f]+)(x?)\s+"
    r"(?:\S+\s+)?([01])\s+([01])\s+(\w)\s+(\d+)\s+(.*)$"
)
_CANDUMP = re.compile(
    r"\s*\((-?\d+(?:\.\d+)?)\)\s+(\S+)\s+([0-9A-Fa-f]+)#(?:#([0-9A-Fa-f]))?([0-9A-Fa-f.]*)"
    r"(?:\s+[RT])?\s*$"
)
_CANDUMP_SCREEN = re.compile(
    r"\s*\((-?\d+(?:\.\d+)?)\)\s+(\S+)\s+(?:[RT]X\s+\S+\s+)?([0-9A-Fa-f]+)\s+\[(\d+)\]\s+"
    r"((?:[0-9A-Fa-f]{2}\s*)*)$"
)
_ASC_HEAD = re.compile(r"(?mi)^\s*(date\s|base\s+(hex|dec)|begin triggerblock|// version)")


def is_asc(text: str) -> bool:
    """Whether a text starts as an ASC trace does."""
    return _ASC_HEAD.search(text[:4000]) is not None


def is_candump(text: str) -> bool:
    """Whether a text has a line of candump at its beginning."""
    return any(
        _CANDUMP.match(line) or _CANDUMP_SCREEN.match(line) for line in text[:4000].split("\n")
    )


def frames_of_asc(path: Path, text: str) -> Trace:
    """Return the data frames of a Vector or BUSMASTER ASC trace.

    Raises
    ------
    InputError
        If it has no frame.
    """
    decimal = re.search(r"(?mi)^\s*base\s+dec", text[:4000]) is not None
    relative = re.search(r"(?mi)^\s*base\s.*timestamps\s+relative", text[:4000]) is not None
    base = 10 if decimal else 16
    lines = text.split("\n")
    ended = "end triggerblock" in text[-2000:].lower()
    notes = []
    if not ended:
        notes.append("the end mark 'End TriggerBlock' is missing: the trace may be cut off")
        if lines[-1]:  # what a cut line holds may look like a whole frame
            lines.pop()
    frames = []
    now, odd = 0.0, 0
    for line in lines:
        found, flexible = _ASC.match(line), False
        if found is None:
            found, flexible = _ASC_FD.match(line), True
        if found is None:
            continue
        time = float(found.group(1).replace(",", "."))
        now = now + time if relative else time
        length = int(found.group(8)) if flexible else int(found.group(5), 16)
        cells = (found.group(9) if flexible else found.group(6)).split()[:length]
        try:
            data = bytes(int(cell, base) for cell in cells)
            identifier = int(found.group(3), base)
        except ValueError:
            odd += 1
            continue
        if len(data) != length:
            odd += 1
            continue
        channel = str(int(found.group(2)) - 1)  # counted from 0, as other formats do
        frames.append(Frame(now, channel, identifier, found.group(4) == "x", data))
    if odd:
        notes.append(f"{odd} lines with a damaged frame were left out")
    if not frames:
        raise InputError(f"{path}: the trace has no data frame, it may be truncated or damaged")
    return Trace(frames, notes)


def frames_of_candump(path: Path, text: str) -> Trace:
    """Return the data frames of what candump wrote, as a log or as on the screen.

    Raises
    ------
    InputError
        If it has no frame.
    """
    notes = []
    lines = text.split("\n")
    if lines[-1]:
        notes.append("the last line has no line end and was left out: the file may be cut off")
        lines.pop()
    frames, odd = [], 0
    for line in lines:
        found = _CANDUMP.match(line)
        if found is not None:
            time, channel, identifier, _, digits = found.groups()
            digits = digits.replace(".", "")
        else:
            found = _CANDUMP_SCREEN.match(line)
            if found is None:
                odd += bool(line.strip()) and "#R" not in line and "remote" not in line
                continue
            time, channel, identifier, length, digits = found.groups()
            digits = "".join(digits.split())
            if len(digits) != 2 * int(length):
                odd += 1
                continue
        if len(digits) % 2:
            odd += 1
            continue
        frames.append(
            Frame(float(time), channel, int(identifier, 16), len(identifier) > 3,
                  bytes.fromhex(digits))
        )  # fmt: skip
    if odd:
        notes.append(f"{odd} lines hold no frame and were left out")
    if not frames:
        raise InputError(f"{path}: the trace has no data frame, it may be truncated or damaged")
    return Trace(frames, notes)


def is_table_of_frames(text: str) -> bool:
    """Whether a text is a table of CAN frames, as python-can or SavvyCAN write it."""
    return _head(text)[:2] in (["timestamp", "arbitration_id"], ["time stamp", "id"])


def _head(text: str) -> list[str]:
    line = text[:2000].split("\n", 1)[0]
    return [cell.strip().lower() for cell in line.split(",")]


def frames_of_table(path: Path, text: str) -> Trace:
    """Return the data frames of a table of frames.

    Raises
    ------
    InputError
        If a row is no frame.
    """
    head = _head(text)
    savvy = head[0] == "time stamp"
    lines = text.split("\n")
    notes = []
    if lines[-1]:
        notes.append("the last line has no line end and was left out: the file may be cut off")
        lines.pop()
    frames = []
    for number, row in enumerate(csv.reader(lines[1:]), start=2):
        if not row:
            continue
        cells = dict(zip(head, (cell.strip() for cell in row), strict=False))
        try:
            if savvy:
                count = int(cells["len"])
                data = bytes(int(cells[f"d{k + 1}"], 16) for k in range(count))
                extended = cells["extended"].lower() in ("true", "1")
                frame = Frame(
                    float(cells["time stamp"]) * 1e-6, cells["bus"], int(cells["id"], 16),
                    extended, data,
                )  # fmt: skip
            else:
                if cells["remote"] == "1" or cells["error"] == "1":
                    continue
                stamp = re.search(r"-?\d+(\.\d+)?([eE][-+]?\d+)?(?=\)|$)", cells["timestamp"])
                data = base64.b64decode(cells["data"], validate=True)
                if stamp is None or len(data) != int(cells["dlc"]):
                    raise ValueError
                frame = Frame(
                    float(stamp.group()), cells.get("channel", "0"),
                    int(cells["arbitration_id"], 16), cells["extended"] == "1", data,
                )  # fmt: skip
        except (KeyError, ValueError, binascii.Error):
            raise InputError(
                f"{path}: line {number}: not a CAN frame: {','.join(row)[:60]!r}"
            ) from None
        frames.append(frame)
    if not frames:
        raise InputError(f"{path}: the trace has no data frame")
    return Trace(frames, notes)


def frames_of(messages: Iterator[object]) -> Iterator[Frame]:
    """Return python-can's messages as frames, without error and remote frames."""
    for message in messages:
        if message.is_error_frame or message.is_remote_frame:  # type: ignore[attr-defined]
            continue
        yield Frame(
            message.timestamp,  # type: ignore[attr-defined]
            str(message.channel if message.channel is not None else 0),  # type: ignore[attr-defined]
            message.arbitration_id,  # type: ignore[attr-defined]
            message.is_extended_id,  # type: ignore[attr-defined]
            bytes(message.data),  # type: ignore[attr-defined]
        )
