"""Read ASAM MDF files, versions 3 and 4, through asammdf; runs in a process of its own."""

from __future__ import annotations

import logging
import struct
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.errors import InputError
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers.can_decoding import decode
from gripbench.logs.readers.can_text import Frame, Trace
from gripbench.logs.readers.log import Content, LogColumn, optional

LIBRARIES = ("asammdf", "cantools")

_HEADER = 64  # address of the header block: the first link of every MDF4 file
_BLOCK = struct.Struct("<8sQQ")  # identification, length, number of links


def read(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Read the channels of an MDF file; CAN frames in it are decoded by the map's databases.

    A channel name that several groups use is written `group/name`, groups counted from 0. Samples
    that the file marks as invalid, and numbers that stand for a word (SNA), are blanks; a channel
    of words only comes as the words.

    Raises
    ------
    InputError
        If asammdf is missing, the file is not MDF, or its data ends before what its blocks say.
    """
    asammdf = optional("asammdf", "an MDF file")
    _refuse_cut(path)
    logger = logging.getLogger("asammdf")
    level = logger.level
    logger.setLevel(logging.CRITICAL)  # its complaints about damaged files come as tracebacks
    try:
        with asammdf.MDF(path) as mdf:
            frames = _frames(mdf)
            if frames and file.database:
                return decode(path, Trace(frames, []), file, wanted)
            content = _collect(path, mdf, wanted)
            if frames:
                content.notes.append(
                    f"has {len(frames)} CAN frames: name the DBC file that decodes them with the "
                    "key 'database'"
                )
            if not content.columns and wanted is None:
                raise InputError(
                    f"{path}: key 'database': its CAN frames need the DBC file that decodes them"
                    if frames
                    else f"{path}: holds no channel with samples"
                )
            return content
    finally:
        logger.setLevel(level)


def _collect(path: Path, mdf: Any, wanted: frozenset[str] | None) -> Content:
    content = Content()
    clocks: dict[int, npt.NDArray[np.float64]] = {}
    for group_index, group in enumerate(mdf.groups):
        master = mdf.masters_db.get(group_index)
        for channel_index, channel in enumerate(group.channels):
            if channel_index == master or channel.name.startswith("CAN_"):
                continue
            name = channel.name
            if len(mdf.channels_db[name]) > 1:
                name = f"{group_index}/{name}"
                several = content.twins.get(channel.name, ())
                content.twins[channel.name] = (*several, name)
            content.names.append(name)
            if wanted is not None and name not in wanted:
                continue
            signal = mdf.get(group=group_index, index=channel_index, ignore_invalidation_bits=True)
            if signal.samples.ndim != 1:
                continue
            values = _values(signal)
            if values is None:
                continue
            declared = group.channel_group.cycles_nr
            if len(values) != declared or len(signal.timestamps) != declared:
                raise InputError(
                    f"{path}: channel '{name}' has {len(values)} of {declared} samples: "
                    "the file is truncated"
                )
            if signal.invalidation_bits is not None and values.dtype != object:
                values[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
            if declared:
                clock = clocks.setdefault(
                    group_index, np.asarray(signal.timestamps, dtype=np.float64)
                )
                content.columns[name] = LogColumn(values, clock, str(signal.unit or ""))
    if not content.names and not any("CAN_DataFrame" in name for name in mdf.channels_db):
        raise InputError(f"{path}: holds no channel")
    return content


def _values(signal: Any) -> npt.NDArray[Any] | None:
    """Return samples as numbers, words among them as NaN, or as words where they are all words."""
    samples = signal.samples
    if samples.dtype.kind in "fiub":
        return np.asarray(samples, dtype=np.float64).copy()
    if samples.dtype.kind not in "SUO":
        return None
    words = [
        one.decode("utf-8", errors="replace").strip("\0 ") if isinstance(one, bytes) else str(one)
        for one in samples
    ]
    numbers = np.full(len(words), np.nan)
    for index, word in enumerate(words):
        try:
            numbers[index] = float(word)
        except ValueError:
            continue
    if np.isfinite(numbers).any():
        return numbers
    return np.array(words, dtype=object)


def _frames(mdf: Any) -> list[Frame]:
    """Return the CAN data frames of a bus log."""
    frames: list[Frame] = []
    for group_index, group in enumerate(mdf.groups):
        names = {channel.name: index for index, channel in enumerate(group.channels)}
        if "CAN_DataFrame" not in names:
            continue

        def part(name: str, group_index: int = group_index, names: Any = names) -> Any:
            full = f"CAN_DataFrame.{name}"
            if full not in names:
                return None
            return mdf.get(group=group_index, index=names[full]).samples

        identifiers, payload = part("ID"), part("DataBytes")
        if identifiers is None or payload is None:
            continue
        times = mdf.get(group=group_index, index=names["CAN_DataFrame.ID"]).timestamps
        lengths, channels, forms = part("DataLength"), part("BusChannel"), part("IDE")
        for row in range(len(times)):
            number = int(identifiers[row])
            extended = bool(forms[row]) if forms is not None else bool(number & 0x80000000)
            extended |= number & 0x1FFFFFFF > 0x7FF
            data = bytes(payload[row])
            if lengths is not None:
                data = data[: int(lengths[row])]
            channel = str(int(channels[row])) if channels is not None else "0"
            frames.append(Frame(float(times[row]), channel, number & 0x1FFFFFFF, extended, data))
    return frames


def _refuse_cut(path: Path) -> None:
    """Follow every link from the header block; asammdf itself may stop in the middle of one."""
    size = path.stat().st_size
    with path.open("rb") as handle:
        mark = handle.read(_HEADER)
        if mark.startswith((b"MDF     3", b"MDF     2", b"UnFinMF 3")):
            return  # asammdf counts the records of these itself, see `_collect`
        if not mark.startswith((b"MDF     4", b"UnFinMF 4")):
            raise InputError(f"{path}: is not an MDF file")
        waiting, seen = [_HEADER], {0}
        while waiting:
            address = waiting.pop()
            if address in seen:
                continue
            seen.add(address)
            handle.seek(address)
            head = handle.read(_BLOCK.size)
            if len(head) < _BLOCK.size or not head.startswith(b"##"):
                raise InputError(f"{path}: a block is missing: the file is truncated or damaged")
            _, length, count = _BLOCK.unpack(head)
            if address + length > size or _BLOCK.size + 8 * count > length:
                raise InputError(f"{path}: a block ends beyond the file: the file is truncated")
            waiting += struct.unpack(f"<{count}Q", handle.read(8 * count))
