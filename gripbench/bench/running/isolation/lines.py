"""Bytes to and from a process that may never answer: each call has a deadline and ends by it."""

from __future__ import annotations

import contextlib
import os
import queue
import select
import threading
import time
from typing import Any

from gripbench.bench.running.isolation.messages import message_bytes, read_message


class LateError(Exception):
    """The deadline passed."""


class Line:
    """Two file descriptors, out and in.

    Parameters
    ----------
    read, write
        Descriptors; the same one for a socket.
    watched
        A descriptor that becomes readable when the other side has ended; -1: none.

    Raises
    ------
    LateError
        By every call that passes its deadline.
    EOFError
        By every call that finds that the other side has ended.
    """

    def __init__(self, read: int, write: int, watched: int = -1) -> None:
        self._read, self._write = read, write
        self._watched = watched
        self._pump: _Pump | None = None
        if not hasattr(select, "poll"):  # Windows cannot wait for a pipe
            self._pump = _Pump(read)
            return
        os.set_blocking(write, False)
        os.set_blocking(read, False)
        self._poll = select.poll()
        self._poll.register(read, select.POLLIN)
        if watched >= 0:
            self._poll.register(watched, select.POLLIN)

    def receive(self, size: int, deadline: float) -> bytes:
        """Return exactly so many bytes."""
        content = self._some(size, deadline)
        while len(content) < size:
            content += self._some(size - len(content), deadline)
        return content

    def put(self, content: bytes, deadline: float) -> None:
        """Write bytes."""
        if self._pump is not None:
            self._pump.put(self._write, content, deadline)
            return
        view = memoryview(content)
        while view:
            try:
                view = view[os.write(self._write, view) :]
            except BlockingIOError:
                self._wait_for_room(deadline)
            except BrokenPipeError:
                raise EOFError from None

    def send(self, content: dict[str, Any], deadline: float) -> None:
        """Write a message."""
        self.put(message_bytes(content), deadline)

    def rest(self, deadline: float) -> bytes:
        """Return what comes before the other side closes; stops after the first bytes."""
        try:
            return self._some(1, deadline, watch=False)
        except EOFError:
            return b""

    def close(self) -> None:
        """Close both descriptors."""
        for descriptor in {self._read, self._write}:
            with contextlib.suppress(OSError):
                os.close(descriptor)

    def _some(self, size: int, deadline: float, watch: bool = True) -> bytes:
        if self._pump is not None:
            return self._pump.receive(size, deadline)
        while True:
            ready = self._poll.poll(max(deadline - time.monotonic(), 0.0) * 1e3)
            if not ready:
                raise LateError
            if ready[0][0] != self._read:
                if watch:
                    raise EOFError
                self._poll.unregister(self._watched)
                continue
            try:
                content = os.read(self._read, size)
            except BlockingIOError:
                continue
            except ConnectionResetError:
                raise EOFError from None
            if not content:
                raise EOFError
            return content

    def _wait_for_room(self, deadline: float) -> None:
        room = select.poll()
        room.register(self._write, select.POLLOUT)
        if not room.poll(max(deadline - time.monotonic(), 0.0) * 1e3):
            raise LateError


class _Pump:
    """Reads in a thread, for systems that cannot wait for a pipe."""

    def __init__(self, read: int) -> None:
        self._content: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._left = b""
        threading.Thread(target=self._work, args=(read,), daemon=True).start()

    def _work(self, read: int) -> None:
        content = b"-"
        while content:
            try:
                content = os.read(read, 65536)
            except OSError:
                content = b""
            self._content.put(content)

    def receive(self, size: int, deadline: float) -> bytes:
        if not self._left:
            try:
                self._left = self._content.get(timeout=max(deadline - time.monotonic(), 0.0))
            except queue.Empty:
                raise LateError from None
        if not self._left:
            self._content.put(b"")
            raise EOFError
        content, self._left = self._left[:size], self._left[size:]
        return content

    @staticmethod
    def put(write: int, content: bytes, deadline: float) -> None:
        late: list[bool] = []

        def write_all() -> None:
            view = memoryview(content)
            with contextlib.suppress(OSError):
                while view:
                    view = view[os.write(write, view) :]
            late.append(False)

        if len(content) <= 4096:  # lock-step: the pipe is empty
            write_all()
            return
        thread = threading.Thread(target=write_all, daemon=True)
        thread.start()
        thread.join(max(deadline - time.monotonic(), 0.0))
        if not late:
            raise LateError


class ServedLine:
    """Two file descriptors, in and out; the other side's end ends this process."""

    def __init__(self, read: int, write: int) -> None:
        self.read, self.write = read, write

    def receive(self, size: int) -> bytes:
        """Return exactly so many bytes."""
        content = os.read(self.read, size)
        if len(content) == size:
            return content
        parts, left = [content], size - len(content)
        while left:
            parts.append(os.read(self.read, left))
            left -= len(parts[-1])
            if not parts[-1]:
                os._exit(0)
        return b"".join(parts)

    def message(self) -> dict[str, Any]:
        """Return the next message."""
        return read_message(self.receive)

    def send(self, content: dict[str, Any]) -> None:
        """Write a message."""
        self.put(message_bytes(content))

    def put(self, content: bytes) -> None:
        """Write bytes."""
        view = memoryview(content)
        while view:
            view = view[os.write(self.write, view) :]

    def close(self) -> None:
        """Close both descriptors."""
        for descriptor in {self.read, self.write}:
            os.close(descriptor)
