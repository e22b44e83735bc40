"""Read a log: CSV, Parquet, MATLAB, ASAM MDF4, or a CAN trace with its database.

Every reader returns the same `Log`; whatever is wrong with a file becomes one `InputError`.
Formats beyond CSV, Parquet and MATLAB up to v7 need the extra `logs`.
"""

from __future__ import annotations

import csv
import hashlib
import importlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from gripbench.errors import GripbenchError, InputError, nearest
from gripbench.logs.channel_map import LogFile


@dataclass(frozen=True)
class LogColumn:
    """One column of a log.

    Attributes
    ----------
    values
        float64, shape (n,), NaN where the row has no value; or text, as objects.
    times
        Times [s], shape (n,), where the format gives every sample one; else None.
    unit
        Unit as the log writes it; empty where it does not say.
    """

    values: npt.NDArray[Any]
    times: npt.NDArray[np.float64] | None = None
    unit: str = ""

    @property
    def is_text(self) -> bool:
        """Whether the column holds text instead of numbers."""
        return self.values.dtype == object


@dataclass(frozen=True)
class Log:
    """What a file holds.

    Attributes
    ----------
    path
        The file; for data that came as a frame, how it was called.
    columns
        The columns that were read, by name.
    names
        Every column of the file, read or not.
    sha256
        Hash of the file; empty for a frame.
    notes
        What a reader should know about the file, one sentence each.
    """

    path: Path
    columns: dict[str, LogColumn]
    names: tuple[str, ...]
    sha256: str = ""
    notes: tuple[str, ...] = ()

    def column(self, name: str, key: str) -> LogColumn:
        """Return a column.

        Raises
        ------
        InputError
            If the log has none of that name; `key` is what asked for it.
        """
        if name not in self.columns:
            raise InputError(
                f"{self.path}: key '{key}': the log has no column '{name}': "
                f"{nearest(name, self.names)}"
            )
        return self.columns[name]

    def numbers(self, name: str, key: str) -> npt.NDArray[np.float64]:
        """Return a column's numbers.

        Raises
        ------
        InputError
            If there is no such column or it holds text.
        """
        column = self.column(name, key)
        if column.is_text:
            raise InputError(f"{self.path}: key '{key}': column '{name}' {_text_fault(column)}")
        return column.values


def read_log(path: Path, file: LogFile | None = None, wanted: Iterable[str] | None = None) -> Log:
    """Read a log.

    Parameters
    ----------
    path
        The file; its suffix tells the format.
    file
        How it is written; by default a file of that name without peculiarities.
    wanted
        Columns to read; by default all. Names that the file lacks are not an error here.

    Raises
    ------
    InputError
        If the file is missing, empty, of an unknown format, truncated or damaged, or needs an
        extra that is not installed.
    """
    file = file or LogFile(path=path.name)
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty")
    suffix = path.suffix.lower()
    if suffix not in _READERS:
        raise InputError(
            f"{path}: unknown format '{suffix}': known are {', '.join(sorted(_READERS))}"
        )
    sha256 = _hash(path)
    if file.sha256 and file.sha256 != sha256:
        raise InputError(
            f"{path}: key 'sha256': the map was written for another file "
            f"({file.sha256[:12]}..., this one is {sha256[:12]}...)"
        )
    kind, reader = _READERS[suffix]
    selection = None if wanted is None else frozenset(wanted)
    try:
        if isinstance(reader, str):
            module = importlib.import_module(f"gripbench.logs.{reader}")
            content = module.read(path, file, selection)
        else:
            content = reader(path, file, selection)
    except GripbenchError:
        raise
    except MemoryError:
        raise InputError(f"{path}: too large for the memory of this machine") from None
    except Exception as error:  # a damaged file may fail anywhere in a format's library
        lines = str(error).strip().splitlines()
        reason = lines[0] if lines else type(error).__name__
        raise InputError(
            f"{path}: cannot be read as {kind}, it may be truncated or damaged ({reason[:200]})"
        ) from None
    return Log(path, content.columns, tuple(content.names), sha256, tuple(content.notes))


def log_of_frame(frame: pd.DataFrame, name: str = "frame") -> Log:
    """Return a frame as a log.

    Raises
    ------
    InputError
        If the frame is empty or names a column twice.
    """
    names = [str(column) for column in frame.columns]
    if not names or not len(frame):
        raise InputError(f"{name}: the frame is empty")
    _refuse_twins(Path(name), names)
    columns = {
        column: LogColumn(_as_values(frame.iloc[:, index])) for index, column in enumerate(names)
    }
    return Log(Path(name), columns, tuple(names))


def optional(module: str, purpose: str) -> ModuleType:
    """Import a module of the extra `logs`.

    Raises
    ------
    InputError
        If it is not installed; the message says how to get it.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        raise InputError(
            f"{purpose} needs {module.partition('.')[0]}, which is not installed: "
            "pip install 'gripbench[logs]'"
        ) from None


@dataclass
class Content:
    """What a reader found: the columns that were asked for, and the names of all."""

    columns: dict[str, LogColumn] = field(default_factory=dict)
    names: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def _read_csv(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    names, delimiter = _csv_header(path, file.delimiter)
    _refuse_twins(path, names)
    selected = [name for name in names if wanted is None or name in wanted]
    try:
        table = pa.csv.read_csv(
            path,
            parse_options=pa.csv.ParseOptions(delimiter=delimiter),
            read_options=pa.csv.ReadOptions(column_names=names, skip_rows=1),
            convert_options=pa.csv.ConvertOptions(
                include_columns=selected,
                decimal_point=file.decimal,
                timestamp_parsers=["gripbench reads times itself"],
            ),
        )
    except pa.ArrowInvalid as error:
        raise InputError(f"{path}: {_csv_fault(str(error), file, delimiter)}") from None
    if table.num_rows == 0:
        raise InputError(f"{path}: the file has a header but no rows")
    content = Content(names=names)
    for name in selected:
        content.columns[name] = LogColumn(_as_values(table.column(name).to_pandas()))
    with path.open("rb") as handle:
        handle.seek(-1, 2)
        if handle.read(1) not in (b"\n", b"\r"):
            content.notes.append("the last line has no line end: the file may be cut off")
    return content


def _csv_header(path: Path, delimiter: str) -> tuple[list[str], str]:
    try:
        with path.open(encoding="utf-8-sig", newline="") as handle:
            line = handle.readline(1_000_000)
    except UnicodeDecodeError:
        raise InputError(
            f"{path}: the header is not UTF-8 text; convert the file to UTF-8"
        ) from None
    if not delimiter:
        delimiter = max(",;\t|", key=line.count)
    names = [name.strip() for name in next(csv.reader([line], delimiter=delimiter), [])]
    if names and all(_is_number(name) for name in names):
        raise InputError(f"{path}: the first line holds numbers; it must name the columns")
    if not any(names):
        raise InputError(f"{path}: the first line is blank; it must name the columns")
    return names, delimiter


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _csv_fault(message: str, file: LogFile, delimiter: str) -> str:
    found = re.search(r"Expected (\d+) columns, got (\d+)", message)
    if found:
        expected, got = int(found.group(1)), int(found.group(2))
        row = re.search(r"Row #(\d+)", message)
        where = f"row {int(row.group(1)) - 1}" if row else "a row"
        hint = "the file may be cut off"
        if got > expected and delimiter == "," and file.decimal == ".":
            hint = "decimal commas between commas cannot be told apart: write points or semicolons"
        return f"{where} has {got} values, the header names {expected}: {hint}"
    return f"not valid CSV: {message.splitlines()[0][:200]}"


def _read_parquet(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    with pa.parquet.ParquetFile(path) as source:
        names = list(source.schema_arrow.names)
        _refuse_twins(path, names)
        selected = [name for name in names if wanted is None or name in wanted]
        table = source.read(columns=selected)
    if table.num_rows == 0:
        raise InputError(f"{path}: the file has no rows")
    content = Content(names=names)
    for name in selected:
        content.columns[name] = LogColumn(_as_values(table.column(name).to_pandas()))
    return content


def _as_values(series: pd.Series[Any]) -> npt.NDArray[Any]:
    if pd.api.types.is_bool_dtype(series.dtype) or pd.api.types.is_numeric_dtype(series.dtype):
        if pd.api.types.is_complex_dtype(series.dtype):
            return series.astype(str).to_numpy(dtype=object)
        return series.to_numpy(dtype=np.float64, na_value=np.nan)
    if isinstance(series.dtype, pd.DatetimeTZDtype) or series.dtype.kind == "M":
        text = series.map(lambda moment: moment.isoformat(), na_action="ignore")
        return text.astype(object).to_numpy()
    values = series.astype(object).to_numpy()
    filled = values[~pd.isna(values)]
    if not len(filled):
        return np.full(len(values), np.nan)
    return values


def _text_fault(column: LogColumn) -> str:
    filled = [str(value) for value in column.values[~pd.isna(column.values)]]
    odd = next((text for text in filled if not _is_point_number(text)), filled[0])
    if re.fullmatch(r"\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*", odd):
        return f"has decimal commas ('{odd}'): say decimal = \",\" in the map"
    return f"holds text ('{odd[:40]}') where numbers belong"


def _is_point_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _refuse_twins(path: Path, names: list[str]) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise InputError(f"{path}: two columns are called '{name}'")
        seen.add(name)


def _hash(path: Path) -> str:
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


_READERS: Mapping[str, tuple[str, Any]] = {
    ".csv": ("CSV", _read_csv),
    ".txt": ("CSV", _read_csv),
    ".tsv": ("CSV", _read_csv),
    ".parquet": ("Parquet", _read_parquet),
    ".mat": ("MATLAB", "matlab_files"),
    ".mf4": ("MDF4", "mdf_files"),
    ".blf": ("a CAN trace", "can_traces"),
    ".asc": ("a CAN trace", "can_traces"),
}
"""Name of the format and its reader by suffix; a text is the module that has it."""
