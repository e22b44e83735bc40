"""Write a recording as a log, in any format that the import reads, with the map that reads it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.io import savemat

from gripbench.envs.recordings import Recording
from gripbench.envs.signals import NEW, signal
from gripbench.errors import InputError
from gripbench.logs.mapping.channel_map import ChannelMap
from gripbench.logs.readers.log import optional
from gripbench.writing import being_written

_TRUTH = "truth_"


def export_recording(recording: Recording, path: Path) -> ChannelMap:
    """Write observations and truth as columns of one log.

    Parameters
    ----------
    recording
        What to write.
    path
        The file; `.csv`, `.parquet`, `.mat` or `.mf4` choose the format.

    Returns
    -------
    The map that imports the file again; the vehicle is not part of it.

    Raises
    ------
    InputError
        If the format is not one of these or needs an extra.
    """
    columns = _columns(recording)
    suffix = path.suffix.lower()
    if suffix not in _WRITERS:
        known = ", ".join(_WRITERS)
        raise InputError(f"{path}: unknown format '{suffix}': known are {known}")
    with being_written(path) as temporary:
        _WRITERS[suffix](columns, temporary)
    return _map_of(recording, columns)


Columns = dict[str, npt.NDArray[np.float64]]


def _write_csv(columns: Columns, path: Path) -> None:
    pd.DataFrame(columns).to_csv(path, index=False)  # shortest digits that read back the same


def _write_parquet(columns: Columns, path: Path) -> None:
    pd.DataFrame(columns).to_parquet(path, index=False)


def _write_mat(columns: Columns, path: Path) -> None:
    savemat(path, columns, oned_as="column", do_compression=True, long_field_names=True)


def _columns(recording: Recording) -> Columns:
    seen = recording.observations
    names = seen.dtype.names or ()
    columns = {name: np.ascontiguousarray(seen[name]) for name in names}
    for name in recording.truth.dtype.names or ():
        if name != "time" and not name.endswith(NEW):
            columns[_TRUTH + name] = np.ascontiguousarray(recording.truth[name])
    return columns


def _write_mdf(columns: Columns, path: Path) -> None:
    asammdf = optional("asammdf", "an MDF4 file")
    times = columns["time"]
    mdf: Any = asammdf.MDF(version="4.10")
    try:
        mdf.append(
            [
                asammdf.Signal(
                    values, times, name=name, unit=signal(name.removeprefix(_TRUTH)).unit
                )
                for name, values in columns.items()
                if name != "time"
            ]
        )
        mdf.save(path, overwrite=True)
    finally:
        mdf.close()


_WRITERS = {
    ".csv": _write_csv,
    ".mat": _write_mat,
    ".mf4": _write_mdf,
    ".parquet": _write_parquet,
}
"""Writers by suffix: columns and a path in, a file out."""


def _map_of(recording: Recording, columns: dict[str, npt.NDArray[np.float64]]) -> ChannelMap:
    channels: dict[str, dict[str, Any]] = {}
    reference: dict[str, dict[str, Any]] = {}
    for name in columns:
        if name == "time" or name.endswith(NEW):
            continue
        plain = name.removeprefix(_TRUTH)
        entry: dict[str, Any] = {"column": name, "unit": signal(plain).unit}
        if name + NEW in columns:
            entry["new_where"] = name + NEW
        (reference if name.startswith(_TRUTH) else channels)[plain] = entry
    return ChannelMap.model_validate(
        {
            "name": recording.scenario,
            "time": {"column": "time", "unit": "s"},
            "channels": channels,
            "reference": reference,
            "score_from": recording.score_from,
            "windows": {"from_start": True, **recording.windows},
        }
    )
