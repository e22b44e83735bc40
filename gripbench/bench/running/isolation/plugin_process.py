"""The process of a plug-in: requests and samples come in, its declaration and estimates go out.

Where the system forks (Linux), `serve` is a starter that imports what every method needs and never
runs a plug-in's code. For each plug-in it forks a process that loads it, and that one forks again
for each cell, so that no cell finds what another one left in a class or module. Elsewhere a process
serves one plug-in and one cell.

The process of a cell has the samples that it was given and no other: the next one is sent when the
estimates of the last one are there.
"""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import os
import shutil
import socket
import struct
import sys
import threading
import time
from collections.abc import Sequence
from typing import Any, NoReturn

import numpy as np

from gripbench.bench.catalogue.declarations import Declaration
from gripbench.bench.running.execution import (
    Observation,
    SkippedError,
    VehicleOnPaper,
    numbers_of,
)
from gripbench.bench.running.isolation import audit
from gripbench.bench.running.isolation.confinement import (
    confine,
    end_children,
    end_with,
)
from gripbench.bench.running.isolation.fits import fit_answer
from gripbench.bench.running.isolation.lines import ServedLine
from gripbench.bench.running.isolation.messages import (
    END,
    ESTIMATES,
    FAILURE,
    FINISHED,
    message_bytes,
    read_message,
)
from gripbench.bench.running.isolation.plugin_loading import (
    Plugin,
    enter_scratch,
    load_plugin,
    seed_generators,
)
from gripbench.bench.running.isolation.trials import Trial, perform
from gripbench.bench.scoring.scoring import MISSING
from gripbench.envs.plants.simulation import Simulation
from gripbench.envs.signals import record_type
from gripbench.errors import GripbenchError, describe_error


def serve(forks: bool) -> NoReturn:
    """Answer the run that started this interpreter, over standard input and output."""
    read, write = os.dup(0), os.dup(0 if forks else 1)
    nothing = os.open(os.devnull, os.O_RDWR)
    for descriptor in (0, 1, 2) if forks else (0,):
        os.dup2(nothing, descriptor)
    os.close(nothing)
    if not forks:
        _print_to(2)  # what the run gave for it
    Simulation.__new__ = _refuse  # type: ignore[method-assign]
    if forks:
        os.close(write)  # no plug-in gets a way to the run
        _start_plugins(socket.socket(fileno=read))
    line = ServedLine(read, write)
    line.send({"process": os.getpid()})
    _serve_plugin(line, forks=False)


def _print_to(descriptor: int) -> None:
    """Have all that this process prints go to a descriptor, at once: it may end any time."""
    for output in {1, 2} - {descriptor}:
        os.dup2(descriptor, output)
    options: dict[str, Any] = {"buffering": 1, "errors": "backslashreplace", "closefd": False}
    sys.stdout, sys.stderr = (os.fdopen(output, "w", **options) for output in (1, 2))


def _refuse(*_: Any, **__: Any) -> NoReturn:
    raise GripbenchError("a method may not simulate: a scenario's truth is closed to it")


def _start_plugins(control: socket.socket) -> NoReturn:
    """Fork a process for each plug-in, and end it with all that it started."""
    end_with(None)
    gc.collect()
    gc.freeze()
    plugins: set[int] = set()
    ServedLine(control.fileno(), control.fileno()).send({"process": os.getpid()})
    while True:
        content, descriptors, _, _ = socket.recv_fds(control, 65536, 2)
        if not content:
            end_children()
            os._exit(0)
        request = read_message(_taken(content))
        if "start" in request:
            process = os.fork()
            if process == 0:
                control.close()
                for shown in descriptors[1:]:
                    _print_to(shown)
                    os.close(shown)
                _serve_plugin(ServedLine(descriptors[0], descriptors[0]), forks=True)
            for descriptor in descriptors:
                os.close(descriptor)
            plugins.add(process)
            control.sendall(message_bytes({"process": process}))
        else:
            process = request["end"]
            plugins.discard(process)
            with contextlib.suppress(OSError):
                # Give a process that is about to end the time to do it: its code says why.
                _wait(process, request["grace"])
            code = end_children(keep=plugins).get(process, _codes.pop(process, None))
            control.sendall(message_bytes({"code": code}))


_codes: dict[int, int] = {}


def _wait(process: int, grace: float) -> None:
    until = time.monotonic() + grace
    while True:
        ended, status = os.waitpid(process, os.WNOHANG)
        if ended:
            _codes[process] = os.waitstatus_to_exitcode(status)
        if ended or time.monotonic() >= until:
            return
        time.sleep(0.002)


def _taken(content: bytes) -> Any:
    """Return a function that takes the given bytes piece by piece."""
    start = 0

    def take(size: int) -> bytes:
        nonlocal start
        start += size
        return content[start - size : start]

    return take


def _serve_plugin(line: ServedLine, forks: bool) -> NoReturn:
    """Load one plug-in, then serve its cells."""
    if forks:
        end_with(os.getppid())
    request = line.message()
    closed = request["closed"]
    confine(request["memory"], (closed[0], tuple(closed[1])) if closed else None)
    audit.install()
    before = _shared_by_forks()
    try:
        plugin = load_plugin(request, line.receive(request["state"]))
    except MemoryError:
        line.send({"status": "out of memory", "reason": ""})
    except BaseException as error:  # SystemExit too
        line.send({"status": "failed", "reason": describe_error(error)})
    else:
        shared = forks and threading.active_count() == 1 and _threads() == 1
        shared = shared and _shared_by_forks() <= before
        line.send(
            {
                "status": "ok",
                "declaration": dataclasses.asdict(plugin.declaration),
                "batch": plugin.batch,
                "online": plugin.online,
                "expected": plugin.expected,
                "shared": shared,
                "read": audit.report(),
            }
        )
        if shared:
            _fork_cells(line, plugin, request["scratch"])
        content = line.message()
        enter_scratch(request["scratch"])
        _serve_request(line, plugin, content)
    os._exit(0)


def _threads() -> int:
    """Return the number of threads of this process: what a fork would not take along."""
    try:
        return len(os.listdir("/proc/self/task"))
    except OSError:
        return 2


def _shared_by_forks() -> set[str]:
    """Return what cells that are forked from here could tell each other through.

    These are open files, pipes and connections, and memory that is mapped as shared.
    """
    try:
        found = set(os.listdir("/proc/self/fd"))
        with open("/proc/self/maps", "rb") as file:
            mapped = [line.split(maxsplit=2)[:2] for line in file]
    except OSError:
        return set()
    return found | {str(place) for place, rights in mapped if rights.startswith(b"rw-s")}


def _fork_cells(line: ServedLine, plugin: Plugin, scratch: str) -> NoReturn:
    control = socket.socket(fileno=line.read)
    while True:
        content, descriptors, _, _ = socket.recv_fds(control, 1 << 20, 2)
        if not content:
            os._exit(0)
        request = read_message(_taken(content))
        parent = os.getpid()
        process = os.fork()
        if process == 0:
            control.close()
            end_with(parent)
            enter_scratch(os.path.join(scratch, str(os.getpid())))
            _serve_request(ServedLine(*descriptors), plugin, request)
        for descriptor in descriptors:
            os.close(descriptor)
        _, status = os.waitpid(process, 0)
        end_children()
        shutil.rmtree(os.path.join(scratch, str(process)), ignore_errors=True)
        line.send({"ended": os.waitstatus_to_exitcode(status)})


def _serve_request(line: ServedLine, plugin: Plugin, request: dict[str, Any]) -> NoReturn:
    if "trial" in request:
        _serve_trial(line, plugin, request)
    if "fit" in request:
        _serve_fit(line, plugin, request)
    _serve_cell(line, plugin, request)


def _serve_trial(line: ServedLine, plugin: Plugin, request: dict[str, Any]) -> NoReturn:
    """Try the method over samples that come all at once: not to be scored."""
    try:
        seed_generators(request["seed"])
        declaration = plugin.declaration
        kind = record_type((*declaration.sensors, "time"))
        length = request["samples"]
        content = line.receive(length * kind.itemsize) if length else b""
        observations = np.frombuffer(content, kind).copy()
        trial = Trial(plugin.make, declaration, request["vehicle"], observations, request["period"])
        found = perform(request["trial"], trial)
        lengths = [len(item) for item in found]
        answer = message_bytes({"status": "ok", "lengths": lengths, "read": audit.report()})
        answer += b"".join(np.ascontiguousarray(item).tobytes() for item in found)
    except BaseException as error:
        answer = message_bytes(_failure(error))
    line.put(answer)
    os._exit(0)


def _serve_fit(line: ServedLine, plugin: Plugin, request: dict[str, Any]) -> NoReturn:
    """Have the method fitted on the drives that come."""
    try:
        seed_generators(request["seed"])
        line.put(fit_answer(plugin.make, request["fit"], line.receive, audit.report))
    except BaseException as error:
        line.put(message_bytes(_failure(error)))
    os._exit(0)


def _serve_cell(line: ServedLine, plugin: Plugin, request: dict[str, Any]) -> NoReturn:
    """Run the method over the samples that come, one by one."""
    try:
        seed_generators(request["seed"])
        method = plugin.make()
        Observation.method = plugin.declaration.name
        method.reset(VehicleOnPaper(request["vehicle"]), request["step"])
        line.send({"status": "ok", "process": os.getpid()})
    except BaseException as error:
        line.send(_failure(error))
        os._exit(0)
    _samples(line, method, plugin.declaration)
    os._exit(0)


def _samples(line: ServedLine, method: Any, declaration: Declaration) -> None:
    names = (*declaration.sensors, "time")
    outputs = declaration.outputs
    request = struct.Struct(f"=QQ{len(names)}d")
    reply = struct.Struct(f"=QQQQQ{len(outputs)}d")
    nothing = (0.0,) * len(outputs)
    values: Sequence[float] = (MISSING,) * len(outputs)
    clock, process = time.perf_counter_ns, os.getpid
    while True:
        nonce, index, *sample = request.unpack(line.receive(request.size))
        if index == END:
            content = message_bytes({"read": audit.report()})
            head = reply.pack(nonce, index, process(), FINISHED, len(content), *nothing)
            line.put(head + content)
            return
        try:
            obs = Observation(zip(names, sample, strict=True))
            began = clock()
            given = method.update(obs)
            took = clock() - began
            values = numbers_of(given, outputs, values)
        except BaseException as error:  # SystemExit too
            content = message_bytes(_failure(error))
            head = reply.pack(nonce, index, process(), FAILURE, len(content), *nothing)
            line.put(head + content)
            return
        os.write(line.write, reply.pack(nonce, index, process(), ESTIMATES, took, *values))


def _failure(error: BaseException) -> dict[str, Any]:
    if isinstance(error, MemoryError):
        return {"status": "out of memory", "reason": ""}
    status = "skipped" if isinstance(error, SkippedError) else "failed"
    return {"status": status, "reason": describe_error(error), "read": audit.report()}
