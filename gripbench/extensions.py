"""What installed packages add, by entry point group: in, a group's name; out, objects by name.

A package declares, for example::

    [project.entry-points."gripbench.worlds"]
    tractor = "my_package.plant:WORLD"

Groups: `gripbench.methods`, `gripbench.scenarios`, `gripbench.metrics`, `gripbench.signals`,
`gripbench.worlds` and `gripbench.papers`; see docs/extend.md.
"""

from __future__ import annotations

import importlib.metadata
import os
import sys
from functools import lru_cache
from typing import Any

from gripbench.errors import InputError


def entry_points(group: str) -> dict[str, importlib.metadata.EntryPoint]:
    """Return the entry points of a group that installed packages declare, by name."""
    places = tuple((place, _changed(place)) for place in sys.path)
    points = _every_point(places).select(group=group)
    return {point.name: point for point in sorted(points, key=lambda point: point.name)}


@lru_cache(maxsize=1)
def _every_point(places: tuple[tuple[str, int], ...]) -> Any:
    del places  # the cache's key: a package may come while a notebook runs
    return importlib.metadata.entry_points()


def _changed(place: str) -> int:
    try:
        return os.stat(place or ".").st_mtime_ns
    except OSError:
        return 0


def load(point: importlib.metadata.EntryPoint, kind: type | tuple[type, ...] = object) -> Any:
    """Return what an entry point names.

    Raises
    ------
    InputError
        If it cannot be imported, or is not of the kind that its group asks for.
    """
    source = f"entry point '{point.name}' of {point.group} ({point.value})"
    try:
        found = point.load()
    except Exception as error:
        raise InputError(
            f"{source}: {type(error).__name__}: {error}; repair or uninstall its package"
        ) from None
    if not isinstance(found, kind):
        raise InputError(f"{source}: is {type(found).__name__}; {_asked(kind)} is asked for")
    return found


def _asked(kind: type | tuple[type, ...]) -> str:
    kinds = kind if isinstance(kind, tuple) else (kind,)
    return " or ".join(item.__name__ for item in kinds)
