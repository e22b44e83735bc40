"""Read ASAM MDF4 measurement files through asammdf."""

from __future__ import annotations

import logging
import struct
from pathlib import Path
from typing import Any

import numpy as np

from gripbench.errors import InputError
from gripbench.logs.channel_map import LogFile
from gripbench.logs.readers import Content, LogColumn, optional

_HEADER = 64  # address of the header block: the first link of every MDF4 file
_BLOCK = struct.Struct("<8sQQ")  # identification, length, number of links


def read(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Read the numeric channels of an MDF4 file.

    A channel name that several groups use is written `group/name`, groups counted from 0.

    Raises
    ------
    InputError
        If asammdf is missing, the file is not MDF4, or its data ends before what its blocks say.
    """
    asammdf = optional("asammdf", "an MDF4 file")
    _refuse_cut(path)
    logger = logging.getLogger("asammdf")
    level = logger.level
    logger.setLevel(logging.CRITICAL)  # its complaints about damaged files come as tracebacks
    try:
        with asammdf.MDF(path) as mdf:
            return _collect(path, mdf, wanted)
    finally:
        logger.setLevel(level)


def _collect(path: Path, mdf: Any, wanted: frozenset[str] | None) -> Content:
    content = Content()
    for group_index, group in enumerate(mdf.groups):
        master = mdf.masters_db.get(group_index)
        for channel_index, channel in enumerate(group.channels):
            if channel_index == master:
                continue
            name = channel.name
            if len(mdf.channels_db[name]) > 1:
                name = f"{group_index}/{name}"
            content.names.append(name)
            if wanted is not None and name not in wanted:
                continue
            signal = mdf.get(group=group_index, index=channel_index)
            if signal.samples.ndim != 1 or signal.samples.dtype.kind not in "fiub":
                continue
            declared = group.channel_group.cycles_nr
            if len(signal.samples) != declared or len(signal.timestamps) != declared:
                raise InputError(
                    f"{path}: channel '{name}' has {len(signal.samples)} of {declared} samples: "
                    "the file is truncated"
                )
            content.columns[name] = LogColumn(
                signal.samples.astype(np.float64),
                np.asarray(signal.timestamps, dtype=np.float64),
                str(signal.unit or ""),
            )
    if not content.names:
        raise InputError(f"{path}: holds no channel")
    return content


def _refuse_cut(path: Path) -> None:
    """Follow every link from the header block; asammdf itself may stop in the middle of one."""
    size = path.stat().st_size
    with path.open("rb") as handle:
        if not handle.read(_HEADER).startswith((b"MDF     4", b"UnFinMF 4")):
            raise InputError(f"{path}: is not an MDF file of version 4")
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
