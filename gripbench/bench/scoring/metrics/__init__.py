"""The metrics there are: those of the files here and those of installed packages, by name.

Each file of this folder holds `METRICS`, a tuple of `gripbench.bench.scoring.metric.Metric`. A
package adds its own through the entry point group `gripbench.metrics`: the entry names a metric,
or a tuple of metrics.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import Any

from gripbench.bench.scoring.metric import Metric
from gripbench.errors import InputError
from gripbench.extensions import entry_points, load

GROUP = "gripbench.metrics"
"""Entry point group of metrics."""

_FIRST = ("accuracy", "convergence", "utilisation", "excitation", "calibration", "innovations")


@cache
def metrics() -> dict[str, Metric]:
    """Return every metric by name: those that ship, then those of packages by entry point.

    Raises
    ------
    InputError
        If an entry point cannot be loaded, is no metric, or has the name of another.
    """
    found: dict[str, Metric] = {}
    shipped = [item.name for item in pkgutil.iter_modules(__path__)]
    shipped.sort(key=lambda name: (_FIRST.index(name) if name in _FIRST else len(_FIRST), name))
    for name in shipped:
        _add(found, importlib.import_module(f"{__name__}.{name}").METRICS, name)
    for name, point in entry_points(GROUP).items():
        _add(found, load(point), f"entry point '{name}' of {GROUP}")
    return found


def _add(found: dict[str, Metric], given: Any, source: str) -> None:
    taken = {column: metric.name for metric in found.values() for column in metric.columns}
    for metric in given if isinstance(given, tuple | list) else (given,):
        if not isinstance(metric, Metric):
            raise InputError(f"{source}: {metric!r} is no gripbench metric")
        for column in metric.columns:
            if column in taken:
                raise InputError(
                    f"{source}: metric '{metric.name}' has the column '{column}' of metric "
                    f"'{taken[column]}'; choose another name"
                )
        found[metric.name] = metric
