"""Texts, tables and progress in; letters on a terminal out, whatever the texts hold."""

from __future__ import annotations

import os
import sys
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.text import Text

from gripbench.errors import one_line


class _LiteralConsole(Console):
    """A console on which a text is its letters: no markup, no emoji, no control characters."""

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a text, whatever it holds, on one line."""
        return super().render_str(one_line(text), **options)


def console(stderr: bool = False) -> Console:
    """Return the console for texts and tables; wide where nothing sets a width.

    Names, reasons and notes come from outside: here alone they become letters on a line.
    """
    stream = sys.stderr if stderr else sys.stdout
    return _LiteralConsole(
        stderr=stderr,
        width=None if stream.isatty() or has_width() else 200,
        highlight=False,
        markup=False,
        emoji=False,
    )


def has_width() -> bool:
    """Return whether the environment says how wide a terminal is."""
    return os.environ.get("COLUMNS", "").isdigit()


def progress(description: str, total: int) -> Progress:
    """Return a progress bar on standard error, silent where that is no terminal."""
    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        disable=not sys.stderr.isatty(),
        transient=True,
    )
    bar.add_task(description, total=total)
    return bar
