"""What a method prints, line by line, onto standard error: for its author, on request."""

from __future__ import annotations

import os
import sys
import threading

from gripbench.errors import one_line

MOST_LINES = 10_000
"""Most lines of one process that are shown."""

LONGEST_LINE = 2000
"""Most characters of a line that are shown."""


class Shown:
    """A pipe whose lines appear on standard error, each behind the name of who wrote it.

    Parameters
    ----------
    name
        The method's.

    Attributes
    ----------
    write
        Descriptor to print to; whoever hands it on closes it here.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        read, self.write = os.pipe()
        self._thread = threading.Thread(target=self._show, args=(read,), daemon=True)
        self._thread.start()

    def finish(self, limit: float) -> None:
        """Wait until all that was written has been shown.

        Parameters
        ----------
        limit
            Time [s] to wait at most: a process that nobody found may hold the pipe open.
        """
        self._thread.join(limit)

    def _show(self, read: int) -> None:
        with os.fdopen(read, encoding="utf-8", errors="backslashreplace") as lines:
            number = 0
            while line := lines.readline(LONGEST_LINE):
                number += 1
                if number <= MOST_LINES:
                    text = one_line(line.rstrip("\n"))
                    print(f"{self._name}: {text}", file=sys.stderr, flush=True)
                elif number == MOST_LINES + 1:
                    print(f"{self._name}: no more is shown", file=sys.stderr, flush=True)
