"""Named arrays of numbers into bytes and back: what `fit` returns, between processes and in files.

The bytes are the length of a head, the head as JSON (name, type and shape of each array) and the
arrays' content. Reading them runs no code of whoever wrote them.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.errors import GripbenchError, one_line

LARGEST = 16 * 1024**2
"""Largest number of bytes of the arrays together."""

_TYPES = {"f": "<f8", "i": "<i8", "u": "<i8", "b": "|b1"}
_LENGTH = struct.Struct("<Q")

Arrays = dict[str, npt.NDArray[Any]]


def numbers_of_fit(given: Any) -> Arrays:
    """Return what `fit` returned as arrays of float64, int64 or bool, by name.

    Raises
    ------
    GripbenchError
        If it is no mapping of names to finite numbers and arrays of them, or too large.
    """
    if not isinstance(given, Mapping):
        raise GripbenchError(
            f"fit returned {type(given).__name__}; return a dict of numbers and arrays of numbers"
        )
    found: Arrays = {}
    for name, value in sorted(given.items(), key=lambda item: str(item[0])):
        if not isinstance(name, str) or not name.isidentifier() or name.startswith("_"):
            raise GripbenchError(f"fit returned the name {one_line(repr(name), 60)}; use a word")
        try:
            array = np.asarray(value)
        except ValueError:  # a ragged list
            array = np.asarray(None)
        if array.dtype.kind not in _TYPES or array.dtype.itemsize > 8:
            raise GripbenchError(
                f"fit returned '{name}' as {type(value).__name__}; return a number or an array of "
                "numbers"
            )
        if not np.isfinite(array).all():
            raise GripbenchError(f"fit returned '{name}', which is not finite")
        found[name] = np.ascontiguousarray(array, _TYPES[array.dtype.kind]).reshape(array.shape)
    size = sum(array.nbytes for array in found.values())
    if size > LARGEST:
        raise GripbenchError(
            f"fit returned {size / 1024**2:.1f} MiB; at most {LARGEST / 1024**2:.0f} are kept"
        )
    return found


def packed(arrays: Arrays) -> bytes:
    """Return arrays as bytes, the same whenever they hold the same."""
    names = sorted(arrays)
    head = [[name, arrays[name].dtype.str, arrays[name].shape] for name in names]
    text = json.dumps(head).encode("ascii")
    return b"".join((_LENGTH.pack(len(text)), text, *(arrays[name].tobytes() for name in names)))


def unpacked(content: bytes) -> Arrays:
    """Return the arrays in bytes, none of which can be written to.

    Raises
    ------
    ValueError
        If they are none.
    """
    if len(content) < _LENGTH.size:
        raise ValueError("too short")
    (length,) = _LENGTH.unpack_from(content)
    at = _LENGTH.size + length
    if not at <= len(content):
        raise ValueError("too short")
    found: Arrays = {}
    for item in json.loads(content[_LENGTH.size : at]):
        name, kind, shape = item
        if not isinstance(name, str) or kind not in _TYPES.values():
            raise ValueError("odd head")
        if not all(isinstance(side, int) and side >= 0 for side in shape):
            raise ValueError("odd shape")
        count, size = math.prod(shape), np.dtype(kind).itemsize
        if at + count * size > len(content):
            raise ValueError("too short")
        found[name] = np.frombuffer(content, kind, count, at).reshape(shape)
        at += count * size
    if at != len(content):
        raise ValueError("too long")
    return found


def given_state(method: Any, content: bytes) -> Any:
    """Return an estimator with what its `fit` returned, where it has one."""
    if content:
        method.fitted = as_given(content)
    return method


def as_given(content: bytes) -> dict[str, Any]:
    """Return packed arrays as a method gets them: numbers as such, arrays that are read only."""
    return {
        name: array.item() if array.ndim == 0 else array
        for name, array in unpacked(content).items()
    }
