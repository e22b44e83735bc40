"""A program that speaks JSON lines, or records, over its standard input and output as a method.

One line or record each way a sample, so the program never holds a sample of the future. The page
`docs/foreign.md` has the protocol with an example.
"""

from __future__ import annotations

import contextlib
import json
import os
import struct
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from gripbench.errors import LONGEST, GripbenchError, one_line, unknown
from gripbench.methods.foreign.declared import ForeignMethod

_PIECE = 65536


class Program(ForeignMethod):
    """A method in a program of its own.

    Attributes
    ----------
    command
        The program and its arguments. An argument that is a file beside the method's own is given
        by its whole path, and its content is part of every row's key; what else the program reads
        nobody sees, so its rows are never used again.
    protocol
        `json`: a line of JSON a sample. `records`: after the first line and its answer a sample is
        its channels and `time` as float64 of this machine's byte order, NaN where one is missing,
        and the answer the estimates, then the variances, alike.
    """

    command: ClassVar[tuple[str, ...]]
    protocol: ClassVar[str] = "json"

    def __init__(self, variant: str = "", **overrides: Any) -> None:
        super().__init__(variant, **overrides)
        if self.protocol not in ("json", "records"):
            raise unknown(f"protocol of {self.name}", str(self.protocol), ("json", "records"))
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def files(self) -> tuple[str, ...]:
        """The files of the command."""
        return tuple(
            word
            for word in self.command
            if not Path(word).is_absolute() and self.place(word).is_file()
        )

    def reset(self, vehicle: Mapping[str, float], dt: float) -> None:
        """Start the program afresh and tell it the vehicle."""
        self._end()
        words = [str(self.place(word)) if word in self.files else word for word in self.command]
        try:
            self._process = subprocess.Popen(
                words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
            )
        except OSError as error:
            raise GripbenchError(
                f"{words[0]}: cannot be started: {(error.strerror or str(error)).lower()}"
            ) from None
        hello = {
            "vehicle": self.paper(vehicle),
            "settings": self.numbers(),
            "step": dt,
            "sensors": self.sensors,
            "estimates": self.outputs,
        }
        if self.protocol != "json":
            hello["protocol"] = self.protocol
        self._left = b""
        answer = self._answered(json.dumps(hello, allow_nan=False))
        if answer.get("ready") is not True:
            raise GripbenchError(f'{self.command[0]}: answered no {{"ready": true}} at the start')
        names = (json.dumps(name) for name in (*self.sensors, "time"))
        self._line = "{" + ", ".join(f"{name}: %s" for name in names) + "}"  # of a sample
        self._sample = struct.Struct(f"={len(self.sensors) + 1}d")
        self._answer = struct.Struct(f"={len(self.outputs)}d")

    def update(self, obs: Mapping[str, float]) -> dict[str, Any]:
        """Take one sample and return the estimates."""
        if self._process is None:
            raise GripbenchError(f"{self.name}: call reset(vehicle, dt) before update(obs)")
        if self.protocol == "records":
            values = [obs[name] for name in self.sensors]
            content = self._exchange(self._sample.pack(*values, obs["time"]), self._answer.size)
            return dict(zip(self.outputs, self._answer.unpack(content), strict=True))
        texts = [self._number(obs[name]) for name in self.sensors]
        return self._answered(self._line % (*texts, self._number(obs["time"])))

    def _number(self, value: float) -> str:
        number = float(value)
        if number - number == 0.0:
            return repr(number)
        if number != number:
            return "null"
        raise GripbenchError(f"{self.name}: a sample cannot be sent: it holds {number}")

    def _exchange(self, content: bytes, size: int) -> bytes:
        """Send bytes; return so many, or a line where `size` is 0, of what comes back."""
        process, found = self._process, self._left
        assert process is not None
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            read = process.stdout.fileno()
            if process.stdin.write(content) != len(content):
                raise GripbenchError(f"{self.command[0]}: does not read its input")
            while len(found) < size if size else b"\n" not in found:
                more = os.read(read, _PIECE)
                if not more:
                    raise OSError
                found += more
        except OSError:
            code = process.wait()
            raise GripbenchError(f"{self.command[0]}: ended with exit code {code}") from None
        end = size or found.index(b"\n") + 1
        self._left = found[end:]
        return found[:end]

    def _answered(self, text: str) -> dict[str, Any]:
        """Send a line and return the answer to it."""
        line = self._exchange(text.encode() + b"\n", 0)
        try:
            answer = json.loads(line)
        except ValueError:
            answer = None
        if not isinstance(answer, dict):
            text = one_line(line.decode("utf-8", "replace").strip(), LONGEST // 4)
            raise GripbenchError(f"{self.command[0]}: answered {text!r}, which is no JSON object")
        return answer

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
        try:
            process.wait(1.0)  # its input has ended
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def __del__(self) -> None:
        if getattr(self, "_process", None) is not None:
            self._end()

    def __getstate__(self) -> dict[str, Any]:
        """Return what can be stored: the settings; a copy starts with `reset`."""
        return {"settings": self.settings}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.settings = state["settings"]
        self._process = None
