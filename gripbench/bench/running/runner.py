"""The runner: every cell of scenarios x seeds x methods gets a row, and only what is missing runs.

A row is stored as soon as it comes back from its worker, in one atomic step. A stored row is used
again if its key, the digest of everything that the result depends on, is still the same; so a
run that was killed goes on where it was, and a changed method runs alone.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from gripbench.bench.catalogue.registry import MethodSpec
from gripbench.bench.running.backends import Backend, WorkerLostError
from gripbench.bench.running.cells import Task, close_cages, run_tasks
from gripbench.bench.running.fingerprints import scenario_digest, scoring_digest, versions
from gripbench.bench.running.recorded_scenarios import RecordedScenario, on_recording
from gripbench.bench.running.rows import Row
from gripbench.bench.running.sandbox import Limits, end_declaring
from gripbench.bench.running.store import DamagedRowError, Store
from gripbench.envs.scenarios import Scenario
from gripbench.errors import InputError
from gripbench.sources import digest

CHUNK = 4
"""Seeds in a chunk of work, where no method runs isolated."""

RETRIES = 3
"""How often a run goes on after worker processes were lost."""


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
    def cells(self) -> int:
        """Number of rows that the plan ends with."""
        return len(self.methods) * sum(len(self.seeds_of(item)) for item in self.scenarios)


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
    backend, limits = backend or Backend(), limits or Limits()
    _check_labels(plan)
    began = time.perf_counter()
    report = Report()
    keys = _keys(plan)
    waiting = list(_waiting(plan, store, keys, limits, fresh, report, on_row))
    lost = 0
    try:
        while waiting:
            try:
                for rows in backend.run(run_tasks, _chunks(plan, waiting, keys, limits)):
                    for row in rows:
                        store.write(row)
                        report.computed += 1
                        report.statuses[row.status] += 1
                        on_row(row)
                break
            except WorkerLostError:
                lost += 1
                if lost > RETRIES:
                    raise
                # What came back is stored under today's keys: only the rest runs again.
                waiting = list(_unfinished(waiting, plan, store, keys))
    finally:
        close_cages()
        end_declaring()
    report.seconds = time.perf_counter() - began
    return report


@dataclass(frozen=True)
class _Waiting:
    """Cells of one recording that have to run: methods by index."""

    scenario: Scenario
    seed: int
    methods: tuple[int, ...]


Keys = dict[tuple[str, int], str]


def _keys(plan: Plan) -> Keys:
    """Return the part of the keys that seeds share, by scenario and index of the method."""
    environment = repr(sorted(versions().items()))
    keys = {}
    for scenario in plan.scenarios:
        base = digest(scenario_digest(scenario), scoring_digest(), environment)
        for index, method in enumerate(plan.methods):
            keys[scenario.name, index] = digest(base, method.digest)
    return keys


def _key(keys: Keys, scenario: Scenario, method: int, seed: int) -> str:
    return digest(keys[scenario.name, method], str(seed))


def _waiting(
    plan: Plan,
    store: Store,
    keys: Keys,
    limits: Limits,
    fresh: bool,
    report: Report,
    on_row: Callable[[Row], Any],
) -> Iterator[_Waiting]:
    """Yield the cells that have no valid row; count and hand on the rows of the others."""
    for scenario in plan.scenarios:
        for seed in plan.seeds_of(scenario):
            methods = []
            for index, method in enumerate(plan.methods):
                if fresh:
                    store.path(scenario.name, method.label, seed).unlink(missing_ok=True)
                row = _stored(
                    store, scenario.name, method.label, seed, _key(keys, scenario, index, seed)
                )
                if row is not None and not _may_end_otherwise(row, limits):
                    report.stored += 1
                    report.statuses[row.status] += 1
                    on_row(row)
                else:
                    methods.append(index)
            if methods:
                yield _Waiting(scenario, seed, tuple(methods))


def _stored(store: Store, scenario: str, label: str, seed: int, key: str) -> Row | None:
    try:
        row = store.read(scenario, label, seed)
    except DamagedRowError:
        return None
    return row if row is not None and row.key == key else None


def _may_end_otherwise(row: Row, limits: Limits) -> bool:
    """Tell whether a row of a timeout was made under a shorter limit than now."""
    return row.status == "timeout" and (row.time_limit or 0.0) < limits.time


def _unfinished(
    waiting: Iterable[_Waiting], plan: Plan, store: Store, keys: Keys
) -> Iterator[_Waiting]:
    for item in waiting:
        methods = tuple(
            index
            for index in item.methods
            if not _stored(
                store,
                item.scenario.name,
                plan.methods[index].label,
                item.seed,
                _key(keys, item.scenario, index, item.seed),
            )
        )
        if methods:
            yield _Waiting(item.scenario, item.seed, methods)


def _chunks(
    plan: Plan, waiting: list[_Waiting], keys: Keys, limits: Limits
) -> Iterator[tuple[Task, ...]]:
    isolated = any(method.isolated for method in plan.methods)
    local: dict[tuple[str, int], MethodSpec] = {}

    def method_on(scenario: Scenario, index: int) -> MethodSpec:
        if (scenario.name, index) not in local:
            local[scenario.name, index] = on_recording(plan.methods[index], scenario)
        return local[scenario.name, index]

    tasks = (
        Task(
            scenario=item.scenario,
            seed=item.seed,
            methods=tuple(
                (method_on(item.scenario, index), _key(keys, item.scenario, index, item.seed))
                for index in item.methods
            ),
            limits=limits,
            timed=item.seed == plan.seeds_of(item.scenario)[0],
        )
        for item in waiting
    )
    size = 1 if isolated else CHUNK
    while chunk := tuple(islice(tasks, size)):
        yield chunk


def _check_labels(plan: Plan) -> None:
    for kind, names in (
        ("method", [method.label for method in plan.methods]),
        ("scenario", [scenario.name for scenario in plan.scenarios]),
    ):
        name, count = Counter(names).most_common(1)[0]
        if count > 1:
            raise InputError(f"{kind} '{name}' is given {count} times; give each another name")
