"""One chunk of work: a scenario is simulated once a seed, every method runs over that recording.

This is what a worker process does, wherever it is; rows go back to the process that asked.
"""

from __future__ import annotations

import atexit
from dataclasses import dataclass

import numpy as np

from gripbench.bench.catalogue.declarations import Declaration, Source, describe_error
from gripbench.bench.catalogue.registry import MethodSpec
from gripbench.bench.running.execution import Outcome, SkippedError, execute, missing
from gripbench.bench.running.fingerprints import versions
from gripbench.bench.running.recorded_scenarios import RecordedScenario, judged, recording_of
from gripbench.bench.running.rows import Row, Status
from gripbench.bench.running.sandbox import Cage, CellFailure, Limits
from gripbench.bench.scoring.scoring import DivergedError, score, targets_of
from gripbench.envs.recordings import Recording, select_channels
from gripbench.envs.scenarios import Scenario


@dataclass(frozen=True)
class Task:
    """The methods that run over one recording.

    Attributes
    ----------
    scenario, seed
        Which recording.
    methods
        Methods, each with the key of its cell.
    limits
        What a cell of an isolated method may take.
    timed
        Whether single calls of compiled methods are timed.
    """

    scenario: Scenario
    seed: int
    methods: tuple[tuple[MethodSpec, str], ...]
    limits: Limits
    timed: bool


def run_tasks(tasks: tuple[Task, ...]) -> list[Row]:
    """Return the rows of several tasks."""
    return [row for task in tasks for row in run_task(task)]


def run_task(task: Task) -> list[Row]:
    """Simulate a scenario once and run every method of the task over the recording."""
    if isinstance(task.scenario, RecordedScenario) and task.scenario.absent:
        reason = task.scenario.absent
        return [_row(task, spec, key, (), "skipped", reason) for spec, key in task.methods]
    try:
        recording = recording_of(task.scenario, task.seed)
    except Exception as error:
        reason = f"the scenario could not be simulated: {describe_error(error)}"
        return [
            _row(task, spec, key, spec.declaration.estimates, "failed", reason)
            for spec, key in task.methods
        ]
    return [run_cell(task, spec, key, recording) for spec, key in task.methods]


def run_cell(task: Task, spec: MethodSpec, key: str, recording: Recording) -> Row:
    """Run one method over a recording and score it; whatever happens, there is a row."""
    declaration = spec.declaration
    channels = recording.observations.dtype.names or ()
    targets = targets_of(declaration.estimates, recording)
    period = task.scenario.sample_time
    reason = missing(declaration, recording.vehicle, channels)
    if not reason and not targets:
        reason = "the scenario has no truth for any of its estimates"
    if reason:
        return _row(task, spec, key, targets, "skipped", reason)
    try:
        outcome = _outcome(task, spec, recording, period)
        if isinstance(task.scenario, RecordedScenario):
            recording = judged(recording, outcome.estimates)
        scores = score(outcome.estimates, declaration.outputs, targets, recording)
    except DivergedError as error:
        return _row(task, spec, key, targets, "diverged", str(error))
    except SkippedError as error:
        return _row(task, spec, key, targets, "skipped", str(error))
    except CellFailure as failure:
        status: Status = failure.status  # type: ignore[assignment]
        return _row(task, spec, key, targets, status, str(failure))
    except Exception as error:
        return _row(task, spec, key, targets, "failed", describe_error(error))
    row = _row(task, spec, key, tuple(scores), "ok", "")
    return row.model_copy(update={"scores": scores, "runtime": outcome.runtime})


def _outcome(task: Task, spec: MethodSpec, recording: Recording, period: float) -> Outcome:
    if not spec.isolated:
        return execute(
            spec.make(),
            spec.declaration,
            recording.vehicle,
            recording.observations,
            period,
            task.timed,
        )
    return _cage(spec.source, task.limits).execute(
        spec.source,
        spec.declaration,
        spec.variant,
        spec.parameters,
        recording.vehicle,
        np.asarray(select_channels(recording.observations, spec.declaration.sensors)),
        period,
        recording.seed,
    )


def _row(
    task: Task,
    spec: MethodSpec,
    key: str,
    targets: tuple[str, ...],
    status: Status,
    reason: str,
) -> Row:
    declaration: Declaration = spec.declaration
    return Row(
        key=key,
        scenario=task.scenario.name,
        seed=task.seed,
        method=declaration.name,
        title=declaration.title,
        variant=declaration.variant,
        label=spec.label,
        parameters=declaration.settings,
        sensors=declaration.sensors,
        idealised=declaration.idealised,
        targets=targets,
        status=status,
        reason=reason,
        sample_period=task.scenario.sample_time,
        time_limit=task.limits.time if status == "timeout" else None,
        versions=versions(),
    )


_cages: dict[tuple[Source, Limits], Cage] = {}


def _cage(source: Source, limits: Limits) -> Cage:
    """Return this process's cage of a method; it lives as long as the process."""
    key = (source, limits)
    if key not in _cages:
        _cages[key] = Cage(limits)
    return _cages[key]


def close_cages() -> None:
    """End the processes of all isolated methods that this process started."""
    for cage in _cages.values():
        cage.close()
    _cages.clear()


atexit.register(close_cages)
