"""Estimates that were computed elsewhere in, rows beside all others out.

A folder of drives, as `running.exporting` writes them, has come back with a file of estimates in
each. All of it is read and scored before the first row is stored; a mistake anywhere stores
nothing. Nobody can say of such estimates that they are causal, nor how long they took.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.catalogue.declarations import Declaration, declaration_from
from gripbench.bench.catalogue.registry import method_names
from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.running.execution import missing
from gripbench.bench.running.exporting import FORMATS, Drive, digest_of_samples, read_records
from gripbench.bench.running.fingerprints import salt_of, versions, world_digest
from gripbench.bench.running.recorded_scenarios import (
    RecordedScenario,
    judged,
    log_window,
    recording_of,
)
from gripbench.bench.running.rows import Row, Status
from gripbench.bench.running.store import Store
from gripbench.bench.scoring.scoring import (
    DivergedError,
    EstimateError,
    Scores,
    score,
    targets_of,
)
from gripbench.envs.recordings import Recording
from gripbench.envs.scenarios import Scenario
from gripbench.envs.signals import INNOVATION, SIGNALS, VARIANCE, record_type, signal
from gripbench.errors import InputError, unknown
from gripbench.methods.outputs import fields_of, quantile_levels
from gripbench.methods.samples import is_given
from gripbench.sources import digest

Floats = npt.NDArray[np.float64]

_NAME = re.compile(r"[0-9a-f]{16}", re.ASCII)


@dataclass(frozen=True)
class Estimates:
    """Estimates of one drive.

    Attributes
    ----------
    path
        The file that they came from.
    columns
        Each of shape (n,), `time` among them.
    """

    path: Path
    columns: dict[str, Floats]

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the estimates, then of their variances, quantiles and of innovations."""
        return fields_of(**self.declared)

    @property
    def declared(self) -> dict[str, Any]:
        """What the columns declare, see `gripbench.methods.outputs`."""
        names = sorted(name for name in self.columns if name != "time")
        estimates = [name for name in names if name in SIGNALS]
        levels = {name: tuple(quantile_levels(name, names).values()) for name in estimates}
        return {
            "estimates": tuple(estimates),
            "variances": tuple(name for name in estimates if name + VARIANCE in names),
            "quantiles": {name: given for name, given in levels.items() if given},
            "innovations": tuple(
                name.removesuffix(INNOVATION) for name in names if name.endswith(INNOVATION)
            ),
        }


def submit(
    folder: Path, name: str, reads: Iterable[str], results: Path, title: str = ""
) -> list[Row]:
    """Score the estimates in a folder and store a row for each of its drives.

    Parameters
    ----------
    folder
        Holds a folder for each drive of one export.
    name
        What to call the method.
    reads
        Channels that it read.
    results
        The results folder that the drives were exported for.
    title
        Name as the literature gives it.

    Returns
    -------
    The rows that were stored, by scenario and seed.

    Raises
    ------
    InputError
        If something cannot be scored; then nothing is stored.
    """
    channels = _checked_reads(reads)
    drives = _drives(folder, results)
    scenarios = {drive.scenario: find_scenario(drive.scenario) for drive in drives.values()}
    worlds = {place: world_digest(scenario) for place, scenario in scenarios.items()}
    store, rows = Store(results), []
    outputs: tuple[str, ...] = ()
    lacking: list[tuple[Scenario, Drive, Recording]] = []
    declaration: Declaration | None = None
    for key, drive in drives.items():
        scenario = scenarios[drive.scenario]
        recording = recording_of(scenario, drive.seed)
        same = digest_of_samples(recording.observations) == drive.observations
        if worlds[drive.scenario] != drive.world or not same:
            raise InputError(
                f"{folder / key}: the scenario, gripbench, its packages or GRIPBENCH_SALT have "
                "changed since this drive was exported; export again"
            )
        present = recording.observations.dtype.names or ()
        if not all(is_given(channel, present) for channel in channels):
            lacking.append((scenario, drive, recording))
            continue
        found = read_estimates(folder / key)
        _check_times(found, recording)
        if declaration is None:
            outputs = found.outputs
            declaration = _declaration(name, title, channels, found)
        elif found.outputs != outputs:
            raise InputError(
                f"{found.path}: has the estimates {', '.join(found.outputs)}, another drive has "
                f"{', '.join(outputs)}; give the same in all"
            )
        result = _scored(found, declaration, recording, scenario)
        rows.append(_row(scenario, drive, declaration, result, recording))
    if declaration is None:
        raise InputError(f"{folder}: no drive gives all of {', '.join(channels)}")
    for scenario, drive, recording in lacking:
        reason = missing(declaration, recording.vehicle, recording.observations.dtype.names or ())
        targets = targets_of(declaration.estimates, recording)
        result = _Result("skipped", reason, targets)
        rows.append(_row(scenario, drive, declaration, result, recording))
    for row in rows:
        before = store.read(row.scenario, row.label, row.seed)
        if before is not None and not before.computed_outside:
            raise InputError(
                f"{results}: holds rows of a method '{name}' that was run here; choose another "
                "--name"
            )
    for row in rows:
        store.write(row)
    return sorted(rows, key=lambda row: (row.scenario, row.seed))


def _checked_reads(reads: Iterable[str]) -> tuple[str, ...]:
    channels = tuple(dict.fromkeys(name.strip() for name in reads if name.strip()))
    for name in channels:
        if name == "time" or not is_given(name, SIGNALS):
            raise unknown("channel in --reads", name, set(SIGNALS) - {"time"})
    return channels


def _declaration(name: str, title: str, channels: tuple[str, ...], found: Estimates) -> Declaration:
    if name in method_names():
        raise InputError(f"--name '{name}' is that of a method that is known here; give another")
    outputs = found.outputs
    for column in found.columns:
        if column != "time" and column not in outputs:
            plain = signal(column).description
            raise InputError(
                f"{found.path}: column '{column}' ({plain}) stands without its estimate"
            )
    for column in outputs:
        if column not in found.columns:
            raise InputError(f"{found.path}: has no column '{column}'")
    if not found.declared["estimates"]:
        raise InputError(f"{found.path}: holds no estimate; add a column for each signal")
    given: dict[str, Any] = {
        "name": name, "title": title or None, "sensors": channels, **found.declared,
        "settings": {}, "variant": "",
    }  # fmt: skip
    return declaration_from(given, "--name")


def _drives(folder: Path, results: Path) -> dict[str, Drive]:
    """Return the drives of the export to which the folders belong; all must be there."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; 'gripbench export' writes one")
    present = {path.name for path in folder.iterdir() if path.is_dir()}
    for record in read_records(results):
        if not present & set(record.drives):
            continue
        absent = sorted(set(record.drives) - present)
        if absent:
            raise InputError(
                f"{folder}: {len(absent)} of {len(record.drives)} drives are missing, the first "
                f"is '{absent[0]}'; hand in all of an export"
            )
        foreign = sorted(item for item in present - set(record.drives) if _NAME.fullmatch(item))
        if foreign:
            raise InputError(f"{folder / foreign[0]}: is no drive of this export; remove it")
        return dict(sorted(record.drives.items()))
    raise InputError(
        f"{folder}: holds no drive that was exported for {results}; give the --results of its "
        "export"
    )


def read_estimates(folder: Path) -> Estimates:
    """Return the estimates in the folder of a drive.

    Raises
    ------
    InputError
        If there is no file of them or more than one, it cannot be read, or a column is no signal
        and says nothing of one.
    """
    paths = [path for path in (folder / f"estimates.{kind}" for kind in FORMATS) if path.exists()]
    if len(paths) != 1:
        names = ", ".join(path.name for path in paths)
        kinds = ", ".join(f".{kind}" for kind in FORMATS)
        raise InputError(
            f"{folder}: holds {names}; leave one of them"
            if paths
            else f"{folder}: holds no file 'estimates' ({kinds}); write one"
        )
    path = paths[0]
    try:
        columns = _READERS[path.suffix](path)
    except InputError:
        raise
    except Exception as error:  # of three libraries, each with its own
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: cannot be read: {reason}") from None
    if "time" not in columns:
        raise InputError(f"{path}: has no column 'time'; copy that of the observations")
    for name in columns:
        try:
            signal(name)
        except InputError:
            raise unknown(f"estimate in {path}:", name, SIGNALS) from None
    return Estimates(path, columns)


def _from_csv(path: Path) -> dict[str, Floats]:
    from pyarrow import csv, float64

    with csv.open_csv(path) as reader:
        names = reader.schema.names
    columns = dict.fromkeys(names, float64())
    # strict: a line with too few or too many values, or a word, is an error that names it
    table = csv.read_csv(path, convert_options=csv.ConvertOptions(column_types=columns))
    return _columns_of(path, table)


def _from_parquet(path: Path) -> dict[str, Floats]:
    from pyarrow import parquet

    return _columns_of(path, parquet.read_table(path))


def _columns_of(path: Path, table: Any) -> dict[str, Floats]:
    names = [name.strip() for name in table.column_names]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{path}: has the column '{name}' twice")
    return {
        name: _numbers(path, name, column.to_numpy())
        for name, column in zip(names, table.columns, strict=True)
    }


def _from_mat(path: Path) -> dict[str, Floats]:
    from scipy.io import loadmat

    try:
        content = loadmat(path)
    except NotImplementedError:
        raise InputError(f"{path}: is of MATLAB's version 7.3; save it with '-v7'") from None
    return {
        name: _numbers(path, name, values)
        for name, values in content.items()
        if not name.startswith("__")
    }


_READERS = {".csv": _from_csv, ".parquet": _from_parquet, ".mat": _from_mat}


def _numbers(path: Path, name: str, values: Any) -> Floats:
    found = np.asarray(values)
    if found.dtype.kind not in "iuf" or found.ndim > 2 or found.size != max(found.shape, default=1):
        raise InputError(f"{path}: '{name}' is no column of real numbers")
    return found.astype(np.float64).ravel()


def _check_times(found: Estimates, recording: Recording) -> None:
    """Check that estimates stand where the samples are: one each, at its time."""
    times, given = recording.observations["time"], found.columns["time"]
    for name, values in found.columns.items():
        if len(values) != len(times):
            raise InputError(
                f"{found.path}: '{name}' has {len(values)} values, the drive has {len(times)} "
                "samples; give one a sample"
            )
    step = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    off = ~(np.abs(given - times) <= 0.1 * step) & np.isfinite(times)
    if off.any():
        k = int(np.argmax(off))
        raise InputError(
            f"{found.path}: sample {k + 1} is at time {given[k]:.9g}, in the observations at "
            f"{times[k]:.9g} s; keep their order and write nine digits"
        )


@dataclass(frozen=True)
class _Result:
    status: Status
    reason: str
    targets: tuple[str, ...]
    scores: Mapping[str, Scores] | None = None
    content: str = ""


def _scored(
    found: Estimates, declaration: Declaration, recording: Recording, scenario: Scenario
) -> _Result:
    estimates = np.empty(len(recording.truth), record_type(declaration.outputs))
    for name in declaration.outputs:
        estimates[name] = found.columns[name]
    content = hashlib.sha256(estimates.tobytes()).hexdigest()
    targets = targets_of(declaration.estimates, recording)
    if not targets:
        reason = "the scenario has no truth for any of its estimates"
        return _Result("skipped", reason, targets, content=content)
    if isinstance(scenario, RecordedScenario):
        recording = judged(recording, estimates)
    try:
        scores = score(estimates, declaration.outputs, targets, recording)
    except DivergedError as error:
        return _Result("diverged", str(error), targets, content=content)
    except EstimateError as error:
        raise InputError(f"{found.path}: {error}") from None
    return _Result("ok", "", tuple(scores), scores, content)


def _row(
    scenario: Scenario,
    drive: Drive,
    declaration: Declaration,
    result: _Result,
    recording: Recording,
) -> Row:
    reads, outputs = repr(declaration.sensors), repr(declaration.outputs)
    return Row(
        key=digest(drive.world, "outside", declaration.name, reads, outputs, result.content),
        world=drive.world,
        salt=salt_of(scenario),
        scenario=scenario.name,
        seed=drive.seed,
        method=declaration.name,
        title=declaration.title,
        label=declaration.name,
        sensors=declaration.sensors,
        idealised=declaration.idealised,
        targets=result.targets,
        status=result.status,
        reason=result.reason,
        scores=dict(result.scores or {}),
        sample_period=scenario.sample_time,
        computed_outside=True,
        window=log_window(recording),
        versions=versions(),
    )
