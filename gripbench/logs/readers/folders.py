"""Read a folder as one log: files with one channel each, or the `oxts` of a KITTI drive."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

from gripbench.errors import InputError
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers.log import Content, LogColumn
from gripbench.logs.readers.text_tables import COMPRESSED, parse_table, text_of

_TEXTS = (".txt", ".csv", ".tsv", ".dat", ".asc")
_KITTI = (
    "lat", "lon", "alt", "roll", "pitch", "yaw", "vn", "ve", "vf", "vl", "vu", "ax", "ay", "az",
    "af", "al", "au", "wx", "wy", "wz", "wf", "wl", "wu", "pos_accuracy", "vel_accuracy",
    "navstat", "numsats", "posmode", "velmode", "orimode",
)  # fmt: skip
_KITTI_UNITS = dict.fromkeys(("lat", "lon"), "deg") | dict.fromkeys(
    ("roll", "pitch", "yaw"), "rad"
) | dict.fromkeys(("vn", "ve", "vf", "vl", "vu"), "m/s") | dict.fromkeys(
    ("ax", "ay", "az", "af", "al", "au"), "m/s^2"
) | dict.fromkeys(("wx", "wy", "wz", "wf", "wl", "wu"), "rad/s") | {"alt": "m"}  # fmt: skip


def read(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Read a folder whose files make one log.

    Where each file has one column, a channel is called by its file, and a file that is called
    `time` or the like is the time of all that have its length; where each has two, the first is
    the time of the second.

    Raises
    ------
    InputError
        If its files are none of these.
    """
    kitti = _kitti_data(path)
    if kitti is not None:
        return _read_kitti(path, kitti, wanted)
    files = data_files(path)
    if not files:
        raise InputError(f"{path}: the folder has no file of text with numbers")
    content = Content()
    for one in files:
        part = parse_table(one, text_of(one), file, None)
        name = channel_name(one)
        columns = list(part.columns.values())
        content.notes += [f"{one.name}: {note}" for note in part.notes]
        content.suggestions |= part.suggestions
        if len(columns) > 2 or (len(columns) == 2 and not _rises(columns[0])):
            raise InputError(
                f"{path}: {one.name} has {len(columns)} columns: name each file and its time "
                "under [files] in the map (--inspect proposes one)"
            )
        column = columns[-1]
        if len(columns) == 2:
            column = LogColumn(column.values, columns[0].values, column.unit)
        if name in content.names:
            raise InputError(f"{path}: two files are called '{name}'")
        content.names.append(name)
        if wanted is None or name in wanted:
            content.columns[name] = column
    return content


def data_files(path: Path) -> list[Path]:
    """Return the files of text in a folder that may hold numbers, in the order of their names."""
    return [
        one
        for one in sorted(path.iterdir())
        if one.is_file()
        and not one.name.startswith(".")
        and one.name.lower().removesuffix(".txt") not in ("readme", "license", "licence")
        and (one.suffix.lower() in (*_TEXTS, *COMPRESSED))
        and one.stat().st_size
    ]


def is_one_log(path: Path) -> bool:
    """Whether the files of a folder make one log, as `read` takes them."""
    if _kitti_data(path) is not None or (path / "metadata.yaml").is_file():
        return True
    files = data_files(path)
    if not files:
        return False
    try:
        for one in files[:3]:
            columns = list(parse_table(one, text_of(one), LogFile(path=one.name), None).columns)
            if len(columns) > 2:
                return False
    except InputError:
        return False
    return len(files) > 1


def channel_name(path: Path) -> str:
    """Return what a file with one channel calls it."""
    return path.name.partition(".")[0]


def _rises(column: LogColumn) -> bool:
    return (
        not column.is_text and len(column.values) > 1 and bool(np.all(np.diff(column.values) > 0))
    )


def _kitti_data(path: Path) -> Path | None:
    for folder in (path, path / "data", path / "oxts" / "data"):
        if folder.is_dir():
            first = next(iter(sorted(folder.glob("[0-9]*.txt"))), None)
            if first is not None and first.stem.isdecimal() and len(first.stem) >= 6:
                with first.open(encoding="utf-8", errors="replace") as handle:
                    if len(handle.readline().split()) == len(_KITTI):
                        return folder
    return None


def _read_kitti(path: Path, folder: Path, wanted: frozenset[str] | None) -> Content:
    files = sorted(folder.glob("[0-9]*.txt"))
    rows = []
    for one in files:
        cells = text_of(one).split()
        if len(cells) != len(_KITTI):
            raise InputError(f"{one}: has {len(cells)} values, a line of oxts has {len(_KITTI)}")
        try:
            rows.append([float(cell) for cell in cells])
        except ValueError as error:
            raise InputError(f"{one}: {error}") from None
    table = np.array(rows)
    times = _kitti_times(folder, len(files))
    content = Content(names=list(_KITTI))
    if times is None:
        content.notes.append(
            "timestamps.txt is not beside the folder of the data: the rate must be known, which "
            "is 100 Hz for unsynchronised and 10 Hz for synchronised drives"
        )
    else:
        content.names.insert(0, "time")
        content.columns["time"] = LogColumn(times, unit="s")
    for index, name in enumerate(_KITTI):
        if wanted is None or name in wanted:
            content.columns[name] = LogColumn(table[:, index], unit=_KITTI_UNITS.get(name, ""))
    return content


def _kitti_times(folder: Path, count: int) -> npt.NDArray[np.float64] | None:
    stamps = folder.parent / "timestamps.txt"
    if not stamps.is_file():
        return None
    lines = [line for line in text_of(stamps).split("\n") if line.strip()]
    if len(lines) != count:
        raise InputError(f"{stamps}: has {len(lines)} times for {count} files")
    try:
        moments = pd.to_datetime(pd.Series(lines), format="ISO8601", utc=True)
    except ValueError:
        raise InputError(f"{stamps}: holds something other than dates") from None
    nanoseconds = moments.astype("datetime64[ns, UTC]").astype("int64").to_numpy()
    return np.asarray((nanoseconds - nanoseconds[0]) * 1e-9, dtype=np.float64)
