"""A limit of time for code of this process: seconds in, an error in the code that passes them.

A thread sleeps until the time is over and then raises the error where the code is, in any thread
and on any system; until then it costs one sleeping thread. What is compiled is interrupted when
it returns, so compiled loops without a bound of their own must return now and then. Compilation
does not count.
"""

from __future__ import annotations

import contextlib
import ctypes
import threading
import time
from collections.abc import Iterator
from typing import Any

from numba.core import event

from gripbench.errors import GripbenchError


class DeadlineError(GripbenchError):
    """The time is over."""


@contextlib.contextmanager
def deadline(limit: float) -> Iterator[None]:
    """Raise `DeadlineError` in the block when it has taken longer than a limit [s].

    Raises
    ------
    DeadlineError
        In the block, at the next step of Python code after the limit.
    """
    clock = _Clock()
    watch = _Watch(threading.get_ident(), limit, clock)
    with event.install_listener("numba:compile", clock):
        watch.start()
        try:
            yield
        finally:
            watch.end()


class _Clock(event.Listener):
    """Time [s] that the calling code has taken, without that of compilation."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._compiled = 0.0
        self._depth = 0
        self._since = 0.0

    def on_start(self, event: Any) -> None:
        """Stop the clock: a compilation begins, or one inside another."""
        if self._depth == 0:
            self._since = time.monotonic()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        """Let the clock go on."""
        self._depth -= 1
        if self._depth == 0:
            self._compiled += time.monotonic() - self._since

    def taken(self) -> float:
        now = self._since if self._depth else time.monotonic()
        return now - self._began - self._compiled

    @property
    def stands(self) -> bool:
        return self._depth > 0


class _Watch:
    """The sleeping thread."""

    def __init__(self, thread: int, limit: float, clock: _Clock) -> None:
        self._thread, self._limit, self._clock = thread, limit, clock
        self._ended = threading.Event()
        self._lock = threading.Lock()
        self._rang = False
        self._watch = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        self._watch.start()

    def end(self) -> None:
        """Stop watching; an error still on its way to the thread arrives here and goes no further.

        It must not hit later code: the code of the block had ended in time.
        """
        while not self._ended.is_set():
            with contextlib.suppress(DeadlineError), self._lock:
                self._ended.set()
        if self._rang:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self._thread), None)

    def _run(self) -> None:
        wait = self._limit
        while not self._ended.wait(max(wait, _AGAIN)):
            wait = self._limit - self._clock.taken()
            if self._clock.stands or wait > 0.0:
                continue
            with self._lock:
                if not self._ended.is_set():  # again and again: the code may catch everything
                    self._rang = True
                    _raise_in(self._thread)


_AGAIN = 0.05
"""Time [s] between two looks at the clock at least."""


def _raise_in(thread: int) -> None:
    ctypes.pythonapi.PyThreadState_SetAsyncExc(
        ctypes.c_ulong(thread), ctypes.py_object(DeadlineError)
    )
