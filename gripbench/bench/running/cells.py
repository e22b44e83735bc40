"""A cell, the unit of a run, and the work on it: a chunk of cells in, their rows out.

A scenario is simulated once a seed, and every method of the chunk runs over that recording. This is
what a worker process does, wherever it is; rows go back to the process that asked.
"""

from __future__ import annotations

import atexit
import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

from gripbench.bench.catalogue.declarations import Source
from gripbench.bench.catalogue.registry import MethodSpec, method_digest
from gripbench.bench.running.deadline import DeadlineError, deadline
from gripbench.bench.running.dependencies import folder_of, kept, unchanged
from gripbench.bench.running.execution import Outcome, SkippedError, execute, missing
from gripbench.bench.running.fingerprints import salt_of, versions, world_digest
from gripbench.bench.running.isolation.limits import CellFailure, Limits
from gripbench.bench.running.isolation.processes import stop_starters
from gripbench.bench.running.isolation.sandbox import Sandbox
from gripbench.bench.running.recorded_scenarios import (
    RecordedScenario,
    judged,
    log_run_of,
    log_window,
    recording_of,
)
from gripbench.bench.running.rows import Row, Status
from gripbench.bench.running.store import row_path
from gripbench.bench.scoring.recovery import RECOVERY, recovery
from gripbench.bench.scoring.scoring import DivergedError, at_lag, score, targets_of
from gripbench.envs.recordings import Recording
from gripbench.envs.scenarios import Scenario
from gripbench.errors import GripbenchError, InputError, describe_error
from gripbench.sources import digest


@dataclass(frozen=True)
class Cell:
    """One method on one seed of one scenario: what a plan is made of, and what a row answers.

    Attributes
    ----------
    scenario, seed
        Which recording.
    method
        The method with its settings there.
    world
        Digest of what all methods of the scenario share: its recordings and their scoring.
    key
        Digest of everything that the result depends on.
    """

    scenario: Scenario
    seed: int
    method: MethodSpec
    world: str
    key: str

    @property
    def path(self) -> Path:
        """Where its row lies below the folder of rows."""
        return row_path(self.scenario.name, self.method.label, self.seed)

    @property
    def recording(self) -> tuple[str, int | str]:
        """What cells of one task share: a simulation, or a method's pass over a log."""
        if isinstance(self.scenario, RecordedScenario):
            return self.scenario.name, self.method.label
        return self.scenario.name, self.seed


def cell_of(scenario: Scenario, seed: int, method: MethodSpec, world: str) -> Cell:
    """Return a cell with its key: world, versions, source and settings of the method, and seed."""
    learned = [method.trained.digest] if method.trained and method.trained.digest else []
    learned += ["unfitted"] if method.unfitted else []
    key = digest(world, repr(sorted(versions().items())), method.digest, str(seed), *learned)
    return Cell(scenario, seed, method, world, key)


class OtherCodeError(GripbenchError):
    """A worker runs other code than the one that the keys of its cells stand for."""


@dataclass(frozen=True)
class Task:
    """Cells of one recording.

    Attributes
    ----------
    cells
        At least one; all have the same scenario and seed, or are windows of one log with the same
        method.
    limits
        What a simulation, and a cell of an isolated method, may take.
    timed
        Whether single calls of compiled methods are timed.
    """

    cells: tuple[Cell, ...]
    limits: Limits
    timed: bool


def run_tasks(tasks: tuple[Task, ...]) -> list[Row]:
    """Return the rows of several tasks."""
    return [row for task in tasks for row in run_task(task)]


def run_task(task: Task) -> list[Row]:
    """Simulate a scenario once and run every method of the task over the recording.

    Raises
    ------
    OtherCodeError
        If this process runs other code than the one that made the plan.
    """
    for cell in task.cells:
        _check_code(cell)
    scenario, seed = task.cells[0].scenario, task.cells[0].seed
    if isinstance(scenario, RecordedScenario) and scenario.absent:
        return [_row(cell, (), "skipped", scenario.absent) for cell in task.cells]
    if isinstance(scenario, RecordedScenario):
        return _run_windows(task, scenario)
    try:
        with deadline(task.limits.time):
            recording = recording_of(scenario, seed)
    except DeadlineError:
        reason = f"the simulation was stopped after the time limit of {task.limits.time:g} s"
        limit = {"time_limit": task.limits.time}
        return [
            _row(cell, cell.method.declaration.estimates, "timeout", reason).model_copy(
                update=limit
            )
            for cell in task.cells
        ]
    except Exception as error:
        reason = f"the scenario could not be simulated: {describe_error(error)}"
        return [
            _row(cell, cell.method.declaration.estimates, "failed", reason) for cell in task.cells
        ]
    return [run_cell(cell, recording, task.limits, task.timed) for cell in task.cells]


def _run_windows(task: Task, scenario: RecordedScenario) -> list[Row]:
    """Run a method once over each run of a log, and score that pass in every window."""
    rows = []
    by_run = groupby(task.cells, key=lambda cell: log_run_of(scenario, cell.seed))
    for cells in [tuple(group) for _, group in by_run]:
        final = max(cells, key=lambda cell: cell.seed)
        passed = _passed(final, task.limits, task.timed) if len(cells) > 1 else None
        for cell in cells:
            recording = recording_of(scenario, cell.seed)
            row = run_cell(cell, recording, task.limits, task.timed, passed)
            rows.append(row.model_copy(update={"window": log_window(recording)}))
    return rows


def _passed(cell: Cell, limits: Limits, timed: bool) -> Outcome | None:
    """Return a method's pass over a log to the end of a window; None where it does not get there.

    Each window is then run by itself, so that what happens after its end does not count in it.
    """
    recording = recording_of(cell.scenario, cell.seed)
    channels = recording.observations.dtype.names or ()
    if missing(cell.method.declaration, recording.vehicle, channels):
        return None
    try:
        return _outcome(cell, recording, limits, timed)
    except Exception:
        return None


_checked: set[tuple[str, str]] = set()


def _check_code(cell: Cell) -> None:
    """Check that this process, wherever it is, has the code that the key of a cell stands for."""
    method = cell.method
    shared = (cell.world, "" if method.isolated else method.digest)
    if shared in _checked:
        return
    here = method.digest if method.isolated else method_digest(method.source, method.declaration)
    world = world_digest(cell.scenario)
    found = cell_of(cell.scenario, cell.seed, replace(method, digest=here), world)
    if found.key != cell.key:
        raise OtherCodeError(
            f"a worker ({platform.node()}, process {os.getpid()}) has another gripbench or other "
            "packages, or another GRIPBENCH_SALT, than the process that asks it: a file was edited "
            "meanwhile, or the cluster has to be started again; then run the same command again"
        )
    _checked.add(shared)


def run_cell(
    cell: Cell,
    recording: Recording,
    limits: Limits,
    timed: bool,
    passed: Outcome | None = None,
) -> Row:
    """Run one method over a recording and score it; whatever happens, there is a row.

    `passed` is a pass of the method that goes on after the recording's end: nothing later reaches
    the samples before, so its first part is what the method makes of the recording.
    """
    declaration = cell.method.declaration
    channels = recording.observations.dtype.names or ()
    targets = targets_of(declaration.estimates, recording)
    reason = missing(declaration, recording.vehicle, channels)
    if not reason and not targets:
        reason = "the scenario has no truth for any of its estimates"
    if reason:
        return _row(cell, targets, "skipped", reason)
    if cell.method.unfitted:
        reason = f"its fit failed: {cell.method.unfitted}"
        return _row(cell, targets, "failed", reason).model_copy(update={"passing": True})
    read: Mapping[str, Any] = {}
    try:
        if passed is None:
            outcome = _outcome(cell, recording, limits, timed)
        else:
            outcome = replace(passed, estimates=passed.estimates[: len(recording.truth)])
        read = outcome.read
        if isinstance(cell.scenario, RecordedScenario):
            recording = judged(recording, outcome.estimates)
        recording = at_lag(recording, declaration.lag)
        scores = score(outcome.estimates, declaration.outputs, targets, recording)
        if recording.clean is not None:
            twin = _outcome(cell, replace(recording, observations=recording.clean), limits, False)
            for target in scores:
                value = recovery(outcome.estimates, twin.estimates, target, recording)
                if value is not None:
                    scores[target][RECOVERY] = value
    except DivergedError as error:
        return _resting_on(cell, _row(cell, targets, "diverged", str(error)), read)
    except SkippedError as error:
        return _row(cell, targets, "skipped", str(error))
    except CellFailure as failure:
        status: Status = failure.status  # type: ignore[assignment]
        row = _row(cell, targets, status, str(failure))
        changes = {
            "time_limit": limits.time if status == "timeout" else None,
            "memory_limit": failure.memory,
            "passing": failure.outside,
        }
        return _resting_on(cell, row.model_copy(update=changes), failure.read)
    except Exception as error:
        return _resting_on(cell, _row(cell, targets, "failed", describe_error(error)), read)
    row = _row(cell, tuple(scores), "ok", "")
    trained = cell.method.trained
    training = {"training": trained.seconds if trained else None}
    runtime = outcome.runtime.model_copy(update=training)
    found = {"scores": scores, "runtime": runtime, "over_prefixes": outcome.over_prefixes}
    row = row.model_copy(update=found)
    return _resting_on(cell, row, outcome.read)


def _resting_on(cell: Cell, row: Row, read: Mapping[str, Any]) -> Row:
    """Return the row of an isolated method with what it rests on.

    What ran must be what the key says: where a file is another one now than when it was read, or
    than when the plan was made, the row says that and nothing else.
    """
    method = cell.method
    if not method.isolated:
        return row
    folder = folder_of(method)
    dependencies, untracked = kept(read, folder)
    try:
        same = method_digest(method.source, method.declaration) == method.digest
    except (OSError, InputError):
        same = False
    if not (same and (untracked or unchanged(dependencies, folder))):
        reason = "a file of the method changed while it ran: run the same command again"
        return _row(cell, row.targets, "failed", reason).model_copy(update={"passing": True})
    return row.model_copy(update={"dependencies": dependencies, "untracked": untracked})


def _outcome(cell: Cell, recording: Recording, limits: Limits, timed: bool) -> Outcome:
    spec, period = cell.method, cell.scenario.sample_time
    if not spec.isolated:
        return execute(
            spec.make(),
            spec.declaration,
            recording.vehicle,
            recording.observations,
            period,
            timed,
        )
    return _sandbox(spec, limits).execute(
        spec.source,
        spec.declaration,
        spec.variant,
        spec.parameters,
        recording.vehicle,
        recording.observations,
        period,
        spec.state,
    )


def _row(cell: Cell, targets: tuple[str, ...], status: Status, reason: str) -> Row:
    declaration = cell.method.declaration
    return Row(
        key=cell.key,
        world=cell.world,
        salt=salt_of(cell.scenario),
        scenario=cell.scenario.name,
        seed=cell.seed,
        method=declaration.name,
        title=declaration.title,
        variant=declaration.variant,
        label=cell.method.label,
        parameters=declaration.settings,
        baseline=declaration.baseline,
        sensors=declaration.sensors,
        idealised=declaration.idealised,
        targets=targets,
        status=status,
        reason=reason,
        sample_period=cell.scenario.sample_time,
        method_digest=cell.method.digest if cell.method.isolated else "",
        training=cell.method.trained.training if cell.method.trained else None,
        versions=versions(),
    )


MOST_SANDBOXES = 8
"""Largest number of plug-ins whose processes wait for their next cell."""

_sandboxes: dict[tuple[Source, str, str, Limits], Sandbox] = {}


def _sandbox(spec: MethodSpec, limits: Limits) -> Sandbox:
    """Return this process's sandbox of a method in one state of its source and training."""
    key = (spec.source, spec.digest, spec.trained.digest if spec.trained else "", limits)
    if key not in _sandboxes:
        while len(_sandboxes) >= MOST_SANDBOXES:
            _sandboxes.pop(next(iter(_sandboxes))).close()
        _sandboxes[key] = Sandbox(limits)
    return _sandboxes[key]


def close_sandboxes() -> None:
    """End the processes of all isolated methods that this process started."""
    for sandbox in _sandboxes.values():
        sandbox.close()
    _sandboxes.clear()
    stop_starters()


atexit.register(close_sandboxes)
