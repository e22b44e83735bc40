"""The Python interface to a run, for notebooks and scripts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from gripbench.bench.catalogue.registry import MethodSpec, built_in_methods, choose_method
from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.catalogue.suites import load_suite
from gripbench.bench.running.backends import Backend
from gripbench.bench.running.forms import runnable
from gripbench.bench.running.isolation.limits import Limits
from gripbench.bench.running.recorded_scenarios import recording_of
from gripbench.bench.running.rows import Row, frame_of
from gripbench.bench.running.runner import Plan, run_plan
from gripbench.bench.running.store import Store
from gripbench.envs.scenarios import LEVELS, Scenario
from gripbench.envs.worlds import at_level
from gripbench.errors import InputError
from gripbench.writing import DEFAULT_RESULTS

MOST_SEEDS = 1_000_000
"""Largest number of seeds of one run: a row each would fill a disk long before."""


def run(
    suite: str = "",
    scenarios: Iterable[str | Scenario] = (),
    methods: Iterable[Any] = (),
    seeds: int | str | range | None = None,
    *,
    level: int | None = None,
    results: Path | str = DEFAULT_RESULTS,
    workers: int = 0,
    backend: str = "loky",
    scheduler: str = "",
    fresh: bool = False,
    time_limit: float = 60.0,
    memory_limit: float = 2048.0,
    show_output: bool = False,
) -> pd.DataFrame:
    """Run methods on scenarios and return their scores.

    Parameters
    ----------
    suite
        Name or path of a suite; `scenarios` and `seeds` replace its own, `methods` come on top.
    scenarios
        Names, paths of TOML files, `recording:NAME` or `recording:FOLDER`, or scenarios.
    methods
        Names (`name[:variant][@parameter=number,...]`), files (`file.py:Class`), classes, or
        instances. Without a suite and methods: all built-in ones that fit.
    seeds
        Number of seeds from 0, `"A:B"` for A to B-1, or a range; by default the suite's, else 1.
        The seeds of a recording are its windows, by default all of them.
    level
        Level of the scenarios' populations, 0 to 2; by default the suite's, or as their names say.
    results
        Folder of the stored rows; what is there already is not run again.
    workers
        Number of processes; 0: one for each core.
    backend, scheduler
        `loky` on this machine, or `dask` or `ray`, and the address of their cluster.
    fresh
        Run again what is stored.
    time_limit, memory_limit
        What one cell of a method that is not built in may take: wall-clock time [s], memory [MiB].
    show_output
        Whether what such a method prints appears on standard error, each line behind its name.

    Returns
    -------
    One line for each scenario, seed, method and target, see `running.rows.frame_of`.

    Raises
    ------
    InputError
        If a name is unknown or a method cannot be loaded.
    """
    plan = plan_of(suite, tuple(scenarios), tuple(methods), seeds, level)
    rows: list[Row] = []
    run_plan(
        plan,
        Store(results),
        Backend(backend, workers, scheduler),
        limits_of(time_limit, memory_limit, show_output),
        fresh,
        rows.append,
    )
    return frame_of(sorted(rows, key=order_in(plan)))


def limits_of(time_limit: float, memory_limit: float, show_output: bool = False) -> Limits:
    """Return checked limits of time [s] and memory [MiB], with whether output is shown."""
    if not 0.0 < time_limit < float("inf"):
        raise InputError(f"time limit is {time_limit:g} s; it must be positive")
    if not 1.0 <= memory_limit < float("inf"):
        raise InputError(f"memory limit is {memory_limit:g} MiB; it must be at least 1")
    return Limits(time_limit, int(memory_limit * 1024**2), show_output)


def order_in(plan: Plan) -> Callable[[Row], tuple[int, int, int]]:
    """Return the sort key that brings rows into the order of their plan."""
    scenarios = {scenario.name: index for index, scenario in enumerate(plan.scenarios)}
    methods = {method.label: index for index, method in enumerate(plan.methods)}
    return lambda row: (scenarios[row.scenario], methods[row.label], row.seed)


def plan_of(
    suite: str,
    scenarios: Sequence[str | Scenario],
    methods: Sequence[Any],
    seeds: int | str | range | None,
    level: int | None = None,
) -> Plan:
    """Return the plan that these choices make; see `run`."""
    chosen: list[Any] = list(scenarios)
    specs = []
    if level is not None and level not in LEVELS:
        raise InputError(f"level {level}: known: {', '.join(map(str, LEVELS))}")
    all_windows = seeds is None
    if suite:
        loaded = load_suite(suite)
        if not chosen:
            chosen, level = list(loaded.names(level)), None
        specs = loaded.specs()
        seeds = loaded.seeds if seeds is None else seeds
    labels = {spec.label for spec in specs}
    specs += [spec for spec in map(choose_method, methods) if spec.label not in labels]
    if not chosen:
        raise InputError("nothing to run: give a suite or a scenario")
    found = [item if isinstance(item, Scenario) else find_scenario(item) for item in chosen]
    if level is not None:
        found = [at_level(item, level) for item in found]
    specs = specs or fitting(found)
    if not specs:
        raise InputError("nothing to run: no built-in method fits; give a suite or a method")
    plan = Plan(
        scenarios=tuple(found),
        methods=tuple(specs),
        seeds=seeds_of(seeds),
        windows=None if all_windows else seeds_of(seeds),
    )
    for scenario in plan.scenarios:
        if not plan.seeds_of(scenario):
            raise InputError(
                f"seeds '{seeds}': {scenario.name} has no such window; give some of "
                f"0:{getattr(scenario, 'runs', 0)}"
            )
    return plan


def fitting(scenarios: Sequence[Scenario]) -> list[MethodSpec]:
    """Return the built-in methods that some scenario gives all channels, parameters and a truth.

    Each in its first form that can run, see `running.forms.runnable`.
    """
    found: dict[str, MethodSpec] = {}
    for scenario in scenarios:
        if not getattr(scenario, "absent", ""):
            run = recording_of(scenario, 0)
            found |= runnable(run, run.truth.dtype.names or ())[0]
    order = list(built_in_methods())
    return sorted(found.values(), key=lambda spec: order.index(spec.declaration.name))


def seeds_of(given: int | str | range | None) -> range:
    """Return a range of seeds from `N` (0 to N-1) or `A:B` (A to B-1).

    Raises
    ------
    InputError
        If it is neither, negative or empty.
    """
    if isinstance(given, range):
        found = given
    else:
        first, colon, last = str(1 if given is None else given).partition(":")
        try:
            found = range(int(first), int(last)) if colon else range(int(first))
        except ValueError:
            raise InputError(f"seeds '{given}': give a number N, or A:B for A to B-1") from None
    if found.start >= found.stop or found.start < 0:
        raise InputError(f"seeds '{given}': give at least one seed, none negative")
    if found.stop - found.start > MOST_SEEDS:
        raise InputError(f"seeds '{given}': give at most {MOST_SEEDS} seeds")
    return found
