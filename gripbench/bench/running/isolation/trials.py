"""Trials of a method: samples in, estimates out, in each way in which a method may be used.

A check says what the estimates of a trial must be; a trial says nothing. So trials of a plug-in
can run in its own process, and what is made of them is decided outside.
"""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.catalogue.declarations import Declaration
from gripbench.bench.running.execution import execute, numbers_of, run_online, takes_samples
from gripbench.bench.scoring.scoring import MISSING, EstimateError, check_estimates
from gripbench.envs.signals import record_type

Records = npt.NDArray[Any]


@dataclass(frozen=True)
class Trial:
    """A method and what it is tried on.

    Attributes
    ----------
    create
        Returns a new estimator.
    declaration
        What it declares.
    vehicle
        Vehicle parameters by name.
    observations
        Structured array, shape (n,): the declared channels and `time`.
    period
        Nominal time [s] between samples.
    """

    create: Callable[[], Any]
    declaration: Declaration
    vehicle: dict[str, float]
    observations: Records
    period: float


def has_batch(method: Any) -> bool:
    """Return whether a method has a form that takes a whole recording."""
    return callable(getattr(method, "run", None))


def perform(form: str, trial: Trial) -> list[Records]:
    """Return the estimates of a trial, each of shape (n,); see `FORMS`."""
    return FORMS[form](trial)


def _run(trial: Trial, method: Any) -> Records:
    """Run in batch where the method can, else online."""
    estimates = execute(
        method, trial.declaration, trial.vehicle, trial.observations, trial.period, timed=False
    ).estimates
    check_estimates(estimates, trial.declaration.outputs, len(trial.observations))
    return estimates.copy()


def _whole(trial: Trial) -> list[Records]:
    """Run over all samples at once; return the estimates and a record of the time of a step [s]."""
    found = execute(
        trial.create(), trial.declaration, trial.vehicle, trial.observations, trial.period,
        timed=False,
    )  # fmt: skip
    outputs = trial.declaration.outputs
    check_estimates(found.estimates, outputs, len(trial.observations))
    return [found.estimates.copy(), _records([[found.runtime.batch] * len(outputs)], outputs)]


def _online(trial: Trial, method: Any) -> Records:
    return run_online(method, trial.declaration, trial.vehicle, trial.observations)


def _twice(trial: Trial) -> list[Records]:
    method = trial.create()
    return [_online(trial, method), _online(trial, method)]


def _reused(trial: Trial) -> list[Records]:
    """Give every sample in the same dict; return the estimates as given and as they are later."""
    method = trial.create()
    names, outputs = trial.observations.dtype.names or (), trial.declaration.outputs
    times = trial.observations["time"]
    method.reset(dict(trial.vehicle), float(times[1] - times[0]))
    buffer: dict[str, float] = {}
    given: list[Any] = []
    first: list[list[float]] = []
    last = [MISSING] * len(outputs)
    for sample in trial.observations.tolist():
        buffer.update(zip(names, sample, strict=True))
        before = dict(buffer)
        given.append(method.update(buffer))
        last = numbers_of(given[-1], outputs, last)
        first.append(last)
        if not _same_dict(buffer, before):
            raise EstimateError("update changes the observation that it is given")
        for name in names:  # whoever looks at the old sample later finds this
            buffer[name] = math.nan
    later, last = [], [MISSING] * len(outputs)
    for item in given:
        last = numbers_of(item, outputs, last)
        later.append(last)
    return [_records(first, outputs), _records(later, outputs)]


def _same_dict(one: dict[str, float], other: dict[str, float]) -> bool:
    return one.keys() == other.keys() and all(
        one[name] == other[name] or other[name] != other[name] for name in other
    )


def _records(values: list[list[float]], outputs: tuple[str, ...]) -> Records:
    records = np.empty(len(values), record_type(outputs))
    for column, name in enumerate(outputs):
        records[name] = [line[column] for line in values]
    return records


def _pickled(trial: Trial) -> list[Records]:
    method = trial.create()
    if takes_samples(method):
        run_online(method, trial.declaration, trial.vehicle, trial.observations[:100])
    twin = pickle.loads(pickle.dumps(method))
    return [_run(trial, method), _run(trial, twin)]


def _timed(trial: Trial) -> list[Records]:
    runtime = execute(
        trial.create(),
        trial.declaration,
        trial.vehicle,
        trial.observations,
        trial.period,
        timed=True,
    ).runtime
    outputs = trial.declaration.outputs
    return [_records([[runtime.p50 or runtime.batch] * len(outputs)], outputs)]


FORMS: dict[str, Callable[[Trial], list[Records]]] = {
    "run": lambda trial: [_run(trial, trial.create())],
    "whole": _whole,
    "run in two": lambda trial: [_run(trial, trial.create()), _run(trial, trial.create())],
    "online": lambda trial: [_online(trial, trial.create())],
    "reset": _twice,
    "reused": _reused,
    "pickled": _pickled,
    "timed": _timed,
}
"""Ways to try a method: a run in its fastest form; the same with its time; in two new ones;
online; online twice with `reset` between; with one dict for all samples (as given, as found later);
as it is and unpickled; timed (one record whose fields are the median time of a step [s])."""
