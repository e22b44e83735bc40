"""A function over numbers and records in, its compiled form out; numba loads with the first one.

A process that only lists what there is compiles nothing: `declare_only` leaves the functions as
they are and numba out, which is most of what such a command would take.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from types import CodeType, FunctionType
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


def by_channels(choose: Callable[[tuple[str, ...]], Callable[..., Any]]) -> Callable[..., Any]:
    """Make a function of state, observation and parameters that is another for other channels.

    Parameters
    ----------
    choose
        From the names of the observation's fields to a compiled function; in compiled callers it
        is asked once, while they are compiled.
    """

    def function(state: Any, obs: Any, params: Any) -> Any:
        return choose(obs.dtype.names)(state, obs, params)

    if not _declare_only:
        from numba.extending import overload

        @overload(function)
        def of_fields(state, obs, params):  # type: ignore[no-untyped-def]
            chosen = choose(tuple(obs.fields))
            return lambda state, obs, params: chosen(state, obs, params)

    return function


def _njit(function: Callable[..., Any], **options: Any) -> Any:
    if _declare_only:
        return function
    return _numba().njit(error_model="numpy", **options)(function)


@cache
def _numba() -> Any:
    import numba  # .4 s
    from numba.core.errors import NumbaExperimentalFeatureWarning

    # a record with more fields than the first that a function was compiled for is read the same
    warnings.filterwarnings(
        "ignore", "(?s).*considered a subtype", category=NumbaExperimentalFeatureWarning
    )
    return numba


def replacing(function: Any, others: Mapping[Any, Any], name: str) -> Any:
    """Return a compiled function that calls others in place of some, at any depth.

    Parameters
    ----------
    function
        Compiled function.
    others
        By compiled function that it or what it calls has as a global: what is called instead.
    name
        Unique name of the choice; compiled code is kept under it.
    """
    if _declare_only or not others:
        return function
    files = tuple(sorted({other.py_func.__code__.co_filename for other in others.values()}))
    made = dict(others)

    def with_others(one: Any) -> Any:
        if one not in made:
            plain = one.py_func
            called = {
                key: plain.__globals__[key]
                for key in _names(plain.__code__)
                if hasattr(plain.__globals__.get(key), "py_func")
            }
            changed = {key: with_others(value) for key, value in called.items()}
            made[one] = one
            if changed != called:
                copy = FunctionType(plain.__code__, plain.__globals__ | changed, plain.__name__)
                copy.__defaults__, copy.__doc__ = plain.__defaults__, plain.__doc__
                copy.__qualname__ = f"{name}.{plain.__qualname__}"
                copy.rests_on = files  # type: ignore[attr-defined]
                always = one.targetoptions.get("inline") == "always"
                made[one] = inlined(copy) if always else compiled(copy)
        return made[one]

    return with_others(function)


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)
