"""How functions are compiled: the two sets of options, and a cache that sees every edit.

numba compares the file of a function only, so a step would keep running the old form of a
building block that was edited in another module. The locator below answers with the digest of
the file and of all that it imports from the project.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import InTreeCacheLocator, UserWideCacheLocator

from gripbench.sources import imports_gripbench, source_digest


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function over records; division by zero gives inf or NaN as in NumPy."""
    return numba.njit(cache=True, error_model="numpy", nogil=True)(function)


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a short function into each of its callers."""
    return numba.njit(inline="always", error_model="numpy")(function)


@cache
def _stamp(path: str) -> str:
    return source_digest(Path(path))


class _Stamped:
    """Mixed into numba's locators: only for files of this project or that use it."""

    _py_file: str

    def get_source_stamp(self) -> str:
        """Return the digest of the file with everything that it rests on."""
        return _stamp(self._py_file)

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Any:
        """Return a locator, or None to leave the function to numba's own."""
        path = Path(py_file)
        if not path.is_file() or not imports_gripbench(path):
            return None
        return super().from_function(py_func, py_file)  # type: ignore[misc]


class BesideSource(_Stamped, InTreeCacheLocator):
    """Cache beside the source, where that can be written."""


class InUserFolder(_Stamped, UserWideCacheLocator):
    """Cache in the user's folder otherwise."""
