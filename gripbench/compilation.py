"""A function over numbers and records in, its compiled form out; numba loads with the first one.

A process that only lists what there is compiles nothing: `declare_only` leaves the functions as
they are and numba out, which is most of what such a command would take.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

_declare_only = False


def declare_only() -> None:
    """Leave functions uncompiled in this process, which must run none of them."""
    global _declare_only
    _declare_only = True


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function over records; division by zero gives inf or NaN as in NumPy."""
    return _njit(function, cache=True, nogil=True)


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a short function into each of its callers."""
    return _njit(function, inline="always")


def _njit(function: Callable[..., Any], **options: Any) -> Any:
    if _declare_only:
        return function
    import numba  # .4 s

    return numba.njit(error_model="numpy", **options)(function)
