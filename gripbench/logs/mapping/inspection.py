"""Look at a log before there is a map: list its columns and propose a map to start from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from gripbench.errors import InputError
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.mapping.proposal import propose
from gripbench.logs.mapping.time_columns import time_table
from gripbench.logs.readers.folders import channel_name, is_one_log
from gripbench.logs.readers.log import Log, LogColumn
from gripbench.logs.readers.reading import is_known, read_log


@dataclass(frozen=True)
class Summary:
    """One column of a log in figures; those of a text column are its first values."""

    name: str
    unit: str
    samples: int
    blanks: int
    low: str
    high: str


@dataclass(frozen=True)
class Inspection:
    """What is in a log, and the map that is proposed for it."""

    columns: tuple[Summary, ...]
    time: str
    proposal: str
    notes: tuple[str, ...] = ()


def inspect_log(path: Path, database: str | Sequence[str] = "") -> Inspection:
    """List the columns of a log and propose a map.

    Parameters
    ----------
    path
        The file; or a folder that makes one log, or whose tables make one.
    database
        DBC file, for CAN frames, or several; `CHANNEL=FILE` is for one channel.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    databases = tuple([database] if isinstance(database, str) else database)
    databases = tuple(_whole(entry) for entry in databases if entry)
    if path.is_dir() and not is_one_log(path):
        files = [one for one in sorted(path.iterdir()) if one.is_file() and is_known(one)]
        files = [one for one in files if one.stat().st_size]
        if not files:
            raise InputError(f"{path}: the folder has no file of a known format")
        logs = {_short(one): _read(one, databases) for one in files}
    else:
        logs = {"": _read(path, databases)}
    columns = tuple(
        _summary(f"{short}: {name}" if short else name, column)
        for short, log in logs.items()
        for name, column in log.columns.items()
    )
    time = str(time_table(next(iter(logs.values()))).keys.get("column", ""))
    notes = tuple(f"{log.path}: {note}" for log in logs.values() for note in log.notes)
    return Inspection(columns, time, propose(path, logs, databases), notes)


def _whole(entry: str) -> str:
    """Return an entry `[CHANNEL=]FILE` with the file's whole path: one is given from anywhere."""
    channel, equals, name = entry.rpartition("=")
    if Path(entry).is_file():
        channel, equals, name = "", "", entry
    found = Path(name)
    return f"{channel}{equals}{found.resolve() if found.is_file() else name}"


def _read(path: Path, databases: tuple[str, ...]) -> Log:
    log = read_log(path, LogFile(path=path.name, database=databases))
    if log.suggestions.get("decimal"):
        again = LogFile(path=path.name, database=databases, decimal=",")
        return replace(read_log(path, again), suggestions=log.suggestions)
    return log


def _short(path: Path) -> str:
    name = "".join(c if c.isalnum() else "_" for c in channel_name(path).lower())
    return name.strip("_") or "log"


def _summary(name: str, column: LogColumn) -> Summary:
    blanks = int(pd.isna(column.values).sum())
    filled = column.values[~pd.isna(column.values)]
    if not len(filled):
        return Summary(name, column.unit, len(column.values), blanks, "-", "-")
    if column.is_text:
        low, high = str(filled[0])[:24], str(filled[-1])[:24]
    else:
        low, high = f"{np.min(filled):.6g}", f"{np.max(filled):.6g}"
    return Summary(name, column.unit, len(column.values), blanks, low, high)
