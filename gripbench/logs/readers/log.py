"""What every reader makes of a file: a `Log` of named columns, each with its unit and times."""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from gripbench.errors import InputError, nearest


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


@dataclass
class Content:
    """What a reader found.

    Attributes
    ----------
    columns
        The columns that were asked for, by name.
    names
        Every column of the file.
    notes
        What a reader should know about the file, one sentence each.
    twins
        Names that several columns share, each with the unambiguous names of these.
    suggestions
        Keys of the map that the file itself tells, such as `decimal`, as TOML values.
    """

    columns: dict[str, LogColumn] = field(default_factory=dict)
    names: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    twins: dict[str, tuple[str, ...]] = field(default_factory=dict)
    suggestions: dict[str, str] = field(default_factory=dict)


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
    notes, twins, suggestions
        As in `Content`.
    """

    path: Path
    columns: dict[str, LogColumn]
    names: tuple[str, ...]
    sha256: str = ""
    notes: tuple[str, ...] = ()
    twins: dict[str, tuple[str, ...]] = field(default_factory=dict)
    suggestions: dict[str, str] = field(default_factory=dict)

    def column(self, name: str, key: str) -> LogColumn:
        """Return a column.

        Raises
        ------
        InputError
            If the log has none of that name, or several; `key` is what asked for it.
        """
        if name in self.columns:
            return self.columns[name]
        asked = f"{self.path}: key '{key}': "
        if name in self.twins:
            several = self.twins[name]
            count = "two" if len(several) == 2 else str(len(several))
            shown = ", ".join(f"'{one}'" for one in several[:6])
            raise InputError(f"{asked}{count} columns are called '{name}': write one of {shown}")
        hint = nearest(name, self.names)
        if self.names and all(one.isdecimal() for one in self.names):
            hint = (
                "no line of the file names its columns (a header must name the columns); "
                f"without one they are called by number, '1' to '{len(self.names)}'"
            )
        raise InputError(f"{asked}the log has no column '{name}': {hint}")

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


def log_of_frame(frame: pd.DataFrame, name: str = "frame") -> Log:
    """Return a frame as a log.

    Raises
    ------
    InputError
        If the frame is empty.
    """
    names = [str(column) for column in frame.columns]
    if not names or not len(frame):
        raise InputError(f"{name}: the frame is empty")
    unique, twins = distinct(names)
    columns = {
        column: LogColumn(as_values(frame.iloc[:, index])) for index, column in enumerate(unique)
    }
    return Log(Path(name), columns, tuple(unique), twins=twins)


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


def distinct(names: Iterable[str]) -> tuple[list[str], dict[str, tuple[str, ...]]]:
    """Return the names made distinct, and which stand for one name that came several times.

    Examples
    --------
    >>> distinct(["t", "v", "v"])
    (['t', 'v#1', 'v#2'], {'v': ('v#1', 'v#2')})
    """
    given = list(names)
    known = set(given)
    counts: dict[str, int] = {}
    unique, twins = [], dict[str, tuple[str, ...]]()
    for name in given:
        if given.count(name) == 1:
            unique.append(name)
            continue
        counts[name] = counts.get(name, 0) + 1
        fresh = f"{name}#{counts[name]}"
        while fresh in known:  # the file itself has a column of that name
            fresh += "'"
        unique.append(fresh)
        twins[name] = (*twins.get(name, ()), fresh)
    return unique, twins


def as_values(series: pd.Series[Any]) -> npt.NDArray[Any]:
    """Return a frame's column as float64 with NaN for blanks, or as text."""
    if pd.api.types.is_bool_dtype(series.dtype) or pd.api.types.is_numeric_dtype(series.dtype):
        if pd.api.types.is_complex_dtype(series.dtype):
            return series.astype(str).to_numpy(dtype=object)
        return series.to_numpy(dtype=np.float64, na_value=np.nan)
    if isinstance(series.dtype, pd.DatetimeTZDtype) or series.dtype.kind == "M":
        text = series.map(lambda moment: moment.isoformat(), na_action="ignore")
        return text.astype(object).to_numpy()
    if series.dtype.kind == "m":
        return series.dt.total_seconds().to_numpy(dtype=np.float64)
    values = series.astype(object).to_numpy()
    filled = values[~pd.isna(values)]
    if not len(filled):
        return np.full(len(values), np.nan)
    if all(isinstance(value, (int, float)) for value in filled):
        return np.array([np.nan if pd.isna(v) else float(v) for v in values])
    return np.array([None if pd.isna(v) else str(v) for v in values], dtype=object)


def _text_fault(column: LogColumn) -> str:
    filled = [str(value) for value in column.values[~pd.isna(column.values)]]
    odd = next((text for text in filled if not _is_point_number(text)), filled[0])
    if re.fullmatch(r"\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*", odd):
        return f"has decimal commas ('{odd}'): say decimal = \",\" in the map"
    return f"holds text ({odd[:40]!r}) where numbers belong"


def _is_point_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
