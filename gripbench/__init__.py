"""gripbench: a benchmark of estimators of tyre-road friction and vehicle sideslip.

The names below are the stable Python interface; everything else may move between versions. They
are imported when first used, so that `import gripbench` costs little. The scenarios are registered
as environments as soon as Gymnasium is imported, before or after.

Examples
--------
>>> import gripbench
>>> class Friction(gripbench.CompiledMethod): ...           # see examples/
>>> gripbench.check_estimator(Friction)                     # doctest: +SKIP
>>> rows = gripbench.run(suite="longitudinal", methods=[Friction], seeds=20)  # doctest: +SKIP
>>> gripbench.summary(rows)                                 # doctest: +SKIP
>>> gripbench.rank(rows, target="mu_front")                 # doctest: +SKIP
"""

from __future__ import annotations

import importlib
import os
import sys
from typing import TYPE_CHECKING, Any

from gripbench.envs.gym.registration import register_with_gymnasium

if TYPE_CHECKING:
    from gripbench.bench.catalogue.check import check_estimator
    from gripbench.bench.catalogue.registry import register
    from gripbench.bench.ranking.consistency import consistency
    from gripbench.bench.ranking.ranking import rank
    from gripbench.bench.ranking.summary import summary
    from gripbench.bench.running.api import run
    from gripbench.bench.running.store import read_rows
    from gripbench.envs.worlds import load_scenario, record
    from gripbench.methods.contract import (
        CompiledMethod,
        Estimator,
        Parameter,
        Variant,
        compiled,
    )
    from gripbench.methods.foreign.fmu import Fmu
    from gripbench.methods.foreign.onnx_model import OnnxModel
    from gripbench.methods.foreign.program import Program
    from gripbench.methods.foreign.shared_library import SharedLibrary

# numba's cache must see edits of what a function calls, see gripbench.compiled_cache
_LOCATORS = (
    "gripbench.compiled_cache.InGivenFolder,gripbench.compiled_cache.BesideSource,"
    "gripbench.compiled_cache.InUserFolder,"
    "gripbench.compiled_cache.InTemporaryFolder,"
    "UserProvidedCacheLocator,InTreeCacheLocator,UserWideCacheLocator,IPythonCacheLocator"
)
os.environ.setdefault("NUMBA_CACHE_LOCATOR_CLASSES", _LOCATORS)
if "numba" in sys.modules:
    sys.modules["numba"].config.CACHE_LOCATOR_CLASSES = os.environ["NUMBA_CACHE_LOCATOR_CLASSES"]

__version__ = "0.1.0"

DEFINED_IN = {
    "CompiledMethod": "gripbench.methods.contract",
    "Estimator": "gripbench.methods.contract",
    "Fmu": "gripbench.methods.foreign.fmu",
    "OnnxModel": "gripbench.methods.foreign.onnx_model",
    "Parameter": "gripbench.methods.contract",
    "Program": "gripbench.methods.foreign.program",
    "SharedLibrary": "gripbench.methods.foreign.shared_library",
    "Variant": "gripbench.methods.contract",
    "check_estimator": "gripbench.bench.catalogue.check",
    "compiled": "gripbench.methods.contract",
    "consistency": "gripbench.bench.ranking.consistency",
    "load_scenario": "gripbench.envs.worlds",
    "rank": "gripbench.bench.ranking.ranking",
    "read_rows": "gripbench.bench.running.store",
    "record": "gripbench.envs.worlds",
    "register": "gripbench.bench.catalogue.registry",
    "run": "gripbench.bench.running.api",
    "summary": "gripbench.bench.ranking.summary",
}
"""The module behind each public name."""

__all__ = [
    "CompiledMethod",
    "Estimator",
    "Fmu",
    "OnnxModel",
    "Parameter",
    "Program",
    "SharedLibrary",
    "Variant",
    "check_estimator",
    "compiled",
    "consistency",
    "load_scenario",
    "rank",
    "read_rows",
    "record",
    "register",
    "run",
    "summary",
]


def __getattr__(name: str) -> Any:
    if name in DEFINED_IN:
        return getattr(importlib.import_module(DEFINED_IN[name]), name)
    raise AttributeError(f"module 'gripbench' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted([*globals(), *DEFINED_IN])


register_with_gymnasium()
