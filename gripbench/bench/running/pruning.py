"""Which stored rows can go."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from pathlib import Path

from gripbench.bench.catalogue.registry import method_names
from gripbench.bench.catalogue.scenarios import all_scenario_files
from gripbench.bench.running.recorded_scenarios import PREFIX
from gripbench.bench.running.store import DamagedRowError, Store, leftovers, read_row
from gripbench.errors import InputError


def stored(
    results: Path, scenarios: tuple[str, ...] = (), labels: tuple[str, ...] = ()
) -> list[Path]:
    """Return the files of the rows of these scenarios and methods."""
    return list(Store(results).files(scenarios, labels))


def stale(results: Path) -> list[Path]:
    """Return damaged rows, what killed runs left, and rows of scenarios that no longer exist.

    Rows of methods that are not built in stay: their files may lie anywhere.
    """
    known = set(all_scenario_files())
    paths = leftovers(results)
    for path in Store(results).files():
        try:
            row = read_row(path)
        except DamagedRowError:
            paths.append(path)
            continue
        if row is None or row.scenario.startswith(PREFIX):
            continue  # a recording may be stored anywhere
        if row.scenario not in known and row.method in method_names():
            paths.append(path)
    return paths


def remove(paths: Iterable[Path]) -> None:
    """Remove files and the folders that are empty then.

    Raises
    ------
    InputError
        If a file cannot be removed.
    """
    for path in paths:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise InputError(f"{path}: cannot be removed: {error.strerror}") from None
        for folder in (path.parent, path.parent.parent):
            with contextlib.suppress(OSError):
                folder.rmdir()
