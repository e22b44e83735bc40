"""Read the numeric vectors of an HDF5 file through h5py; runs in a process of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gripbench.errors import InputError
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers.log import Content, LogColumn, optional

LIBRARIES = ("h5py",)


def read(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Read every numeric vector, called `group/name`; a column of a matrix `name(:,1)`.

    Raises
    ------
    InputError
        If the file holds no numeric vector or needs h5py.
    """
    h5py = optional("h5py", "an HDF5 file")
    content = Content()

    def add(name: str, values: Any, unit: str) -> None:
        content.names.append(name)
        if wanted is None or name in wanted:
            content.columns[name] = LogColumn(np.asarray(values, dtype=np.float64), unit=unit)

    def visit(name: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset):
            return
        unit = item.attrs.get("units", item.attrs.get("unit", ""))
        unit = unit.decode() if isinstance(unit, bytes) else str(unit)
        if item.dtype.names:
            for part in item.dtype.names:
                if item.dtype[part].kind in "fiub" and not item.dtype[part].shape:
                    add(f"{name}/{part}", item[part], "")
        elif item.dtype.kind in "fiub" and item.ndim == 1 and item.size > 1:
            add(name, item[()], unit)
        elif item.dtype.kind in "fiub" and item.ndim == 2 and item.size > 1:
            table = item[()]
            if 1 in table.shape:
                add(name, table.ravel(), unit)
            else:
                for index in range(table.shape[1]):
                    add(f"{name}(:,{index + 1})", table[:, index], unit)

    with h5py.File(path, "r") as source:
        source.visititems(visit)
    if not content.names:
        raise InputError(f"{path}: holds no numeric vector of more than one sample")
    return content
