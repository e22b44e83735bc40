"""Digests of what a result depends on: the source of a method and all that it imports.

The digest of a method covers its file and, from import to import, every module of gripbench and
of its own folder or package, so that editing a shared module runs again exactly the methods that
import it. Modules of other packages enter by their version. Imports are read from the source, so
no code runs for it.
"""

from __future__ import annotations

import importlib.metadata
import inspect
import json
import os
import platform
import sys
from functools import cache
from pathlib import Path
from typing import Any

import gripbench
from gripbench.bench.running import recorded_scenarios, recorded_windows
from gripbench.bench.scoring.metrics import metrics
from gripbench.envs import worlds
from gripbench.envs.hidden_draws import salt_digest
from gripbench.envs.instruments.fault_injection import Faults
from gripbench.envs.instruments.faults import choose_fault
from gripbench.envs.populations.draws import drawn_from
from gripbench.envs.scenarios import Scenario
from gripbench.envs.vehicles import load_vehicle
from gripbench.sources import digest, source_digest

_PROJECT = Path(gripbench.__file__).parent


@cache
def versions() -> dict[str, str]:
    """Return the versions that every result depends on, by name."""
    names = ("numpy", "numba", "llvmlite", "scipy")
    found = {name: importlib.metadata.version(name) for name in names}
    switches = {name: os.environ[name] for name in COMPILER_SWITCHES if os.environ.get(name)}
    machine = {"python": platform.python_version(), "machine": platform.machine()}
    return {**machine, **found, **switches}


COMPILER_SWITCHES = (
    "NUMBA_BOUNDSCHECK", "NUMBA_CPU_FEATURES", "NUMBA_CPU_NAME", "NUMBA_DISABLE_INTEL_SVML",
    "NUMBA_ENABLE_AVX", "NUMBA_LOOP_VECTORIZE", "NUMBA_OPT",
    "NUMBA_SLP_VECTORIZE", "OPENBLAS_CORETYPE",
)  # fmt: skip
"""Environment variables that decide which machine code a result comes from."""


def scenario_digest(scenario: Scenario) -> str:
    """Return the digest of all that a recording depends on besides the seed."""
    if isinstance(scenario, recorded_scenarios.RecordedScenario):
        windows = inspect.getsource(recorded_scenarios) + inspect.getsource(recorded_windows)
        return digest(scenario.content, scenario.absent, windows, source_digest(*_RECORDED))
    world = worlds.known_worlds()[scenario.world]
    classes: tuple[Any, ...] = (world.scenario, world.simulation)
    files = [Path(inspect.getfile(item)) for item in classes]
    content: dict[str, Any] = {
        "scenario": scenario.model_dump(mode="json"),
        "sensors": {name: item.model_dump() for name, item in scenario.all_sensors().items()},
        "vehicle": load_vehicle(scenario.vehicle).values(),
    }
    if scenario.level:
        content["population"] = drawn_from(scenario)
        files.append(Path(inspect.getfile(drawn_from)))
    if scenario.faults:
        chosen = [choose_fault(text).fault for text in scenario.faults]
        content["faults"] = [fault.model_dump() for fault in chosen]
        files.append(Path(inspect.getfile(Faults)))
    sources = source_digest(*files, *(_PROJECT / "envs" / name for name in _RECORDING))
    return digest(json.dumps(content, sort_keys=True), sources, inspect.getsource(worlds.record))


_RECORDED = tuple(_PROJECT / "logs" / name for name in ("coverage.py", "vehicle/excitation.py"))
_RECORDING = ("instruments/suite.py", "recordings.py", "vehicles.py", "plants/simulation.py")


@cache
def scoring_digest() -> str:
    """Return the digest of the code that turns estimates into scores, every metric included."""
    scoring = _PROJECT / "bench" / "scoring" / "scoring.py"
    functions = [metric.compute for metric in metrics().values()]
    files = {sys.modules[getattr(each, "__module__", "")].__file__ for each in functions}
    return source_digest(scoring, *sorted(Path(file) for file in files if file))


def world_digest(scenario: Scenario) -> str:
    """Return the digest of a scenario and of the scoring: what rows of one board have in common."""
    secret = salt_of(scenario)
    return digest(scenario_digest(scenario), scoring_digest(), *([secret] if secret else []))


def salt_of(scenario: Scenario) -> str:
    """Return the digest of the secret that a scenario's draws come from; empty: none, public."""
    return "" if isinstance(scenario, recorded_scenarios.RecordedScenario) else salt_digest()
