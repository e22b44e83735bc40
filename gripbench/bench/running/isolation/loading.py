"""A plug-in and its settings in; the messages that load it and start its cells out."""

from __future__ import annotations

import base64
import hashlib
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.catalogue.declarations import Declaration, Source
from gripbench.bench.running.isolation.limits import Limits
from gripbench.errors import InputError


@dataclass(frozen=True)
class Settings:
    """Which plug-in, with what its constructor is called, and what its `fit` returned, packed."""

    source: Source
    variant: str
    parameters: Mapping[str, Any]
    state: bytes = field(default=b"", repr=False)


@dataclass(frozen=True)
class Loaded:
    """What a plug-in says of itself when it has been loaded.

    Attributes
    ----------
    declaration
        What it declares.
    batch, online
        Whether it has a form that takes a whole recording, and one that takes samples one by one.
    expected_failures
        Checks that it is known to fail, each with the reason.
    """

    declaration: Declaration
    batch: bool
    online: bool
    expected_failures: dict[str, str]


def scratch_folder() -> str:
    """Return a new empty folder among the temporary files.

    Raises
    ------
    InputError
        If none can be made.
    """
    try:
        return tempfile.mkdtemp(prefix="gripbench-")
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(f"no temporary folder can be made: {reason}; set TMPDIR") from None


def loading_message(
    settings: Settings, limits: Limits, bounds: bool, scratch: str
) -> dict[str, Any]:
    """Return the message that has a plug-in loaded."""
    source = settings.source
    folder = ""
    if source.kind == "file":
        folder = str(Path(source.target.rpartition(":")[0]).parent)
    return {
        "kind": source.kind,
        "target": source.target,
        "payload": base64.b64encode(source.payload).decode("ascii"),
        "variant": settings.variant,
        "parameters": dict(settings.parameters),
        "memory": limits.memory,
        "scratch": scratch,
        "closed": _closed(limits.closed, folder),
        "folder": folder,
        "path": _places(source.kind, folder),
        "seed": _digest(b"loading"),
        "bounds": bounds,
        "state": len(settings.state),
    }


def _closed(results: str, folder: str) -> tuple[str, tuple[str, ...]] | None:
    """Return folder and names of what a plug-in in a folder may not read of the results."""
    if not results:
        return None
    place = Path(results).resolve()
    if folder and Path(folder).resolve().is_relative_to(place):
        return str(place), ("rows", "checks", "exports", "fits")  # it lies among the results itself
    return str(place.parent), (place.name,)


def _places(kind: str, folder: str) -> list[str]:
    """Return where a plug-in's modules are looked for, after the libraries."""
    if kind == "file":
        return [folder]
    import sys

    return [os.path.abspath(place) for place in sys.path]


def generator_seed(declaration: Declaration, observations: npt.NDArray[Any]) -> str:
    """Return the seed of the global generators in a cell's process, 32 hexadecimal digits.

    It is a digest of the method's name and of the first sample that the method is given, so it
    is the same whenever the cell runs, and tells the method nothing that the sample does not. Nine
    digits of each value count, so that machines that differ in the last one agree.
    """
    first = [f"{value:.9g}" for value in observations[:1].view(np.float64).ravel()]
    return _digest(declaration.name.encode(), *(value.encode() for value in first))


def named_seed(name: str, occasion: str) -> str:
    """Return the seed of the global generators where a method is given no sample."""
    return _digest(name.encode(), occasion.encode())


def _digest(*parts: bytes) -> str:
    state = hashlib.blake2b(digest_size=16, person=b"gripbench")
    for part in parts:
        state.update(len(part).to_bytes(8, "big"))
        state.update(part)
    return state.hexdigest()


def read_by(answer: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a process says that it has read; nothing where it says no such thing."""
    read = answer.get("read")
    if not isinstance(read, dict):
        return {}
    seen, untracked = read.get("seen"), read.get("untracked")
    if not isinstance(seen, list) or not isinstance(untracked, list):
        return {}
    for item in seen:
        if not (isinstance(item, list) and len(item) == 3 and {*map(type, item)} == {str}):
            return {}
    return {"seen": seen, "untracked": [str(item) for item in untracked]}
