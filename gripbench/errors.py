"""The errors that gripbench raises on purpose; the command line prints them as one line."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class GripbenchError(Exception):
    """Base of all errors that a user can mend."""


class InputError(GripbenchError):
    """Bad input: says what was wrong, where, and what would be right."""


class UndeclaredChannelError(GripbenchError):
    """A method read a channel, or wrote an estimate, that it did not declare."""


_MOST_LISTED = 30


def nearest(name: str, known: Iterable[str]) -> str:
    """Return a hint that names the nearest known name, or lists the known names.

    Examples
    --------
    >>> nearest("masss", ["mass", "track"])
    "did you mean 'mass'?"
    """
    options = sorted(known)
    match = difflib.get_close_matches(name, options, n=1, cutoff=0.5)
    if match:
        return f"did you mean '{match[0]}'?"
    if len(options) > _MOST_LISTED:
        return f"none of the {len(options)} known names is like it"
    return "known: " + ", ".join(options)


def unknown(kind: str, name: str, known: Iterable[str]) -> InputError:
    """Return the error for a name that nobody knows, with the nearest known one."""
    return InputError(f"unknown {kind} {name!r}: {nearest(name, known)}")
