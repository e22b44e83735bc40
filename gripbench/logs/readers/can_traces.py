"""Read a CAN trace (.blf, .asc, .trc, candump's .log): its frames, decoded by databases."""

from __future__ import annotations

from pathlib import Path

from gripbench.errors import InputError
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers import can_text
from gripbench.logs.readers.can_decoding import decode
from gripbench.logs.readers.can_text import Trace, frames_of
from gripbench.logs.readers.log import Content, optional
from gripbench.logs.readers.text_tables import parse_table, text_of

LIBRARIES = ("can", "cantools")


def read(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Read the signals of a CAN trace, each with its frames' times; see `decode`.

    Raises
    ------
    InputError
        If python-can or cantools is missing, no database is named, the trace is truncated, or
        no database knows a frame of it.
    """
    suffix = path.suffix.lower()
    if suffix == ".blf":
        return decode(path, _blf(path), file, wanted)
    text = text_of(path)
    if suffix == ".trc":
        return decode(path, _trc(path, text), file, wanted)
    if can_text.is_asc(text):
        return decode(path, can_text.frames_of_asc(path, text), file, wanted)
    if can_text.is_candump(text):
        return decode(path, can_text.frames_of_candump(path, text), file, wanted)
    return parse_table(path, text, file, wanted)  # .asc and .log are tables elsewhere


def _blf(path: Path) -> Trace:
    can = optional("can", "a CAN trace")
    # Opened here, for the reader leaves a file that it refuses open.
    with path.open("rb") as handle:
        reader = can.BLFReader(handle)
        size = path.stat().st_size
        if reader.file_size and reader.file_size != size:
            raise InputError(
                f"{path}: has {size} of {reader.file_size} bytes: the file is truncated"
            )
        frames = list(frames_of(iter(reader)))
    if not frames:
        raise InputError(f"{path}: the trace has no data frame, it may be truncated or damaged")
    return Trace(frames, [])


def _trc(path: Path, text: str) -> Trace:
    can = optional("can", "a CAN trace")
    notes = []
    if not text.endswith("\n"):
        notes.append("the last line has no line end: the file may be cut off")
    with can.TRCReader(path) as reader:
        frames = list(frames_of(iter(reader)))
    if not frames:
        raise InputError(f"{path}: the trace has no data frame, it may be truncated or damaged")
    return Trace(frames, notes)
