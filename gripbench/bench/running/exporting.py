"""A suite in, a folder of drives out, for methods that run elsewhere: observations, never truth.

Each drive is a folder that is named by a digest of its scenario and seed with a secret, and drives
are written in the order of these names, so that neither tells which drive is which. The secret, and
what `running.submissions` needs to score estimates of them, stay beside the results.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import secrets
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from pydantic import Field

from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.catalogue.suites import load_suite
from gripbench.bench.running.fingerprints import world_digest
from gripbench.bench.running.recorded_scenarios import PREFIX, RecordedScenario, recording_of
from gripbench.configuration import Configuration, parse
from gripbench.envs.recordings import Recording
from gripbench.envs.scenarios import Scenario
from gripbench.envs.signals import NEW, signal
from gripbench.envs.vehicles import VEHICLE_PARAMETERS
from gripbench.errors import InputError, unknown
from gripbench.sources import digest
from gripbench.writing import being_written, check_writable, write_atomically

FORMATS = ("csv", "parquet", "mat")
"""Formats of the files of observations and estimates."""


class Drive(Configuration):
    """What a drive is.

    Attributes
    ----------
    scenario
        As `find_scenario` takes it.
    seed
        Seed, or window of a recording.
    world
        Digest of scenario and scoring when it was exported.
    observations
        Digest of all samples that were written.
    """

    scenario: str
    seed: int = Field(ge=0)
    world: str
    observations: str


class ExportRecord(Configuration):
    """What an export keeps back: the secret of its names, and its drives by name."""

    secret: str
    drives: dict[str, Drive] = Field(min_length=1)


@dataclass(frozen=True)
class Exported:
    """One drive on its way out: where it comes from, its name and its run."""

    place: str
    scenario: Scenario
    seed: int
    name: str


def new_secret() -> str:
    """Return a secret of 256 bits."""
    return secrets.token_hex(32)


def drive_name(secret: str, scenario: str, seed: int) -> str:
    """Return the name of a drive: a keyed digest, 16 hexadecimal digits."""
    text = f"{scenario}\0{seed}".encode()
    return hmac.new(bytes.fromhex(secret), text, hashlib.sha256).hexdigest()[:16]


def _named(suite: str, seeds: range | None, level: int | None, secret: str) -> dict[str, Exported]:
    loaded = load_suite(suite)
    found: dict[str, Exported] = {}
    for given in loaded.names(level):
        scenario = find_scenario(given)
        if isinstance(scenario, RecordedScenario):
            if scenario.absent:
                raise InputError(scenario.absent)
            chosen = range(scenario.runs)
        else:
            chosen = range(loaded.seeds) if seeds is None else seeds
        for seed in chosen:
            name = drive_name(secret, scenario.name, seed)
            found[name] = Exported(_place(given), scenario, seed, name)
    return found


def _place(given: str) -> str:
    """Return a scenario's name, or its file by a path that holds in any working folder."""
    if given.startswith(PREFIX) or ".toml" not in given:
        return given
    path, _, level = given.rpartition(".toml")
    return f"{Path(path + '.toml').resolve()}{level}"


def export_suite(
    suite: str,
    seeds: range | None,
    folder: Path,
    results: Path,
    format_: str = "csv",
    level: int | None = None,
    on_drive: Callable[[int, int], Any] = lambda done, of: None,
) -> int:
    """Write the drives of a suite, and keep beside the results which is which.

    Parameters
    ----------
    suite
        Name or TOML file of a suite.
    seeds
        Seeds of each scenario, by default the suite's; of a recording it is every window.
    level
        Level of the populations; by default the suite's.
    folder
        Where to write; it must be empty, or not be there yet.
    results
        The results folder in which estimates of these drives will become rows.
    format_
        Of the observations, one of `FORMATS`.
    on_drive
        Called after each drive with the number of drives written, and of all.

    Returns
    -------
    Number of drives.

    Raises
    ------
    InputError
        If the suite or format is unknown, or the folder holds something or cannot be written.
    """
    if format_ not in FORMATS:
        raise unknown("format", format_, FORMATS)
    secret = new_secret()
    planned = _named(suite, seeds, level, secret)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder}: is there already and not an empty folder; choose another")
    kept = results / "exports" / f"{digest(secret)[:16]}.json"
    for path in (folder / "README.md", kept):
        check_writable(path)
    drives = {}
    worlds = {item.scenario.name: world_digest(item.scenario) for item in planned.values()}
    for done, (name, item) in enumerate(sorted(planned.items()), 1):
        recording = recording_of(item.scenario, item.seed)
        write_drive(recording, folder / name, format_)
        drives[name] = Drive(
            scenario=item.place,
            seed=item.seed,
            world=worlds[item.scenario.name],
            observations=digest_of_samples(recording.observations),
        )
        on_drive(done, len(planned))
    write_atomically(folder / "README.md", _README.format(count=len(drives), format=format_))
    record = ExportRecord(secret=secret, drives=drives)
    write_atomically(kept, record.model_dump_json(indent=1) + "\n")
    kept.chmod(0o600)
    return len(drives)


def read_records(results: Path) -> Iterator[ExportRecord]:
    """Yield what the exports of a results folder kept back.

    Raises
    ------
    InputError
        If a file is no such record.
    """
    for path in sorted((results / "exports").glob("*.json")):
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: cannot be read: {error}; remove it") from None
        yield parse(ExportRecord, content, path)


def digest_of_samples(observations: npt.NDArray[Any]) -> str:
    """Return the digest of all that an array of samples holds."""
    content = hashlib.sha256(np.ascontiguousarray(observations).tobytes()).hexdigest()
    return digest(repr(observations.dtype.names), content)


def write_drive(recording: Recording, folder: Path, format_: str) -> None:
    """Write observations, the vehicle on paper and what both mean; nothing says which drive it is.

    Parameters
    ----------
    recording
        The run.
    folder
        Where to write.
    format_
        One of `FORMATS`.
    """
    seen = recording.observations
    columns = {name: np.ascontiguousarray(seen[name]) for name in seen.dtype.names or ()}
    vehicle = dict(sorted(recording.vehicle.items()))
    with being_written(folder / f"observations.{format_}") as path:
        if format_ == "csv":
            pd.DataFrame(columns).to_csv(path, index=False, na_rep="NaN", lineterminator="\n")
        elif format_ == "parquet":
            pd.DataFrame(columns).to_parquet(path, index=False)
        else:
            from scipy.io import savemat

            content = {**columns, "vehicle": vehicle}
            savemat(path, content, oned_as="column", do_compression=True, long_field_names=True)
    lines = [f"{name},{value!r}" for name, value in vehicle.items()]
    write_atomically(folder / "vehicle.csv", "\n".join(["parameter,value", *lines]) + "\n")
    write_atomically(folder / "README.md", _drive_readme(tuple(columns), vehicle, format_))


def _drive_readme(channels: tuple[str, ...], vehicle: Mapping[str, float], format_: str) -> str:
    lines = [
        f"`observations.{format_}`: one line a sample.\n",
        "| channel | unit | meaning |",
        "|---|---|---|",
    ]
    for name in channels:
        if name.endswith(NEW):
            lines.append(f"| {name} | - | 1 where `{name.removesuffix(NEW)}` is fresh, else 0 |")
        else:
            found = signal(name)
            lines.append(f"| {name} | {found.unit} | {found.description} |")
    lines += [
        "\n`vehicle.csv`: what is known of the car on paper.\n",
        "| parameter | unit | meaning |",
        "|---|---|---|",
    ]
    for name in vehicle:
        known = VEHICLE_PARAMETERS.get(name)
        if known is not None:
            lines.append(f"| {name} | {known.unit} | {known.description} |")
    return "\n".join(lines) + "\n"


_README = """\
Drives for an estimator that runs outside gripbench
===================================================

{count} folders, one a drive. Each holds `observations.{format}`, `vehicle.csv` (the car on paper)
and a README with the channels and their units: SI, radians, ISO 8855 axes (x forward, y left, z
up). A value that is missing is NaN. Names and order of the folders tell nothing.

Write into the folder of each drive a file `estimates.csv` (or `estimates.parquet`, or
`estimates.mat` in MATLAB's version 5 to 7), one line a sample of the observations:

    time,mu_front,mu_front_variance
    0.0,0.8,0.04

`time` as in the observations, then every signal that is estimated, by its name in
`gripbench list signals`; `<signal>_variance` may stand beside it. Write numbers with at least nine
significant digits. An estimate may use samples up to its own time only: nobody can check that
here, and the rows say so. Then

    gripbench submit FOLDER --name my_observer --reads accel_x,speed_gps

with every channel that was read.
"""
