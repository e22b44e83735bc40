"""A program that speaks JSON lines over its standard input and output as a method.

One line each way a sample, so the program never holds a sample of the future. The page
`docs/foreign.md` has the protocol with an example.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from gripbench.errors import LONGEST, GripbenchError, one_line
from gripbench.methods.foreign.declared import ForeignMethod


class Program(ForeignMethod):
    """A method in a program of its own.

    Attributes
    ----------
    command
        The program and its arguments. An argument that is a file beside the method's own is given
        by its whole path, and its content is part of every row's key; what else the program reads
        nobody sees, so its rows are never used again.
    """

    command: ClassVar[tuple[str, ...]]

    def __init__(self, variant: str = "", **overrides: Any) -> None:
        super().__init__(variant, **overrides)
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
                words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=-1
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
        answer = self._ask(hello)
        if answer.get("ready") is not True:
            raise GripbenchError(f'{self.command[0]}: answered no {{"ready": true}} at the start')

    def update(self, obs: Mapping[str, float]) -> dict[str, Any]:
        """Take one sample and return the estimates."""
        given = {name: obs[name] for name in (*self.sensors, "time")}
        return self._ask({key: value if value == value else None for key, value in given.items()})

    def _ask(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """Send a line and return the answer to it."""
        process = self._process
        if process is None or process.stdin is None or process.stdout is None:
            raise GripbenchError(f"{self.name}: call reset(vehicle, dt) before update(obs)")
        try:
            process.stdin.write(json.dumps(content, allow_nan=False).encode() + b"\n")
            process.stdin.flush()
            line = process.stdout.readline()
        except OSError:
            line = b""
        except ValueError as error:
            raise GripbenchError(f"{self.name}: a sample cannot be sent: {error}") from None
        if not line.endswith(b"\n"):
            code = process.wait()
            raise GripbenchError(f"{self.command[0]}: ended with exit code {code}")
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
