"""Read CAN traces (.blf, .asc) through python-can, decoded by cantools with a database."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gripbench.errors import InputError
from gripbench.logs.channel_map import LogFile
from gripbench.logs.readers import Content, LogColumn, optional


def read(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Read the signals of a CAN trace, called `Message.Signal`, each with its frames' times.

    Raises
    ------
    InputError
        If python-can or cantools is missing, no database is named, the trace is truncated, or
        the database knows no frame of it.
    """
    can = optional("can", "a CAN trace")
    cantools = optional("cantools", "a CAN trace")
    if not file.database:
        raise InputError(f"{path}: key 'database': a CAN trace needs the DBC file that decodes it")
    database = _database(cantools, path, file.database)
    messages = {message.frame_id: message for message in database.messages}
    names = [f"{m.name}.{s.name}" for m in database.messages for s in m.signals]
    selected = {
        frame: [
            signal.name
            for signal in message.signals
            if wanted is None or f"{message.name}.{signal.name}" in wanted
        ]
        for frame, message in messages.items()
    }
    samples: dict[str, tuple[list[float], list[float]]] = {}
    odd = 0
    for frame in _frames(can, path):
        message = messages.get(frame.arbitration_id)
        if message is None or frame.is_error_frame or frame.is_remote_frame:
            continue
        if not selected[frame.arbitration_id]:
            continue
        try:
            decoded = message.decode(frame.data, decode_choices=False)
        except (cantools.database.DecodeError, ValueError):
            odd += 1
            continue
        for name in selected[frame.arbitration_id]:
            if name in decoded:  # a multiplexed signal is not in every frame
                times, values = samples.setdefault(f"{message.name}.{name}", ([], []))
                times.append(frame.timestamp)
                values.append(float(decoded[name]))
    content = Content(names=names)
    units = {f"{m.name}.{s.name}": s.unit or "" for m in database.messages for s in m.signals}
    for name, (times, values) in samples.items():
        content.columns[name] = LogColumn(
            np.asarray(values, dtype=np.float64), np.asarray(times, dtype=np.float64), units[name]
        )
    if odd:
        content.notes.append(f"{odd} frames do not fit the database and were left out")
    if not samples and any(selected.values()):
        raise InputError(f"{path}: the database '{file.database}' knows no frame of this trace")
    return content


def _database(cantools: Any, path: Path, name: str) -> Any:
    source = Path(name) if Path(name).is_absolute() else path.parent / name
    if not source.is_file():
        raise InputError(f"{source}: no such file (key 'database')")
    try:
        return cantools.database.load_file(source, strict=False)
    except Exception as error:
        first = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise InputError(f"{source}: not a CAN database ({first[:200]})") from None


def _frames(can: Any, path: Path) -> Any:
    if path.suffix.lower() == ".blf":
        # Opened here, for the reader leaves a file that it refuses open.
        with path.open("rb") as handle:
            reader = can.BLFReader(handle)
            if reader.file_size and reader.file_size != path.stat().st_size:
                raise InputError(
                    f"{path}: has {path.stat().st_size} of {reader.file_size} bytes: "
                    "the file is truncated"
                )
            yield from reader
        return
    with path.open(encoding="utf-8", errors="replace") as handle:
        if "end triggerblock" not in handle.read().lower()[-200:]:
            raise InputError(
                f"{path}: the line 'End TriggerBlock' is missing: the file is truncated"
            )
    with can.ASCReader(path, relative_timestamp=True) as reader:
        yield from reader
