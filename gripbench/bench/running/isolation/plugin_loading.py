"""A request in, a plug-in that its process has loaded and compiled out."""

from __future__ import annotations

import base64
import contextlib
import dataclasses
import os
import random
import sys
import tempfile
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.core.caching import Cache, NullCache, _CacheLocator
from numba.core.dispatcher import Dispatcher

from gripbench.bench.catalogue.arrays import given_state
from gripbench.bench.catalogue.declarations import Declaration, Source, declaration_of
from gripbench.bench.running.execution import takes_samples
from gripbench.bench.running.isolation import audit
from gripbench.bench.running.isolation.confinement import part_from_parent
from gripbench.bench.running.isolation.trials import has_batch
from gripbench.methods import drivers
from gripbench.methods.contract import CompiledMethod
from gripbench.sources import source_files


@dataclasses.dataclass(frozen=True)
class Plugin:
    """A plug-in that this process has loaded; `batch` and `online` as of `loading.Loaded`."""

    source: Source
    variant: str
    parameters: dict[str, Any]
    declaration: Declaration
    batch: bool
    online: bool
    expected: dict[str, str]
    state: bytes

    def make(self) -> Any:
        """Return a new estimator."""
        return given_state(self.source.make(self.variant, self.parameters), self.state)


_kept: list[Any] = []
"""What was made to see what it declares: its own `__del__` may never end."""


def load_plugin(request: dict[str, Any], state: bytes) -> Plugin:
    """Load and compile what a message of `loading.loading_message` names."""
    seed_generators(request["seed"])
    if request["folder"]:
        os.chdir(request["folder"])
    if request["bounds"]:
        _check_bounds()
    sys.path.extend(place for place in request["path"] if place not in sys.path)
    payload = base64.b64decode(request["payload"])
    source = Source(request["kind"], request["target"], payload)
    variant, parameters = request["variant"], request["parameters"]
    method = source.make(variant, parameters)
    _kept.append(method)
    declaration, online = declaration_of(method, variant, parameters), takes_samples(method)
    _forget_compiled(declaration)
    _compile(method)
    expected = {
        str(check): str(reason)
        for check, reason in dict(getattr(method, "expected_failures", {})).items()
    }
    return Plugin(
        source, variant, parameters, declaration, has_batch(method), online, expected, state
    )


def _check_bounds() -> None:
    """Have numba compile with bounds checking, and nothing taken from its cache without."""
    numba.config.BOUNDSCHECK = 1
    Dispatcher.enable_caching = lambda self: None  # type: ignore[method-assign]


def _forget_compiled(declaration: Declaration) -> None:
    """Leave numba's files of an earlier run alone where they may hold what has changed.

    They are valid while the file and what it imports by name is the same. Where the plug-in read
    more than that, its values may be constants in the compiled code: that is compiled afresh.
    """
    read = {Path(name) for kind, name, _ in audit.report()["seen"] if kind != "environment"}
    followed = source_files(Path(declaration.file)) if declaration.file else set()
    if read <= followed:
        return
    for module in list(sys.modules.values()):
        file = getattr(module, "__file__", None) or ""
        if file and Path(file) in read:
            for value in list(vars(module).values()):
                if isinstance(value, Dispatcher):
                    value._cache = NullCache()  # type: ignore[attr-defined]


def _compile(method: Any) -> None:
    """Compile a step before any clock runs; no code of the plug-in is called for it."""
    if isinstance(method, CompiledMethod) and type(method).update is CompiledMethod.update:
        with contextlib.suppress(Exception):  # the first sample will say what is wrong
            drivers.compile_single(method)


def enter_scratch(scratch: str) -> None:
    """Keep this process, before its first sample, from every file but those of a folder of its own.

    Temporary files go there. Numba stores no code any more: what a cell leaves behind is nothing.
    """
    with contextlib.suppress(OSError):
        os.makedirs(scratch, exist_ok=True)
    audit.ignore(scratch)
    os.environ["TMPDIR"] = tempfile.tempdir = scratch
    Cache.save_overload = lambda *_: None
    _CacheLocator.ensure_cache_path = lambda _: None  # what is stored is read where it lies
    part_from_parent(scratch)


def seed_generators(seed: str) -> None:
    """Seed the global generators, so that a method that draws from them repeats itself."""
    number = int(seed, 16)
    random.seed(number)
    np.random.seed([number >> shift & 0xFFFFFFFF for shift in (0, 32, 64, 96)])  # noqa: NPY002
