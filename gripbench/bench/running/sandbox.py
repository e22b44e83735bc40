"""The cage: a process of its own for a method that did not ship with gripbench.

The process loads the method, takes one recording after the other and answers with estimates. It
is killed when a limit of time is passed, and cannot take more memory than allowed; whatever the
method does to it (an endless loop, `os._exit`, a segmentation fault), only the cell that it was
working on is lost, and the next cell gets a new process.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import random
import signal as signals
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection, Pipe
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.catalogue.declarations import (
    Declaration,
    Source,
    declaration_of,
    describe_error,
)
from gripbench.bench.running.execution import Outcome, SkippedError, execute
from gripbench.errors import GripbenchError, InputError


@dataclass(frozen=True)
class Limits:
    """What one cell of an isolated method may take.

    Attributes
    ----------
    time
        Wall-clock time [s], loading included.
    memory
        Memory [bytes] beyond what the empty process has.
    """

    time: float = 60.0
    memory: int = 2 * 1024**3


class CellFailure(GripbenchError):  # noqa: N818 - a result of a cell, not a mistake of the harness
    """A method failed; `status` says how."""

    def __init__(self, status: str, reason: str) -> None:
        super().__init__(reason)
        self.status = status


class Cage:
    """A process that runs one method.

    Parameters
    ----------
    limits
        What a cell may take.
    """

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None

    def declare(self, source: Source, variant: str, parameters: dict[str, Any]) -> Declaration:
        """Return what a method declares."""
        answer: Declaration = self._ask("declare", source, variant, parameters)
        return answer

    def execute(
        self,
        source: Source,
        declaration: Declaration,
        variant: str,
        parameters: dict[str, Any],
        vehicle: dict[str, float],
        observations: npt.NDArray[Any],
        period: float,
        seed: int,
    ) -> Outcome:
        """Run a method over a recording.

        Raises
        ------
        CellFailure
            With status `failed`, `timeout` or `skipped` and the reason.
        """
        answer: Outcome = self._ask(
            "execute", source, declaration, variant, parameters, vehicle, observations, period, seed
        )
        return answer

    def close(self) -> None:
        """End the process."""
        if self._connection is not None:
            self._connection.close()
        if self._process is not None:
            with contextlib.suppress(OSError):
                self._process.kill()
            self._process.wait()
        self._process = self._connection = None

    def _ask(self, *request: Any) -> Any:
        if self._process is None:
            self._start()
        deadline = time.monotonic() + self.limits.time
        connection = self._connection
        assert connection is not None
        try:
            # Sending may block on a process that no longer reads: it counts against the limit.
            with _Alarm(self, self.limits.time) as alarm:
                connection.send((list(sys.path), request))
                ready = connection.poll(max(deadline - time.monotonic(), 0.0))
                answer = connection.recv() if ready else None
            if alarm.rang or not ready:
                self.close()
                raise CellFailure(
                    "timeout", f"stopped after the time limit of {self.limits.time:g} s"
                )
        except (EOFError, OSError):
            rang = alarm.rang
            reason = self._last_words()
            self.close()
            if rang:
                raise CellFailure(
                    "timeout", f"stopped after the time limit of {self.limits.time:g} s"
                ) from None
            raise CellFailure("failed", reason) from None
        except CellFailure:
            raise
        except Exception as error:  # an answer that cannot be read
            self.close()
            raise CellFailure("failed", f"its answer cannot be read: {error}") from None
        status, content = answer  # type: ignore[misc]
        if status == "out of memory":
            self.close()  # what it holds may never be given back
            limit = self.limits.memory / 1024**2
            raise CellFailure("failed", f"out of memory (limit {limit:.0f} MiB)")
        if status != "ok":
            raise CellFailure(status, content)
        return content

    def _start(self) -> None:
        ours, theirs = Pipe()
        environment = dict(os.environ)
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
            environment.setdefault(name, "1")
        self._process = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "gripbench.bench.running.sandbox",
                str(theirs.fileno()),
                str(os.getpid()),
            ],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=environment,
        )
        theirs.close()
        self._connection = ours
        ours.send(self.limits.memory)
        # Until it is ready it runs no code of a method: that time is nobody's.
        with contextlib.suppress(EOFError, OSError):
            if ours.poll(_START):
                ours.recv()
                return
        reason = self._last_words()
        self.close()
        raise GripbenchError(f"a process for a method cannot be started: {reason}")

    def _last_words(self) -> str:
        """Return how the process ended."""
        assert self._process is not None
        try:
            code = self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            return "its process closed the connection"
        if code < 0:
            with contextlib.suppress(ValueError):
                return f"its process was killed by {signals.Signals(-code).name}"
            return f"its process was killed by signal {-code}"
        return f"its process exited with code {code}"


class _Alarm:
    """Kills a cage's process when a limit is passed, also while a pipe blocks."""

    def __init__(self, cage: Cage, limit: float) -> None:
        self.rang = False
        self._cage = cage
        self._timer = threading.Timer(limit + 0.5, self._ring)
        self._timer.daemon = True

    def __enter__(self) -> _Alarm:
        self._timer.start()
        return self

    def __exit__(self, *details: object) -> None:
        self._timer.cancel()

    def _ring(self) -> None:
        self.rang = True
        process = self._cage._process
        if process is not None:
            with contextlib.suppress(OSError):
                process.kill()


_START = 120.0
"""Time [s] in which an empty process has to start."""

_declaring = Cage(Limits())


def declare(source: Source, variant: str, parameters: dict[str, Any]) -> Declaration:
    """Return what a method declares, without running its code in this process.

    Raises
    ------
    InputError
        If it cannot be loaded, or declares what is not possible.
    """
    try:
        return _declaring.declare(source, variant, parameters)
    except CellFailure as error:
        text = str(error)
        place = source.target.rstrip(":")
        raise InputError(text if place.split(":")[0] in text else f"{place}: {text}") from None


def end_declaring() -> None:
    """End the process in which methods declare themselves; the next one gets a new process."""
    _declaring.close()


def _serve(descriptor: int, parent: int) -> None:
    """Answer requests until the parent goes away."""
    connection = Connection(descriptor)
    _die_with(parent)
    _limit_memory(connection.recv())
    connection.send("ready")
    while True:
        try:
            path, request = connection.recv()
        except (EOFError, OSError):
            return
        sys.path.extend(place for place in path if place not in sys.path)
        answer = _answer(request)
        try:
            connection.send(answer)
        except MemoryError:
            connection.send(("out of memory", ""))
        except Exception as error:  # what it answers with cannot be pickled
            connection.send(("failed", describe_error(error)))


def _answer(request: tuple[Any, ...]) -> tuple[str, Any]:
    try:
        if request[0] == "declare":
            _, source, variant, parameters = request
            return "ok", declaration_of(source.make(variant, parameters), variant, parameters)
        _, source, declaration, variant, parameters, vehicle, observations, period, seed = request
        # A method may draw from the global generators: the same numbers in any order of cells.
        random.seed(seed)
        np.random.seed(seed % 2**32)  # noqa: NPY002
        method = source.make(variant, parameters)
        outcome = execute(method, declaration, vehicle, observations, period, timed=True)
        estimates = np.asarray(outcome.estimates)
        return "ok", Outcome(estimates, outcome.runtime)
    except SkippedError as error:
        return "skipped", str(error)
    except MemoryError:
        return "out of memory", ""
    except BaseException as error:  # SystemExit too: the process goes on to the next cell
        return "failed", describe_error(error)


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


def _die_with(parent: int) -> None:
    """Ask Linux to kill this process with its parent, however that one ends."""
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(1, signals.SIGKILL)
    if os.getppid() != parent:  # it ended before
        os._exit(1)


if __name__ == "__main__":
    _serve(int(sys.argv[1]), int(sys.argv[2]))
