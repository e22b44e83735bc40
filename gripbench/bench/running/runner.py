"""The runner: a plan in, a stored row for each of its cells out; only what is missing runs.

A row is stored as soon as it comes back from its worker, in one atomic step. A stored row is used
again if its key, the digest of everything that the result depends on, is still the same; so a
run that was killed goes on where it was, and a changed method runs alone.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import groupby, islice
from typing import Any

import numba

from gripbench.bench.catalogue.registry import MethodSpec
from gripbench.bench.catalogue.training import check_test_seeds
from gripbench.bench.running.backends import Backend, WorkerLostError
from gripbench.bench.running.cells import Cell, Task, cell_of, close_sandboxes, run_tasks
from gripbench.bench.running.dependencies import folder_of, unchanged
from gripbench.bench.running.fingerprints import salt_of, world_digest
from gripbench.bench.running.fitting import fitted
from gripbench.bench.running.isolation.limits import Limits
from gripbench.bench.running.isolation.processes import stop_starters
from gripbench.bench.running.recorded_scenarios import RecordedScenario, on_recording
from gripbench.bench.running.rows import Row
from gripbench.bench.running.store import DamagedRowError, Store
from gripbench.envs.scenarios import Scenario
from gripbench.errors import InputError
from gripbench.sources import changed_since_start

CHUNK = 8
"""Cells in a chunk of work, about, where no method runs isolated: what a kill can cost."""

RETRIES = 3
"""How often a run goes on after worker processes were lost and no row came back."""


@dataclass(frozen=True)
class Plan:
    """What to run: every method on every seed of every scenario.

    Of a recording it is every window, or those of `windows` alone.
    """

    scenarios: tuple[Scenario, ...]
    methods: tuple[MethodSpec, ...]
    seeds: range
    windows: range | None = None

    def seeds_of(self, scenario: Scenario) -> tuple[int, ...]:
        """Return the seeds of a scenario; of a recording, its windows among those chosen."""
        if not isinstance(scenario, RecordedScenario):
            return tuple(self.seeds)
        chosen = range(scenario.runs) if self.windows is None else self.windows
        return tuple(seed for seed in chosen if seed < scenario.runs)

    @property
    def size(self) -> int:
        """Number of cells, and so of rows that the plan ends with."""
        return len(self.methods) * sum(len(self.seeds_of(item)) for item in self.scenarios)

    def cells(self) -> Iterator[Cell]:
        """Yield every cell, those of one recording next to each other."""
        for scenario in self.scenarios:
            world = world_digest(scenario)
            methods = [on_recording(method, scenario) for method in self.methods]
            seeds = self.seeds_of(scenario)
            if isinstance(scenario, RecordedScenario):
                for method in methods:
                    yield from (cell_of(scenario, seed, method, world) for seed in seeds)
                continue
            for seed in seeds:
                yield from (cell_of(scenario, seed, method, world) for method in methods)


class InterruptedRun(KeyboardInterrupt):
    """A run that its user interrupted; says what is kept."""


@dataclass
class Report:
    """What a run did.

    Attributes
    ----------
    stored
        Cells that were there already.
    computed
        Cells that were run.
    statuses
        Rows by status, stored ones included.
    seconds
        Wall-clock time.
    """

    stored: int = 0
    computed: int = 0
    statuses: Counter[str] = field(default_factory=Counter)
    seconds: float = 0.0


def run_plan(
    plan: Plan,
    store: Store,
    backend: Backend | None = None,
    limits: Limits | None = None,
    fresh: bool = False,
    on_row: Callable[[Row], Any] = lambda row: None,
) -> Report:
    """Run what is missing of a plan; when it returns, every cell has a row in the store.

    Parameters
    ----------
    plan
        What to run.
    store
        Where rows are kept.
    backend
        Where to run; by default in processes of this machine.
    limits
        What a cell of an isolated method may take.
    fresh
        Run every cell, stored or not.
    on_row
        Called with every row, stored ones first.

    Raises
    ------
    InputError
        If two methods have the same label, or rows cannot be written.
    """
    backend = backend or Backend()
    limits = replace(limits or Limits(), closed=str(store.results.resolve()))
    _check_labels(plan)
    _check_process()
    _check_training(plan)
    began = time.perf_counter()
    report = Report()
    try:
        learned = tuple(fitted(method, store.results, limits) for method in plan.methods)
    finally:
        stop_starters()
    plan = replace(plan, methods=learned)
    _check_training(plan)
    waiting = []
    for cell in plan.cells():
        if fresh:
            store.remove(cell.scenario.name, cell.method.label, cell.seed)
        row = _reusable(store, cell, limits)
        if row is None:
            waiting.append(cell)
            continue
        report.stored += 1
        report.statuses[row.status] += 1
        on_row(store.marked(row))
    lost = 0
    try:
        while waiting:
            done = set()
            try:
                for rows in backend.run(run_tasks, _chunks(plan, waiting, limits, backend)):
                    for row in rows:
                        store.write(row)
                        done.add((row.scenario, row.label, row.seed))
                        report.computed += 1
                        report.statuses[row.status] += 1
                        on_row(store.marked(row))
                break
            except WorkerLostError:
                lost = 1 if done else lost + 1
                if lost > RETRIES:
                    raise
                # what came back is stored: only the rest runs again
                waiting = [
                    cell
                    for cell in waiting
                    if (cell.scenario.name, cell.method.label, cell.seed) not in done
                ]
    except KeyboardInterrupt:
        kept = report.stored + report.computed
        raise InterruptedRun(
            f"interrupted; {kept} of {plan.size} rows are kept in {store.results}: the same "
            "command goes on from there"
        ) from None
    finally:
        close_sandboxes()
        stop_starters()
    report.seconds = time.perf_counter() - began
    return report


def _reusable(store: Store, cell: Cell, limits: Limits) -> Row | None:
    """Return the stored row of a cell, None where it has to run (again)."""
    try:
        row = store.read(cell.scenario.name, cell.method.label, cell.seed)
    except DamagedRowError:
        return None
    if row is not None and row.salt != salt_of(cell.scenario):
        secret = "another secret" if row.salt else "no secret"
        raise InputError(
            f"{store.results}: holds rows of '{row.label}' on '{row.scenario}' that were drawn "
            f"with {secret}; choose another --results, or set GRIPBENCH_SALT as it was"
        )
    if row is None or row.key != cell.key or row.passing or row.untracked:
        return None
    if row.status == "timeout" and (row.time_limit or 0.0) < limits.time:
        return None
    if row.memory_limit is not None and row.memory_limit < limits.memory / 1024**2:
        return None
    if row.dependencies and not unchanged(row.dependencies, folder_of(cell.method)):
        return None
    return row


def _chunks(
    plan: Plan, waiting: list[Cell], limits: Limits, backend: Backend
) -> Iterator[tuple[Task, ...]]:
    """Yield tasks to send to workers, the first ones of a single cell: rows come from the start."""
    first = {scenario.name: plan.seeds_of(scenario)[0] for scenario in plan.scenarios}

    def task(cells: Iterable[Cell]) -> Task:
        chosen = tuple(cells)
        timed = any(cell.seed == first[cell.scenario.name] for cell in chosen)
        return Task(chosen, limits, timed)

    logs = any(isinstance(cell.scenario, RecordedScenario) for cell in waiting)
    alone = 0 if logs else 2 * backend.processes  # one pass over a log serves all its windows
    yield from ((task([cell]),) for cell in waiting[:alone])
    recordings = groupby(waiting[alone:], key=lambda cell: cell.recording)
    tasks = (task(cells) for _, cells in recordings)
    isolated = any(method.isolated for method in plan.methods)
    single = isolated or logs or backend.processes == 1
    size = 1 if single else max(1, CHUNK // len(plan.methods))
    while chunk := tuple(islice(tasks, size)):
        yield chunk


def _check_process() -> None:
    """Check that what this process would run is what keys would say that it ran."""
    changed = changed_since_start()
    if changed is not None:
        raise InputError(
            f"{changed}: changed after this Python had loaded it; start Python again, so that the "
            "code that runs is the one in the file"
        )
    if numba.config.DISABLE_JIT:
        raise InputError(
            "the environment variable NUMBA_DISABLE_JIT is set: methods and simulations are "
            "compiled and cannot run without; unset it"
        )


def _check_training(plan: Plan) -> None:
    """Check that no trained method is tested on what it may have been trained on."""
    for method in plan.methods:
        training = method.trained.training if method.trained else None
        for scenario in plan.scenarios if training or method.declaration.fits else ():
            if not isinstance(scenario, RecordedScenario):
                check_test_seeds(method.label, training, plan.seeds_of(scenario))


def _check_labels(plan: Plan) -> None:
    for kind, names in (
        ("method", [method.label for method in plan.methods]),
        ("scenario", [scenario.name for scenario in plan.scenarios]),
    ):
        name, count = Counter(names).most_common(1)[0]
        if count > 1:
            raise InputError(f"{kind} '{name}' is given {count} times; give each another name")
