"""Where numba keeps a compiled function, and when that is stale: a cache that sees every edit.

numba compares the file of a function only, so a step would keep running the old form of a
building block that was edited in another module. The locator below answers with the digest of
the file and of all that it imports from the project.
"""

from __future__ import annotations

import os
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from numba.core.caching import (
    InTreeCacheLocator,
    UserProvidedCacheLocator,
    UserWideCacheLocator,
)

from gripbench.errors import InputError
from gripbench.sources import imports_gripbench, in_project, source_digest
from gripbench.writing import own_folder


def _stamp(*paths: str) -> str:
    if all(in_project(Path(path)) for path in paths):
        return _stamp_of_project(*paths)
    return source_digest(*map(Path, paths))


@cache
def _stamp_of_project(*paths: str) -> str:
    return source_digest(*map(Path, paths))


def _concerned(path: str) -> bool:
    return Path(path).is_file() and imports_gripbench(Path(path))


class _Stamped:
    """Mixed into numba's locators: only for files of this project or that use it."""

    _py_file: str
    _others: tuple[str, ...] = ()

    def get_source_stamp(self) -> str:
        """Return the digest of the file with everything that it rests on."""
        return _stamp(self._py_file, *self._others)

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Any:
        """Return a locator, or None to leave the function to numba's own."""
        if not _concerned(py_file):
            return None
        found = super().from_function(py_func, py_file)  # type: ignore[misc]
        if found is not None:
            found._others = getattr(py_func, "rests_on", ())  # see `compilation.replacing`
        return found


class InGivenFolder(_Stamped, UserProvidedCacheLocator):
    """Cache in the folder of `NUMBA_CACHE_DIR`, where that is set."""


class InTemporaryFolder(_Stamped, UserWideCacheLocator):
    """Cache in a folder of this user among the temporary files, where neither can be written."""

    def __init__(self, py_func: Any, py_file: str) -> None:
        self._py_file = py_file
        self._lineno = py_func.__code__.co_firstlineno
        self._folder = Path(tempfile.gettempdir(), f"gripbench_numba_{_user()}")
        self._cache_path = str(self._folder / self.get_suitable_cache_subpath(py_file))

    def ensure_cache_path(self) -> None:
        """Make the folder; what lies there is executed, so nobody else may have made it."""
        own_folder(self._folder)
        super().ensure_cache_path()

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Any:
        """Return a locator; it is the last one.

        Raises
        ------
        InputError
            If compiled code cannot be kept anywhere.
        """
        found = super().from_function(py_func, py_file)
        if found is None and _concerned(py_file):
            raise InputError(
                "compiled code can be kept neither beside the package, nor in the home folder, nor "
                f"in {tempfile.gettempdir()}: set NUMBA_CACHE_DIR to a folder that can be written"
            )
        return found


def _user() -> str:
    return str(os.getuid()) if hasattr(os, "getuid") else "user"


class BesideSource(_Stamped, InTreeCacheLocator):
    """Cache beside the source, where that can be written."""


class InUserFolder(_Stamped, UserWideCacheLocator):
    """Cache in the user's folder otherwise."""
