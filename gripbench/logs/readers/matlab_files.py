"""Read MATLAB files: up to v7 through scipy, v7.3 and tables through mat-io; in an own process."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.io import loadmat

from gripbench.errors import InputError
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers.log import Content, LogColumn, as_values, optional

LIBRARIES = ("scipy.io", "h5py", "matio", "pandas")

_TIME = re.compile(r"^(t|time|times|timestamps?)$", re.I)
_DATA = re.compile(r"^(data|values?|samples|signal|y)$", re.I)
_NAME = re.compile(r"^(name|label|signalname|blockname|channel)$", re.I)


def read(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Read the numeric vectors of a MATLAB file.

    A field of a structure is called `structure.field`, a column of a matrix `matrix(:,1)`, or as
    a list of as many names in the file says; an element of an array of structures that has a name
    is called by it. A structure with times and data is one channel with its own times.

    Raises
    ------
    InputError
        If the file holds no numeric vector.
    """
    found: dict[str, LogColumn] = {}
    for name, value in _variables(path).items():
        if not name.startswith("__"):
            _collect(name, value, found)
    if not found:
        raise InputError(f"{path}: holds no numeric vector of more than one sample")
    content = Content(names=list(found))
    for name, column in found.items():
        if wanted is None or name in wanted:
            content.columns[name] = column
    return content


def _variables(path: Path) -> dict[str, Any]:
    try:
        variables = loadmat(path, simplify_cells=True)
    except NotImplementedError:  # scipy's way to say v7.3
        optional("h5py", "a MATLAB file of version 7.3")
        return _named_matrices(_read_v73(path))
    opaque = any(type(value).__name__ == "MatlabOpaque" for value in variables.values())
    if opaque or "__function_workspace__" in variables:
        matio = optional("matio", "a MATLAB table")
        return dict(matio.load_from_mat(str(path)))
    return _named_matrices(variables)


def _named_matrices(variables: dict[str, Any]) -> dict[str, Any]:
    """Split matrices whose columns a list of as many words names."""
    lists = [words for value in variables.values() if (words := _words(value))]
    split: dict[str, Any] = {}
    for name, value in variables.items():
        array = np.asarray(value) if isinstance(value, np.ndarray) else None
        fitting = [
            words
            for words in lists
            if array is not None
            and array.ndim == 2
            and array.shape[1] == len(words) > 1
            and array.dtype.kind in "fiub"
            and len(set(words)) == len(words)
        ]
        if array is not None and len(fitting) == 1 and not set(fitting[0]) & set(split):
            split |= {word: array[:, index] for index, word in enumerate(fitting[0])}
        else:
            split[name] = value
    return split


def _words(value: Any) -> list[str]:
    if isinstance(value, (list, np.ndarray)) and len(np.shape(value)) == 1:
        words = list(value)
        if words and all(isinstance(word, str) for word in words):
            return [word.strip() for word in words]
    return []


def _collect(name: str, value: Any, found: dict[str, LogColumn], clock: Any = None) -> None:
    if isinstance(value, pd.DataFrame):
        _collect_table(name, value, found)
        return
    if isinstance(value, dict):
        own = _clock(value)
        channel = _channel(value)
        if channel is not None and _vector(channel) is not None:
            times = own if own is not None else clock
            data = _vector(channel)
            assert data is not None
            unit = next(
                (
                    v
                    for k, v in value.items()
                    if k.lower() in ("unit", "units") and isinstance(v, str)
                ),
                "",
            )
            fits = times is not None and len(times) == len(data)
            if fits:
                found[_free(_own_name(value) or name, found)] = LogColumn(data, times, unit)
                return
        for key, part in value.items():
            _collect(f"{name}.{key}", part, found, own if own is not None else clock)
        return
    if isinstance(value, (list, tuple)) or (
        isinstance(value, np.ndarray) and value.dtype == object
    ):
        for index, part in enumerate(np.ravel(np.asarray(value, dtype=object)), start=1):
            if isinstance(part, (dict, pd.DataFrame)):
                _collect(f"{name}({index})", part, found, clock)
        return
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        return
    array = array.squeeze()
    if array.ndim == 2:
        for index in range(array.shape[1]):
            found[f"{name}(:,{index + 1})"] = LogColumn(array[:, index].astype(np.float64))
    elif array.ndim == 1 and len(array) > 1:
        found[name] = LogColumn(array.astype(np.float64))


def _collect_table(name: str, frame: pd.DataFrame, found: dict[str, LogColumn]) -> None:
    """Add the columns of a table; the row times of a timetable are each column's times."""
    times = None
    index = frame.index
    if isinstance(index, pd.TimedeltaIndex):
        times = index.total_seconds().to_numpy(dtype=np.float64)
    elif isinstance(index, pd.DatetimeIndex):
        nanoseconds = index.as_unit("ns").astype("int64").to_numpy()
        times = nanoseconds // 10**9 + (nanoseconds % 10**9) * 1e-9
    units = frame.attrs.get("VariableUnits", {})
    for order, column in enumerate(frame.columns):
        values = as_values(frame.iloc[:, order])
        unit = units.get(column, "") if isinstance(units, dict) else ""
        found[f"{name}.{column}"] = LogColumn(values, times, str(unit))


def _clock(value: dict[str, Any]) -> Any:
    for key, part in value.items():
        if _TIME.match(key):
            return _vector(part)
    return None


def _channel(value: dict[str, Any]) -> Any:
    return next((part for key, part in value.items() if _DATA.match(key)), None)


def _own_name(value: dict[str, Any]) -> str:
    return next(
        (part.strip() for key, part in value.items()
         if _NAME.match(key) and isinstance(part, str) and part.strip()),
        "",
    )  # fmt: skip


def _free(name: str, found: dict[str, LogColumn]) -> str:
    fresh, count = name, 1
    while fresh in found:
        count += 1
        fresh = f"{name}#{count}"
    return fresh


def _vector(value: Any) -> Any:
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        return None
    array = array.squeeze()
    return array.astype(np.float64) if array.ndim == 1 and len(array) > 1 else None


def _read_v73(path: Path) -> dict[str, Any]:
    """Return the variables of a v7.3 file; through mat-io where it holds objects."""
    h5py = optional("h5py", "a MATLAB file of version 7.3")
    with h5py.File(path, "r") as source:
        if "#subsystem#" in source:
            matio = optional("matio", "a MATLAB table")
            return dict(matio.load_from_mat(str(path)))
        return {
            name: _of_hdf5(h5py, source, item)
            for name, item in source.items()
            if not name.startswith("#")
        }


def _of_hdf5(h5py: Any, source: Any, item: Any) -> Any:
    if isinstance(item, h5py.Group):
        fields = {name: _of_hdf5(h5py, source, part) for name, part in item.items()}
        lengths = {
            len(v) if isinstance(v, np.ndarray) and v.dtype.kind == "O" else -1
            for v in fields.values()
        }
        if len(lengths) == 1 and lengths != {-1}:  # an array of structures
            return [
                {name: values[index] for name, values in fields.items()}
                for index in range(lengths.pop())
            ]
        return fields
    kind = item.attrs.get("MATLAB_class", b"")
    if "MATLAB_empty" in item.attrs:
        return None
    if kind == b"char":
        return "".join(chr(code) for code in np.asarray(item).T.ravel())
    if item.dtype == h5py.ref_dtype:  # a cell, or a field of an array of structures
        parts = [_of_hdf5(h5py, source, source[one]) for one in np.asarray(item).T.ravel()]
        return np.array([*parts, None], dtype=object)[:-1]
    if item.dtype.kind not in "fiub":
        return None
    # MATLAB stores columns first, so HDF5 sees every matrix transposed.
    return np.asarray(item).T
