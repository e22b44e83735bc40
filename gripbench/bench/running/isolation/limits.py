"""What a cell of an isolated method may take, and how it fails."""

from __future__ import annotations

import os
import signal as signals
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gripbench.bench.running.isolation.processes import VARIABLE
from gripbench.errors import GripbenchError


@dataclass(frozen=True)
class Limits:
    """What one cell of an isolated method may take.

    Attributes
    ----------
    time
        Wall-clock time [s] of its samples; loading and compiling come before.
    memory
        Memory [bytes] beyond what the empty process has.
    closed
        Folder of the results, which it cannot read.
    show
        Whether what it prints is shown on standard error.
    sandbox
        Kind of sandbox, of `processes.SANDBOXES`; by default what the environment's variable
        GRIPBENCH_SANDBOX says.
    """

    time: float = 60.0
    memory: int = 2 * 1024**3
    show: bool = False
    closed: str = ""
    sandbox: str = field(default_factory=lambda: os.environ.get(VARIABLE, ""))


class CellFailure(GripbenchError):  # noqa: N818 - a result of a cell, not a mistake of the harness
    """A method failed; `status` says how.

    `read` is what it was seen to read, `memory` the limit [MiB] that ended it, and `outside` tells
    whether something else than the method and its limits did.
    """

    def __init__(
        self,
        status: str,
        reason: str,
        *,
        read: Mapping[str, Any] | None = None,
        memory: float | None = None,
        outside: bool = False,
    ) -> None:
        super().__init__(reason)
        self.status = status
        self.read = read or {}
        self.memory = memory
        self.outside = outside


FROM_OUTSIDE = tuple(
    -getattr(signals, name)
    for name in ("SIGKILL", "SIGTERM", "SIGINT", "SIGHUP")
    if hasattr(signals, name)
)
"""How a process ends that somebody else ended: a user, a scheduler, a system without memory."""


def last_words(code: int | None) -> str:
    """Return the reason that an exit code gives for a process that answers no more."""
    if code is None:
        return "its process closed the connection"
    if code < 0:
        try:
            return f"its process was killed by {signals.Signals(-code).name}"
        except ValueError:
            return f"its process was killed by signal {-code}"
    return f"its process exited with code {code}"
