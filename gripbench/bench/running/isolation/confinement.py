"""What a plug-in's process is kept from, on systems that can: limits in, a confined process out.

Linux: address space and core files are limited; the process ends with the one that started it; it
may neither trace nor signal processes outside, nor read the results, nor, once it is given samples,
write any file but its own (`landlock`). Elsewhere these do nothing.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal as signals
import time
from collections.abc import Collection

import psutil

from gripbench.bench.running.isolation.landlock import (
    drop_powers,
    enter_domain,
    refuse_kept_memory,
)

_SET_DEATH_SIGNAL, _SET_SUBREAPER = 1, 36


def confine(memory: int, closed: tuple[str, tuple[str, ...]] | None) -> None:
    """Limit what this process, and all that it starts, may take and reach.

    Parameters
    ----------
    memory
        Address space [bytes] beyond what it has now.
    closed
        A folder and names in it of what it cannot read.
    """
    _limit_memory(memory)
    with contextlib.suppress(OSError, AttributeError):
        drop_powers()
        enter_domain(closed)
        refuse_kept_memory()


def _limit_memory(memory: int) -> None:
    try:
        import resource
    except ImportError:  # not on this system
        return
    with contextlib.suppress(OSError, ValueError):
        with open("/proc/self/statm", encoding="ascii") as file:
            used = int(file.read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + memory, used + memory))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def part_from_parent(scratch: str) -> None:
    """Keep the process of a cell from the one that forked it, and from every file but its own.

    Parameters
    ----------
    scratch
        Folder below which alone it may write, make and remove files.
    """
    with contextlib.suppress(OSError, AttributeError):
        enter_domain(writable=[scratch], scoped=False)


def end_with(parent: int | None) -> None:
    """End this process with its parent, and inherit its orphans (Linux).

    Parameters
    ----------
    parent
        Number of the parent; None: another sign says when to end.
    """
    with contextlib.suppress(OSError, AttributeError):
        library = ctypes.CDLL(None)
        library.prctl(_SET_SUBREAPER, 1, 0, 0, 0)
        if parent is not None:
            library.prctl(_SET_DEATH_SIGNAL, signals.SIGKILL, 0, 0, 0)
    if parent is not None and os.getppid() != parent:  # it ended before
        os._exit(1)


def end_children(keep: Collection[int] = ()) -> dict[int, int]:
    """Kill every process below this one; return the exit codes of its own children.

    Parameters
    ----------
    keep
        Children that go on, with all that they started.
    """
    codes: dict[int, int] = {}
    this: psutil.Process | None = None
    while True:
        if not keep:
            try:
                ended, status = os.waitpid(-1, os.WNOHANG)
            except ChildProcessError:
                return codes
            if ended:
                codes[ended] = os.waitstatus_to_exitcode(status)
                continue
        this = this or psutil.Process()
        children = [child for child in this.children() if child.pid not in keep]
        if not children:
            return codes
        for child in children:
            for process in (*_below(child), child):
                with contextlib.suppress(psutil.Error):
                    process.kill()
            with contextlib.suppress(ChildProcessError):
                ended, status = os.waitpid(child.pid, os.WNOHANG)
                if ended:
                    codes[ended] = os.waitstatus_to_exitcode(status)
        time.sleep(0.001)


def _below(process: psutil.Process) -> list[psutil.Process]:
    try:
        return process.children(recursive=True)
    except psutil.Error:
        return []


def end_tree(process: int) -> None:
    """Kill a process and everything below it that its system still counts as such."""
    with contextlib.suppress(psutil.Error):
        root = psutil.Process(process)
        for item in (*_below(root), root):
            with contextlib.suppress(psutil.Error):
                item.kill()
