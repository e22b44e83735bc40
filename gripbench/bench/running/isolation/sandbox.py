"""The sandbox: runs a method that did not ship with gripbench in a confined process of its own.

A recording goes in sample by sample, each when the estimates of the one before have come back, so
that no method holds a sample of the future; estimates come out, or the reason why there are none.
Whatever the method does to its process (an endless loop, `os._exit`, a segmentation fault), only
the cell that it was working on is lost. `plugin_process` is the other side.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from gripbench.bench.catalogue.declarations import Declaration, Source, declaration_from
from gripbench.bench.running.execution import Outcome, runtime_of
from gripbench.bench.running.isolation.limits import (
    FROM_OUTSIDE,
    CellFailure,
    Limits,
    last_words,
)
from gripbench.bench.running.isolation.lines import LateError, Line
from gripbench.bench.running.isolation.loading import (
    Loaded,
    Settings,
    generator_seed,
    loading_message,
    read_by,
    scratch_folder,
)
from gripbench.bench.running.isolation.messages import (
    ESTIMATES,
    FAILURE,
    FINISHED,
    HEADER,
    read_message,
    reply_type,
    requests_of,
)
from gripbench.bench.running.isolation.prefixes import LooksAheadError, run_over_prefixes
from gripbench.bench.running.isolation.processes import PluginProcess, start_plugin
from gripbench.envs.signals import record_type
from gripbench.errors import LONGEST, InputError, one_line
from gripbench.methods.samples import select_channels

LOADING = 60.0
"""Time [s] that loading and compiling a plug-in may take; no cell's limit counts it."""

ENDING = 10.0
"""Time [s] in which a process that has said that it is done has to end."""


class Sandbox:
    """Processes of plug-ins, one after the other: the last one that was asked for is kept.

    Parameters
    ----------
    limits
        What a cell may take.
    bounds
        Whether numba compiles with bounds checking.
    """

    def __init__(self, limits: Limits, bounds: bool = False) -> None:
        self.limits = limits
        self._bounds = bounds
        self._process: PluginProcess | None = None
        self._loaded: tuple[Settings, Loaded] | None = None
        self._read: dict[str, Any] = {}
        self._scratch = ""

    def declare(self, source: Source, variant: str, parameters: dict[str, Any]) -> Declaration:
        """Return what a method declares.

        Raises
        ------
        CellFailure
            If it cannot be loaded.
        """
        return self.load(Settings(source, variant, parameters)).declaration

    def execute(
        self,
        source: Source,
        declaration: Declaration,
        variant: str,
        parameters: dict[str, Any],
        vehicle: Mapping[str, float],
        observations: npt.NDArray[Any],
        period: float,
        state: bytes = b"",
    ) -> Outcome:
        """Run a method over a recording.

        Parameters
        ----------
        source, variant, parameters
            The method.
        declaration
            What it declared before; it must declare the same now.
        vehicle
            Vehicle parameters by name.
        observations
            Structured array, shape (n,), with at least the declared channels and `time`.
        period
            Nominal time [s] between samples.
        state
            What its `fit` returned, packed.

        Raises
        ------
        CellFailure
            With status `failed`, `timeout` or `skipped` and the reason.
        """
        settings = Settings(source, variant, parameters, state)
        loaded = self.load(settings)
        found = loaded.declaration
        if (found.sensors, found.outputs) != (declaration.sensors, declaration.outputs):
            raise CellFailure("failed", "it declares other sensors or estimates than before")
        selected = select_channels(observations, found.sensors)
        if loaded.online:
            return self._run(found, vehicle, selected, period)
        try:
            estimates, batch = run_over_prefixes(
                partial(self.perform, settings), vehicle, selected, period
            )
        except LooksAheadError as error:
            raise CellFailure("failed", str(error), read=self._read) from None
        runtime = runtime_of(np.empty(0), period, batch)
        return Outcome(estimates, runtime, self._read, over_prefixes=True)

    def close(self) -> None:
        """End the process and everything that it started."""
        process, self._process, self._loaded = self._process, None, None
        if process is not None:
            process.end(grace=0.0)
        if self._scratch:
            shutil.rmtree(self._scratch, ignore_errors=True)

    def load(self, settings: Settings) -> Loaded:
        """Load a plug-in, unless it is the one that is there.

        Raises
        ------
        CellFailure
            If it cannot be loaded.
        """
        if self._process is not None and self._loaded is not None and self._process.alive:
            before, loaded = self._loaded
            if before == settings:
                return loaded
        self.close()
        self._scratch = scratch_folder()
        message = loading_message(settings, self.limits, self._bounds, self._scratch)
        name = Path(settings.source.target.rstrip(":")).name if self.limits.show else ""
        self._process = process = start_plugin(self.limits.sandbox, message["folder"], name)
        line, limit = process.line, max(self.limits.time, LOADING)
        deadline = time.monotonic() + limit
        answer = self._answer(line, deadline, limit, message, settings.state)
        try:
            loaded = Loaded(
                declaration_from(answer["declaration"]),
                answer.get("batch") is True,
                answer.get("online") is True,
                {str(name): str(text) for name, text in dict(answer["expected"]).items()},
            )
        except (KeyError, TypeError, ValueError, InputError) as error:
            self.close()
            raise CellFailure("failed", f"its declaration cannot be read: {error}") from None
        process.shared = process.forks and answer.get("shared") is True
        self._loaded = (settings, loaded)
        self._read = read_by(answer)
        return loaded

    def perform(
        self,
        settings: Settings,
        form: str,
        vehicle: Mapping[str, float],
        observations: npt.NDArray[Any],
        period: float,
    ) -> list[npt.NDArray[Any]]:
        """Return the estimates of a trial, for checks; see `trials.perform`.

        Raises
        ------
        CellFailure
            As `execute`.
        """
        declaration = self.load(settings).declaration
        selected = select_channels(observations, declaration.sensors)
        kind = record_type(declaration.outputs)
        process, limit = self._process, self.limits.time
        assert process is not None
        deadline = time.monotonic() + limit
        content = {
            "trial": form,
            "vehicle": dict(vehicle),
            "period": period,
            "samples": len(selected),
            "seed": generator_seed(declaration, selected),
        }
        line = process.open_cell(content)
        try:
            line.put(selected.tobytes(), deadline)
            answer = self._answer(line, deadline, limit)
            self._read = read_by(answer) or self._read
            lengths = answer.get("lengths")
            if not isinstance(lengths, list) or len(lengths) > 2:
                raise ValueError("no trial")
            found = []
            for length in lengths:
                if not isinstance(length, int) or not 0 < length <= len(selected):
                    raise ValueError(f"estimates of {length} samples")
                content_of = line.receive(length * kind.itemsize, deadline)
                found.append(np.frombuffer(content_of, kind).copy())
            return found
        except (LateError, EOFError, OSError) as error:
            self._lost(error, limit)
            raise
        except ValueError as error:
            self.close()
            raise CellFailure("failed", f"its answer cannot be read: {error}") from None
        finally:
            self._end_cell(process, line)

    def _end_cell(self, process: PluginProcess, line: Line) -> None:
        if process.shared:
            line.close()
            if process.alive and not process.finish_cell(ENDING):
                self.close()
        else:
            self.close()

    def _run(
        self,
        declaration: Declaration,
        vehicle: Mapping[str, float],
        observations: npt.NDArray[Any],
        period: float,
    ) -> Outcome:
        process = self._process
        assert process is not None
        limit = self.limits.time
        deadline = time.monotonic() + limit
        times = observations["time"]
        content = {
            "vehicle": dict(vehicle),
            "step": float(times[1] - times[0]) if len(times) > 1 else 0.0,
            "seed": generator_seed(declaration, observations),
        }
        line = process.open_cell(content)
        try:
            hello = self._answer(line, deadline, limit)
            replies = self._stream(line, hello.get("process"), declaration, observations, deadline)
            self._finish(line)
        finally:
            self._end_cell(process, line)
        estimates = np.empty(len(observations), record_type(declaration.outputs))
        values = estimates.view(np.float64).reshape(len(observations), -1)
        values[:] = replies["estimates"]
        return Outcome(estimates, runtime_of(replies["took"] * 1e-9, period), self._read)

    def _stream(
        self,
        line: Line,
        process: object,
        declaration: Declaration,
        observations: npt.NDArray[Any],
        deadline: float,
    ) -> npt.NDArray[Any]:
        """Give the samples one by one; return the replies, shape (n,)."""
        requests = requests_of(observations)
        heads = np.zeros((len(requests), 4), "=u8")
        heads[:, 0], heads[:, 1] = requests["nonce"], requests["index"]
        heads[:, 2] = process if isinstance(process, int) and process > 0 else 0
        heads[:, 3] = ESTIMATES
        heads[-1, 3] = FINISHED
        kind = reply_type(len(declaration.outputs))
        size, width, head = requests.itemsize, kind.itemsize, HEADER.size
        given, expected = requests.tobytes(), heads.tobytes()
        replies = bytearray(width * len(observations))
        try:
            for k in range(len(requests)):
                line.put(given[k * size : (k + 1) * size], deadline)
                reply = line.receive(width, deadline)
                if reply[:head] != expected[k * head : (k + 1) * head]:
                    self._fail(line, reply, expected[k * head : (k + 1) * head], deadline)
                if k < len(observations):
                    replies[k * width : (k + 1) * width] = reply
            self._read = read_by(read_message(lambda length: line.receive(length, deadline)))
        except (LateError, EOFError, OSError) as error:
            self._lost(error, self.limits.time)
        except ValueError as error:
            self.close()
            raise CellFailure("failed", f"its answer cannot be read: {error}") from None
        return np.frombuffer(bytes(replies), kind)

    def _fail(self, line: Line, reply: bytes, expected: bytes, deadline: float) -> NoReturn:
        """Raise what a reply says that does not hold the estimates that were asked for."""
        nonce, index, process, kind = HEADER.unpack(reply[: HEADER.size])
        asked = HEADER.unpack(expected)
        if (nonce, index, process) == asked[:3] and kind == FAILURE:
            answer = read_message(lambda length: line.receive(length, deadline))
            self._refuse(answer)
        self.close()
        if (nonce, index) == asked[:2] and process != asked[2]:
            raise CellFailure("failed", "another process than the method's own answered for it")
        raise CellFailure("failed", "an answer came that belongs to no sample that it was given")

    def _finish(self, line: Line) -> None:
        """See the process of the cell end, and that it has said nothing more."""
        process = self._process
        assert process is not None
        deadline = time.monotonic() + ENDING
        if process.shared:
            process.finish_cell(ENDING)
        try:
            surplus = line.rest(deadline)
        except (LateError, OSError):
            surplus = b""
            self.close()
        if surplus:
            raise CellFailure("failed", "more answers came than it was given samples")

    def _answer(
        self,
        line: Line,
        deadline: float,
        limit: float,
        content: dict[str, Any] | None = None,
        behind: bytes = b"",
    ) -> dict[str, Any]:
        """Return the answer to a message and what follows it; raise what it says went wrong."""
        try:
            if content is not None:
                line.send(content, deadline)
                line.put(behind, deadline)
            answer = read_message(lambda length: line.receive(length, deadline))
        except (LateError, EOFError, OSError) as error:
            self._lost(error, limit)
        except ValueError as error:
            self.close()
            raise CellFailure("failed", f"its answer cannot be read: {error}") from None
        if answer.get("status") != "ok":
            self._refuse(answer)
        return answer

    def _refuse(self, answer: Mapping[str, Any]) -> NoReturn:
        """Raise what went wrong inside the process."""
        status = answer.get("status")
        if status == "out of memory":
            self.close()  # what it holds may never be given back
            limit = self.limits.memory / 1024**2
            raise CellFailure("failed", f"out of memory (limit {limit:.0f} MiB)", memory=limit)
        reason = one_line(str(answer.get("reason", "")), LONGEST)
        read = read_by(answer) or self._read
        raise CellFailure("skipped" if status == "skipped" else "failed", reason, read=read)

    def _lost(self, error: Exception, limit: float) -> NoReturn:
        """Raise why a process does not answer any more."""
        process, self._process, self._loaded = self._process, None, None
        assert process is not None
        if isinstance(error, LateError):
            process.end(grace=0.0)
            reason = f"stopped after the time limit of {limit:g} s"
            raise CellFailure("timeout", reason, read=self._read)
        if process.shared and process.finish_cell(ENDING):
            code = process.cell_code
            process.end(grace=0.0)
        else:
            code = process.end(grace=ENDING)
        outside = code in FROM_OUTSIDE
        raise CellFailure("failed", last_words(code), read=self._read, outside=outside)


def declare(source: Source, variant: str, parameters: dict[str, Any]) -> Declaration:
    """Return what a method declares, without running its code in this process.

    Raises
    ------
    InputError
        If it cannot be loaded, or declares what is not possible.
    """
    sandbox = Sandbox(Limits())
    try:
        return sandbox.declare(source, variant, parameters)
    except CellFailure as error:
        text = str(error)
        place = source.target.rstrip(":")
        raise InputError(text if place.split(":")[0] in text else f"{place}: {text}") from None
    finally:
        sandbox.close()
