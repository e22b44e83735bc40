"""What a method was seen to read goes into its row, and is compared before the row is used again.

A row keeps `kind:name` with a digest. A file below the method's own folder goes by its path from
there, so that a moved project keeps its rows; any other by its whole path.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from gripbench.bench.catalogue.registry import MethodSpec
from gripbench.bench.running.isolation.audit import ABSENT, digest_of
from gripbench.bench.running.isolation.processes import environment


def folder_of(method: MethodSpec) -> Path:
    """Return the folder in which a method's file lies."""
    source = method.source
    if source.kind == "file":
        return Path(source.target.rpartition(":")[0]).resolve().parent
    file = method.declaration.file
    return Path(file).resolve().parent if file else Path.cwd()


def kept(read: Mapping[str, Any], folder: Path) -> tuple[dict[str, str], tuple[str, ...]]:
    """Return the dependencies and the untracked reads of a row.

    Parameters
    ----------
    read
        What `audit.report` returned.
    folder
        The method's own.
    """
    untracked = list(read.get("untracked", ()))
    dependencies = {}
    for kind, name, digest in read.get("seen", ()):
        dependencies[f"{kind}:{_shown(kind, name, folder)}"] = digest
        if kind == "environment" and digest == ABSENT and name in os.environ:
            untracked.append(f"the environment variable {name}, which no method is given")
    return dependencies, tuple(untracked)


def unchanged(dependencies: Mapping[str, str], folder: Path) -> bool:
    """Tell whether all that a row rests on is still the same."""
    for key, digest in dependencies.items():
        kind, _, name = key.partition(":")
        if kind == "environment":
            if name in os.environ and name not in environment():
                return False  # it would have to say that no method is given it
            found = digest_of(kind, name, environment())  # what a method is given
        else:
            found = _digest_now(kind, str(folder / Path(name).expanduser()))
        if found != digest:
            return False
    return True


def _shown(kind: str, name: str, folder: Path) -> str:
    if kind == "environment":
        return name
    path = Path(name)
    for place, before in ((folder, ""), (Path(os.path.realpath(folder)), ""), (Path.home(), "~/")):
        if path.is_relative_to(place):
            return before + path.relative_to(place).as_posix()
    return path.as_posix()


def _digest_now(kind: str, path: str) -> str:
    try:
        about = os.stat(path)
    except OSError:
        return ABSENT
    if kind != "file":
        return digest_of(kind, path)
    return _digest_of_state(path, about.st_mtime_ns, about.st_size, about.st_ino)


@lru_cache(maxsize=1000)
def _digest_of_state(path: str, changed: int, size: int, node: int) -> str:
    del changed, size, node  # part of the cache's key only
    return digest_of("file", path)
