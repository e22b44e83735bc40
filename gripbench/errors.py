"""The errors that gripbench raises on purpose, each one line, whatever words it was made of."""

from __future__ import annotations

import difflib
import unicodedata
from collections.abc import Iterable
from pathlib import Path

LONGEST = 500
"""Most characters that a text from outside keeps: a reason, a title."""


def one_line(text: str, longest: int = 0) -> str:
    r"""Return a text that any file, table and terminal can take, on one line.

    Control characters, line breaks, lone surrogates and what changes the direction of a line are
    escaped, so that no name or message from outside breaks a line or cannot be written.

    Parameters
    ----------
    text
        Any text.
    longest
        Most characters of it that are kept; 0: all.

    Examples
    --------
    >>> one_line("two\nlines and \udc80")
    'two\\nlines and \\udc80'
    >>> one_line("12345678", longest=5)
    '1234…'
    """
    kept = text[: longest + 1] if longest else text
    if not (kept.isascii() and kept.isprintable()):
        kept = "".join(letter if _plain(letter) else _escaped(letter) for letter in kept)
    return kept[: longest - 1] + "…" if longest and len(kept) > longest else kept


def _plain(letter: str) -> bool:
    return letter.isprintable() or unicodedata.category(letter) == "Zs"


def _escaped(letter: str) -> str:
    return letter.encode("unicode_escape", "surrogatepass").decode("ascii")


class GripbenchError(Exception):
    """Base of all errors that a user can mend; its message is one line."""

    def __init__(self, *arguments: object) -> None:
        super().__init__(*(one_line(str(item)) for item in arguments))


class InputError(GripbenchError):
    """Bad input: says what was wrong, where, and what would be right."""


class InterruptionError(GripbenchError):
    """The user interrupted a command; says what is kept."""


class UndeclaredChannelError(GripbenchError):
    """A method read a channel, or wrote an estimate, that it did not declare."""


_MOST_LISTED = 30


def nearest(name: str, known: Iterable[str]) -> str:
    """Return a hint that names the nearest known name, or lists the known names.

    Examples
    --------
    >>> nearest("masss", ["mass", "track"])
    "did you mean 'mass'?"
    >>> nearest("gps", ["GPS receiver", "gyroscope"])
    "did you mean 'GPS receiver'?"
    """
    options = sorted(known)
    lower = {option.lower(): option for option in reversed(options)}
    given = name.lower()
    match = difflib.get_close_matches(given, lower, n=1, cutoff=0.5)
    match = match or [option for option in sorted(lower, key=len) if given and given in option]
    if match:
        return f"did you mean '{lower[match[0]]}'?"
    if len(options) > _MOST_LISTED:
        return f"none of the {len(options)} known names is like it"
    return "known: " + ", ".join(options)


def unknown(kind: str, name: str, known: Iterable[str]) -> InputError:
    """Return the error for a name that nobody knows, with the nearest known one."""
    return InputError(f"unknown {kind} {name!r}: {nearest(name, known)}")


def describe_error(error: BaseException) -> str:
    """Return an exception as one sentence with the place where it was raised."""
    place = error.__traceback__
    while place is not None and place.tb_next is not None:
        place = place.tb_next
    try:
        message = one_line(" ".join(str(error).split()), LONGEST)
    except Exception:  # its own code makes the text
        message = "its message cannot be read"
    text = f"{type(error).__name__}: {message}" if message else type(error).__name__
    if isinstance(error, GripbenchError):
        return message
    if place is None:
        return text
    code = place.tb_frame.f_code
    return f"{text} (in {code.co_name}, {Path(code.co_filename).name}:{place.tb_lineno})"
