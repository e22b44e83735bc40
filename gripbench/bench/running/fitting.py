"""Methods with `fit` in, the same methods with what they learned out: once each, kept, used again.

A fit happens in the method's sandbox, before the first cell. What it returns, numbers only, is
stored under the digest of code, settings, data and budget and handed to every cell: one fit a
method, and the same bytes for any number of workers.
"""

from __future__ import annotations

import hashlib
import json
import time
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from gripbench.bench.catalogue.arrays import Arrays, numbers_of_fit, packed, unpacked
from gripbench.bench.catalogue.registry import MethodSpec, method_digest
from gripbench.bench.catalogue.training import Trained, Training
from gripbench.bench.running.courses import EACH, Course, course_of
from gripbench.bench.running.dependencies import folder_of, kept, unchanged
from gripbench.bench.running.fingerprints import versions
from gripbench.bench.running.isolation.fits import FittingSandbox
from gripbench.bench.running.isolation.limits import CellFailure, Limits
from gripbench.bench.running.isolation.loading import Settings
from gripbench.bench.running.isolation.training_drives import TrainingDrive, training_drive
from gripbench.configuration import Configuration, parse
from gripbench.envs.hidden_draws import drawn_with
from gripbench.errors import InputError, describe_error
from gripbench.sources import digest
from gripbench.writing import being_written

BUDGET = 100
"""Passes over its training drives that a `fit` may make."""

PATIENCE = 10.0
"""Time that a fit may take over the time limit of a cell."""

_RECORD = "__record__"


class FitRecord(Configuration):
    """What is stored beside the numbers of a fit.

    Attributes
    ----------
    label
        The method.
    key
        Digest of code, settings, data and budget.
    training, seconds
        How it was fitted, and how long that took [s].
    digest
        Digest of the numbers.
    dependencies
        What else it was seen to read.
    """

    label: str
    key: str
    training: Training
    seconds: float = Field(ge=0.0)
    digest: str
    dependencies: dict[str, str] = {}


def fitted(
    spec: MethodSpec,
    results: Path | None,
    limits: Limits,
    each: int = EACH,
    budget: int = BUDGET,
) -> MethodSpec:
    """Return a method as it is after its `fit`; any other as it is.

    Parameters
    ----------
    spec
        The method.
    results
        Folder of the results, in which the fit is kept; None: nowhere.
    limits
        What a cell may take.
    each
        Training drives of each scenario.
    budget
        Passes over them that it may make.

    Returns
    -------
    The method with `trained`; or, where its fit failed, with `unfitted`.

    Raises
    ------
    InputError
        If there is nothing to fit it on.
    """
    if not spec.declaration.fits or spec.trained is not None:
        return spec
    with drawn_with(""):  # it learns the same, whatever secret it is tested with
        return _fitted(spec, results, limits, each, budget)


def _fitted(
    spec: MethodSpec, results: Path | None, limits: Limits, each: int, budget: int
) -> MethodSpec:
    declaration = spec.declaration
    course = course_of(declaration.trained_on, folder_of(spec), each)
    key = _key(spec, course, budget)
    path = None if results is None else results / "fits" / f"{key}.npz"
    stored = _read(path, spec, key) if path is not None else None
    if stored is not None:
        return replace(spec, trained=stored)
    drives = (training_drive(one, declaration) for one in course.recordings(declaration))
    counted = _Counted(drives)
    try:
        state, seconds, read = _fit(spec, counted, budget, limits)
    except CellFailure as failure:
        return replace(spec, unfitted=str(failure))
    dependencies, untracked = kept(read, folder_of(spec))
    if method_digest(spec.source, declaration) != spec.digest:
        return replace(spec, unfitted="a file of the method changed while it was fitted")
    training = Training(
        how="fitted", on=course.name, seeds=course.seeds, drives=counted.number, budget=budget
    )
    trained = _trained(training, seconds, state)
    if path is not None and not untracked:
        said = FitRecord(
            label=spec.label, key=key, training=training, seconds=seconds,
            digest=hashlib.sha256(state).hexdigest(), dependencies=dependencies,
        )  # fmt: skip
        _write(path, said, state)
    return replace(spec, trained=trained)


class _Counted:
    """Drives, and how many were taken."""

    def __init__(self, drives: Iterator[TrainingDrive]) -> None:
        self._drives = drives
        self.number = 0

    def __iter__(self) -> Iterator[TrainingDrive]:
        for drive in self._drives:
            self.number += 1
            yield drive


def _fit(
    spec: MethodSpec, drives: _Counted, budget: int, limits: Limits
) -> tuple[bytes, float, dict[str, Any]]:
    if spec.isolated:
        sandbox = FittingSandbox(limits)
        try:
            settings = Settings(spec.source, spec.variant, spec.parameters)
            return sandbox.fit(settings, drives, budget, PATIENCE * limits.time)
        finally:
            sandbox.close()
    given = tuple(drives)
    began = time.monotonic()
    try:
        state = packed(numbers_of_fit(spec.make().fit(given, budget)))
    except Exception as error:
        raise CellFailure("failed", describe_error(error)) from None
    return state, time.monotonic() - began, {}


def _key(spec: MethodSpec, course: Course, budget: int) -> str:
    said = spec.declaration
    asked = repr((said.sensors, said.estimates, said.training_truth, budget))
    return digest(spec.digest, course.digest, repr(sorted(versions().items())), asked)


def _trained(training: Training, seconds: float, state: bytes) -> Trained:
    content = hashlib.sha256(state).hexdigest()
    return Trained(training, seconds, state, digest(content, training.model_dump_json()))


def _write(path: Path, said: FitRecord, state: bytes) -> None:
    content = np.frombuffer(said.model_dump_json().encode(), np.uint8)
    with being_written(path) as temporary:
        np.savez(temporary, **{_RECORD: content}, **unpacked(state))  # type: ignore[arg-type]


def _read(path: Path, spec: MethodSpec, key: str) -> Trained | None:
    """Return a stored fit; None where there is none, or it is not what it says, or rests on more.

    Nothing but numbers is read: no file that somebody changed can run code here.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays: Arrays = {name: file[name] for name in file.files}
        content = json.loads(arrays.pop(_RECORD).tobytes())
        said = parse(FitRecord, content, path)
        state = packed(numbers_of_fit(arrays))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, InputError):
        return None
    if said.key != key or said.digest != hashlib.sha256(state).hexdigest():
        return None
    if not unchanged(said.dependencies, folder_of(spec)):
        return None
    return _trained(said.training, said.seconds, state)
