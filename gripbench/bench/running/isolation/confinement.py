"""What a plug-in's process is kept from, on systems that can: limits in, a confined process out.

Linux: address space and core files are limited; the process ends with the one that started it; it
may neither trace nor signal processes outside (Landlock), so that it cannot read what the run
holds in memory. Elsewhere these do nothing.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal as signals
import struct
import sys
import time
from collections.abc import Collection

import psutil

_SET_DEATH_SIGNAL, _SET_SUBREAPER, _SET_NO_NEW_PRIVILEGES = 1, 36, 38
_CREATE_RULESET, _RESTRICT_SELF = 444, 446
_MAKE_BLOCK_DEVICE = 1 << 11
_SCOPE_SIGNALS = 2


def confine(memory: int) -> None:
    """Limit what this process, and all that it starts, may take and reach.

    Parameters
    ----------
    memory
        Address space [bytes] beyond what it has now.
    """
    _limit_memory(memory)
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):
            _enter_landlock()


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


def part_from_parent() -> None:
    """Keep this process from the memory of the confined one that forked it (Linux)."""
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):
            _enter_landlock(signals_too=False)


def _enter_landlock(signals_too: bool = True) -> None:
    """Enter a domain of its own: the kernel then refuses to trace or signal what is outside."""
    library = ctypes.CDLL(None, use_errno=True)
    version = library.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), 1)
    if version < 1:
        return
    scopes = _SCOPE_SIGNALS if version >= 6 and signals_too else 0
    # A ruleset has to handle something: making block devices, which no method does.
    attributes = struct.pack("=QQQ", _MAKE_BLOCK_DEVICE, 0, scopes)
    size = 24 if version >= 6 else 8
    buffer = ctypes.create_string_buffer(attributes)
    ruleset = library.syscall(_CREATE_RULESET, buffer, ctypes.c_size_t(size), 0)
    if ruleset < 0:
        return
    library.prctl(_SET_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    library.syscall(_RESTRICT_SELF, ruleset, 0)
    os.close(ruleset)


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
