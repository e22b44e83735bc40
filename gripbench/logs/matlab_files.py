"""Read MATLAB files: up to v7 through scipy, v7.3 (HDF5) through h5py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.io import loadmat

from gripbench.errors import InputError
from gripbench.logs.channel_map import LogFile
from gripbench.logs.readers import Content, LogColumn, optional


def read(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Read the numeric vectors of a MATLAB file.

    A field of a structure is called `structure.field`, a column of a matrix `matrix(:,1)`.

    Raises
    ------
    InputError
        If the file holds no numeric vector.
    """
    try:
        variables = loadmat(path, simplify_cells=True)
    except NotImplementedError:  # scipy's way to say v7.3
        variables = _read_v73(path)
    found: dict[str, npt.NDArray[np.float64]] = {}
    for name, value in variables.items():
        if not name.startswith("__"):
            _collect(name, value, found)
    if not found:
        raise InputError(f"{path}: holds no numeric vector of more than one sample")
    content = Content(names=list(found))
    for name, values in found.items():
        if wanted is None or name in wanted:
            content.columns[name] = LogColumn(values)
    return content


def _collect(name: str, value: Any, found: dict[str, npt.NDArray[np.float64]]) -> None:
    if isinstance(value, dict):
        for key, part in value.items():
            _collect(f"{name}.{key}", part, found)
        return
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        return
    array = array.squeeze()
    if array.ndim == 2:
        for index in range(array.shape[1]):
            found[f"{name}(:,{index + 1})"] = array[:, index].astype(np.float64)
    elif array.ndim <= 1:
        found[name] = np.atleast_1d(array).astype(np.float64)


def _read_v73(path: Path) -> dict[str, Any]:
    h5py = optional("h5py", "a MATLAB file of version 7.3")
    variables: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        if name.startswith("#") or not isinstance(item, h5py.Dataset):
            return
        if (
            item.attrs.get("MATLAB_class", b"") in (b"char", b"cell")
            or item.dtype.kind not in "fiub"
        ):
            return
        if "MATLAB_empty" in item.attrs:
            return
        # MATLAB stores columns first, so HDF5 sees every matrix transposed.
        variables[name.replace("/", ".")] = np.asarray(item).T

    with h5py.File(path, "r") as source:
        source.visititems(visit)
    return variables
