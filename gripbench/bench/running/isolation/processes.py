"""Starts and ends the processes of plug-ins: what each is started with, and all that it starts.

On Linux one starter a run's process forks them, an interpreter that was told where gripbench lies
and never runs a plug-in's code. Elsewhere each plug-in, for each cell, has an interpreter.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import gripbench
from gripbench.bench.running.isolation.confinement import end_tree
from gripbench.bench.running.isolation.landlock import landlock_version
from gripbench.bench.running.isolation.lines import LateError, Line
from gripbench.bench.running.isolation.messages import message_bytes, read_message
from gripbench.bench.running.isolation.outputs import Shown
from gripbench.envs.hidden_draws import VARIABLE as SECRET
from gripbench.envs.hidden_draws import salt
from gripbench.errors import GripbenchError, InputError, unknown

FORKS = sys.platform == "linux"
"""Whether processes of plug-ins are forked; elsewhere forking is not safe, or not there."""

STARTING = 120.0
"""Time [s] in which an empty interpreter has to start."""

SHOWING = 1.0
"""Time [s] that is waited for the last words of a method that has ended."""

START = """
import importlib.util, sys
package, forks, *places = sys.argv[1:]
sys.argv[1:] = []
sys.path.extend(place for place in places if place not in sys.path)
spec = importlib.util.spec_from_file_location(
    "gripbench", package + "/__init__.py", submodule_search_locations=[package]
)
sys.modules["gripbench"] = module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
from gripbench.bench.running.isolation.plugin_process import serve
serve(forks == "forks")
"""
"""What such an interpreter runs first: it takes gripbench from where this one has it."""

_KEPT = (
    "PATH", "HOME", "USER", "LOGNAME", "LANG", "LC_", "TZ", "TMPDIR", "TEMP", "TMP", "XDG_",
    "LD_LIBRARY_PATH", "DYLD_", "VIRTUAL_ENV", "CONDA_PREFIX", "NUMBA_", "OMP_", "OPENBLAS_",
    "MKL_", "CUDA_", "SYSTEMROOT", "SYSTEMDRIVE", "WINDIR", "COMSPEC", "APPDATA", "LOCALAPPDATA",
    "USERPROFILE", "PROGRAM",
)  # fmt: skip
"""Variables of the environment that a plug-in's process gets; what ends in `_` is a prefix."""


def environment() -> dict[str, str]:
    """Return the environment of a plug-in's process: nothing in it tells of the run."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if any(
            name.upper().startswith(item) if item.endswith("_") or item == "PROGRAM"
            else name.upper() == item
            for item in _KEPT
        )
    }  # fmt: skip
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        kept.setdefault(name, "1")
    kept["PYTHONHASHSEED"] = "0"  # sets of texts have one order in every run
    kept |= {"PYTHONUTF8": "1", "PYTHONCOERCECLOCALE": "0"}  # nor does the locale decide anything
    return kept


def _command(forks: bool) -> list[str]:
    package = str(Path(gripbench.__file__).resolve().parent)
    given = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    places = [os.path.abspath(place) for place in given if place]
    # -P: neither the current folder nor a script's own comes before the libraries.
    return [sys.executable, "-P", "-c", START, package, "forks" if forks else "-", *places]


BUBBLEWRAP = "bubblewrap"

SANDBOXES = ("", BUBBLEWRAP)
"""Kinds of sandboxes: the system's own means, or bubblewrap where it is installed."""

VARIABLE = "GRIPBENCH_SANDBOX"
"""Variable of the environment that names the kind of sandbox."""


def sandbox_kind(name: str) -> str:
    """Return a kind of sandbox that can be had here.

    Raises
    ------
    InputError
        If nobody knows it, or it is not installed.
    """
    if name not in SANDBOXES:
        raise unknown("sandbox", name, [BUBBLEWRAP])
    if name and (not FORKS or shutil.which("bwrap") is None):
        raise InputError(f"sandbox '{name}': needs Linux with the program 'bwrap' (bubblewrap)")
    return name


def choose_sandbox(name: str) -> None:
    """Have this process, and the workers that it starts, use a kind of sandbox from now on."""
    os.environ[VARIABLE] = sandbox_kind(name)


def _wrapped(command: list[str], folder: str) -> list[str]:
    """Return a command in bubblewrap: no network, no other processes, nothing can be written."""
    places = dict.fromkeys((folder, command[4], sys.prefix, sys.base_prefix, *command[6:]))
    bound = [item for place in places if Path(place).exists() for item in
             ("--ro-bind", place, place)]  # fmt: skip
    return [
        "bwrap", "--unshare-all", "--ro-bind", "/", "/", "--dev", "/dev", "--proc", "/proc",
        "--tmpfs", "/tmp", *bound, "--setenv", "NUMBA_CACHE_DIR", "/tmp/numba",
        "--setenv", "TMPDIR", "/tmp", "--chdir", "/", *command,
    ]  # fmt: skip


class PluginProcess:
    """A process that serves one plug-in.

    Attributes
    ----------
    line
        Where it answers.
    forks
        Whether it was forked and can itself fork.
    shared
        Whether it forks for each cell; otherwise it serves one cell and ends.
    alive
        Whether it has not been ended, nor has served its only cell.
    cell_code
        Exit code of the last cell's process, where it is known.
    """

    def __init__(self, line: Line, number: int, starter: _Starter | None) -> None:
        self.line, self.number = line, number
        self.forks = starter is not None
        self.shared = False
        self.alive = True
        self.cell_code: int | None = None
        self._busy = False
        self._starter = starter
        self._control: socket.socket | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._shown: Shown | None = None

    def open_cell(self, content: dict[str, Any]) -> Line:
        """Ask for a cell and return the line over which its samples go."""
        deadline = time.monotonic() + STARTING
        if not self.shared:
            self.alive = False
            self.line.send(content, deadline)
            return self.line
        assert self._control is not None
        self._busy = True
        requests, ours = os.pipe()
        theirs, replies = os.pipe()
        line = Line(theirs, ours, watched=self._control.fileno())
        try:
            message = message_bytes(content)
            with contextlib.suppress(OSError):  # it has ended: the line says so
                socket.send_fds(self._control, [message], [requests, replies])
        finally:
            os.close(requests)
            os.close(replies)
        return line

    def finish_cell(self, limit: float) -> bool:
        """Wait until the process of the last cell has ended; return whether it has.

        Parameters
        ----------
        limit
            Time [s] to wait at most.
        """
        if not self._busy:
            return True
        self._busy = False
        deadline = time.monotonic() + limit
        try:
            answer = read_message(lambda length: self.line.receive(length, deadline))
        except (LateError, EOFError, OSError, ValueError):
            return False
        code = answer.get("ended")
        self.cell_code = code if isinstance(code, int) else None
        return True

    def end(self, grace: float) -> int | None:
        """End it with all that it started; return its exit code.

        Parameters
        ----------
        grace
            Time [s] in which it may end by itself.
        """
        self.alive = False
        code: int | None = None
        if self._starter is not None:
            code = self._starter.end(self.number, grace)
        elif self._process is not None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(grace)
            end_tree(self.number)
            self._process.kill()
            code = self._process.wait()
        self.line.close()
        if self._control is not None:
            self._control.detach()
        if self._shown is not None:
            self._shown.finish(SHOWING)
        return code


class _Starter:
    """The interpreter that forks processes of plug-ins."""

    def __init__(self, kind: str, folder: str) -> None:
        command = _command(forks=True)
        ours, theirs = socket.socketpair()
        self._lock = threading.Lock()
        self._process = subprocess.Popen(
            _wrapped(command, folder or os.getcwd()) if sandbox_kind(kind) else command,
            stdin=theirs.fileno(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=environment(),
            start_new_session=True,
        )
        theirs.close()
        self._control = ours
        self._line = Line(ours.fileno(), ours.fileno())
        self.parent = os.getpid()
        self._check_start()

    def _check_start(self) -> None:
        try:
            self._receive(STARTING)
        except (LateError, EOFError, OSError, ValueError):
            self.close()
            raise GripbenchError(
                "a process for a method cannot be started: it exited with code "
                f"{self._process.returncode}"
            ) from None

    def start(self, shown: Shown | None) -> PluginProcess:
        ours, theirs = socket.socketpair()
        given = [theirs.fileno(), *([shown.write] if shown else [])]
        with self._lock:
            socket.send_fds(self._control, [message_bytes({"start": True})], given)
            answer = self._receive(STARTING)
        theirs.close()
        if shown is not None:
            os.close(shown.write)
        descriptor = ours.fileno()
        process = PluginProcess(Line(descriptor, descriptor), answer["process"], self)
        process._control, process._shown = ours, shown
        return process

    def end(self, number: int, grace: float) -> int | None:
        try:
            with self._lock:
                self._line.send({"end": number, "grace": grace}, time.monotonic() + STARTING)
                code = self._receive(STARTING).get("code")
        except (LateError, EOFError, OSError, ValueError):
            self.close()
            return None
        return code if isinstance(code, int) else None

    def close(self) -> None:
        """End it; it ends all that it has started."""
        with contextlib.suppress(OSError):
            self._control.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(5.0)
        end_tree(self._process.pid)
        self._process.wait()

    @property
    def alive(self) -> bool:
        return self._process.poll() is None and self.parent == os.getpid()

    def _receive(self, limit: float) -> dict[str, Any]:
        deadline = time.monotonic() + limit
        return read_message(lambda length: self._line.receive(length, deadline))


_starters: dict[tuple[str, str], _Starter] = {}
_lock = threading.Lock()


def start_plugin(kind: str = "", folder: str = "", name: str = "") -> PluginProcess:
    """Return a new process that waits for a plug-in to load.

    Parameters
    ----------
    kind
        Kind of sandbox, of `SANDBOXES`.
    folder
        The plug-in's folder, which it has to see.
    name
        What it prints is shown on standard error under this name; empty: it is not.

    Raises
    ------
    GripbenchError
        If no interpreter can be started.
    InputError
        If seeds are hidden and a method could find the secret here.
    """
    if salt() and not kind and not landlock_version():
        raise InputError(
            f"{SECRET} is set, and this system cannot keep a method from reading it in the memory "
            "of this process: use Linux with Landlock (5.13), or --sandbox bubblewrap"
        )
    shown = Shown(name) if name else None
    if sandbox_kind(kind) == "" and not FORKS:
        return _alone(shown)
    serves = (kind, folder if kind else "")
    with _lock:
        starter = _starters.get(serves)
        if starter is None or not starter.alive:
            starter = _starters[serves] = _Starter(kind, folder)
        return starter.start(shown)


def _alone(shown: Shown | None) -> PluginProcess:
    """Return an interpreter that serves one plug-in and one cell."""
    child = subprocess.Popen(
        _command(forks=False),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=shown.write if shown else subprocess.DEVNULL,
        env=environment(),
    )
    if shown is not None:
        os.close(shown.write)
    assert child.stdin is not None
    assert child.stdout is not None
    read, write = os.dup(child.stdout.fileno()), os.dup(child.stdin.fileno())
    child.stdin.close()
    child.stdout.close()
    line = Line(read, write)
    deadline = time.monotonic() + STARTING
    process = PluginProcess(line, child.pid, None)
    process._process, process._shown = child, shown
    try:
        read_message(lambda length: line.receive(length, deadline))
    except (LateError, EOFError, OSError, ValueError):
        code = process.end(grace=1.0)
        raise GripbenchError(
            f"a process for a method cannot be started: it exited with code {code}"
        ) from None
    return process


def stop_starters() -> None:
    """End the starter of this process, if it has one."""
    with _lock:
        while _starters:
            _starters.popitem()[1].close()
