"""Keep imported recordings: Parquet for the samples, one JSON file for all that is said of them."""

from __future__ import annotations

import json
import shutil
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet

from gripbench.envs.recordings import Bounds, Recording
from gripbench.envs.signals import record_type
from gripbench.envs.vehicles import CarOnPaper
from gripbench.errors import GripbenchError, InputError
from gripbench.logs.importing import ImportedLog, Provenance
from gripbench.logs.quality.report import Finding, QualityReport

SCHEMA = 1
"""Version of the layout; a later version keeps reading the earlier ones."""

_ABOUT = "recording.json"


def store(imported: ImportedLog, folder: Path) -> Path:
    """Write an imported log to a folder, which appears complete or not at all.

    Parameters
    ----------
    imported
        What `import_log` returned.
    folder
        Where; an earlier import there is replaced.

    Returns
    -------
    The folder.

    Raises
    ------
    InputError
        If the folder holds something else, or cannot be written.
    """
    if folder.exists() and not (folder / _ABOUT).is_file() and any(folder.iterdir()):
        raise InputError(f"{folder}: holds something other than a recording; choose another folder")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}-") as name:
            fresh = Path(name) / "recording"
            fresh.mkdir()
            for recording in imported.recordings:
                _write(recording.observations, fresh / _observations(recording.seed))
                _write(recording.truth, fresh / _truth(recording.seed))
            about = json.dumps(_description(imported), indent=1, allow_nan=True)
            (fresh / _ABOUT).write_text(about + "\n", encoding="utf-8")
            if folder.exists():
                shutil.rmtree(folder)
            fresh.rename(folder)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error})") from None
    return folder


def load(folder: Path) -> ImportedLog:
    """Read what `store` wrote.

    Raises
    ------
    InputError
        If the folder is no recording, was written by a later version, or is damaged.
    """
    path = folder / _ABOUT
    try:
        about = json.loads(path.read_text(encoding="utf-8"))
        if about["schema"] > SCHEMA:
            raise InputError(f"{path}: key 'schema': written by a later version of gripbench")
        recordings = tuple(_recording(folder, about, run) for run in about["runs"])
        findings = tuple(Finding(**record) for record in about["report"])
        return ImportedLog(recordings, QualityReport(findings), Provenance(**about["provenance"]))
    except GripbenchError:
        raise
    except FileNotFoundError as error:
        missing = error.filename or str(error)
        raise InputError(f"{folder}: damaged recording, a file is missing ({missing})") from None
    except (OSError, ValueError, KeyError, TypeError, pa.ArrowException) as error:
        raise InputError(f"{folder}: damaged recording ({str(error)[:200]})") from None


def _observations(run: int) -> str:
    return f"observations-{run}.parquet"


def _truth(run: int) -> str:
    return f"truth-{run}.parquet"


def _description(imported: ImportedLog) -> dict[str, Any]:
    return {
        "schema": SCHEMA,
        "provenance": asdict(imported.provenance),
        "runs": [
            {
                "scenario": recording.scenario,
                "seed": recording.seed,
                "vehicle": recording.vehicle,
                "score_from": recording.score_from,
                "termination": recording.termination,
                "notes": recording.notes,
                "windows": recording.windows,
                "bounds": [asdict(bound) for bound in recording.bounds],
            }
            for recording in imported.recordings
        ],
        "report": imported.report.records(),
    }


def _recording(folder: Path, about: dict[str, Any], run: dict[str, Any]) -> Recording:
    return Recording(
        scenario=run["scenario"],
        seed=run["seed"],
        vehicle=CarOnPaper(run["vehicle"]),
        observations=_read(folder / _observations(run["seed"])),
        truth=_read(folder / _truth(run["seed"])),
        score_from=run["score_from"],
        termination=run["termination"],
        notes=run["notes"],
        windows={
            name: tuple((start, end) for start, end in intervals)
            for name, intervals in run["windows"].items()
        },
        bounds=tuple(Bounds(**bound) for bound in run["bounds"]),
    )


def _write(records: npt.NDArray[Any], path: Path) -> None:
    names = records.dtype.names or ()
    columns = {name: np.ascontiguousarray(records[name]) for name in names}
    pa.parquet.write_table(pa.table(columns), path, compression="zstd")


def _read(path: Path) -> npt.NDArray[Any]:
    with pa.parquet.ParquetFile(path) as source:
        table = source.read()
    records = np.empty(table.num_rows, record_type(table.column_names))
    for name in table.column_names:
        records[name] = table.column(name).to_numpy()
    return records
