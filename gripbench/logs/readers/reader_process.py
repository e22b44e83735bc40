"""Read a file in a process of its own: a file and a reader's name in, the columns out.

Formats that a compiled library reads are read there, so that a damaged file may kill that process
and not the program. One process imports the libraries and forks for each file (where the system
cannot fork it reads one file and ends), so every file meets a fresh one; time and memory are
limited. What comes back is numbers and JSON, nothing that could run.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import IO, Any

import numpy as np

from gripbench.errors import GripbenchError, InputError
from gripbench.logs.readers.log import Content, LogColumn

_SECONDS = 60.0
_SECONDS_PER_BYTE = 5e-6
_MEMORY = 4 << 30
_MEMORY_PER_BYTE = 30
_BOOT = (
    "import sys, json; sys.path.extend(p for p in json.loads(sys.argv[1]) if p not in sys.path); "
    "from gripbench.logs.readers.reader_process import serve; serve()"
)


class _Server:
    """The process that reads, started when first needed."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._owner = 0

    def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        with self._lock:
            process = self._running()
            assert process.stdin is not None
            assert process.stdout is not None
            try:
                process.stdin.write(json.dumps(request) + "\n")
                process.stdin.flush()
                line = process.stdout.readline()
            except (OSError, ValueError):
                line = ""
            except BaseException:  # Ctrl-C: an answer that comes late must not meet another file
                self._end()
                raise
            if not line or not hasattr(os, "fork"):
                self._end()
            if not line:
                return {"status": "died", "how": "its process ended"}
            answer: dict[str, Any] = json.loads(line)
            return answer

    def _running(self) -> subprocess.Popen[str]:
        if self._process is not None and self._owner == os.getpid():
            if self._process.poll() is None:
                return self._process
            self._end()
        package = str(Path(__file__).resolve().parents[3])
        places = [place for place in sys.path if os.path.isabs(place) and place != os.getcwd()]
        self._owner = os.getpid()
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-c", _BOOT, json.dumps([*places, package])],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        return self._process

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None or self._owner != os.getpid():
            return
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        try:
            process.wait(2.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


_SERVER = _Server()
atexit.register(_SERVER._end)


def read_apart(module: str, path: Path, file: dict[str, Any], wanted: list[str] | None) -> Content:
    """Read a file with `gripbench.logs.readers.<module>.read` in another process.

    Parameters
    ----------
    module
        Module of this room that reads the format.
    path
        The file or folder.
    file
        A `LogFile` as a dictionary.
    wanted
        Columns to read; None: all.

    Raises
    ------
    InputError
        What the reader raised, or that its process died, took too long or too much memory.
    """
    size = path.stat().st_size if path.is_file() else sum(
        one.stat().st_size for one in path.rglob("*") if one.is_file()
    )  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="gripbench-read-") as folder:
        out = Path(folder) / "columns"
        answer = _SERVER.ask(
            {
                "module": module,
                "path": str(path.resolve()),
                "shown": str(path),
                "file": file,
                "wanted": wanted,
                "out": str(out),
                "seconds": _SECONDS + _SECONDS_PER_BYTE * size,
                "memory": _MEMORY + _MEMORY_PER_BYTE * size,
            }
        )
        status = answer["status"]
        if status == "ok":
            return _unpacked(out)
    if status == "refused":
        raise InputError(str(answer["how"]))
    if status == "memory":
        raise MemoryError
    if status == "slow":
        raise InputError(
            f"{path}: reading it took longer than {answer['how']} s and was ended: "
            "the file may be damaged"
        )
    if status == "died":
        raise InputError(
            f"{path}: the library that reads it died ({answer['how']}): the file is damaged"
        )
    raise ValueError(str(answer["how"]))


def serve() -> None:
    """Answer requests, one line of JSON each, until there are no more."""
    requests, answers = sys.stdin, os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # whatever a library prints
    for line in requests:
        request = json.loads(line)
        _prepare(request["module"])
        if not hasattr(os, "fork"):
            print(json.dumps(_read(request)), file=answers, flush=True)
            return
        print(json.dumps(_in_a_fork(request)), file=answers, flush=True)


def _prepare(module: str) -> None:
    """Import what the reader needs; a missing library is the reader's to report."""
    import importlib

    loaded = importlib.import_module(f"gripbench.logs.readers.{module}")
    for name in getattr(loaded, "LIBRARIES", ()):
        with contextlib.suppress(ImportError):
            importlib.import_module(name)


def _in_a_fork(request: dict[str, Any]) -> dict[str, Any]:
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        _die_with(os.getppid())
        _limit_memory(request["memory"])
        answer = json.dumps(_read(request)).encode()
        with os.fdopen(writing, "wb") as handle:
            handle.write(answer)
        os._exit(0)
    os.close(writing)
    alarm = threading.Timer(request["seconds"], os.kill, (child, signal.SIGKILL))
    alarm.daemon = True
    started = time.monotonic()
    alarm.start()
    with os.fdopen(reading, "rb") as handle:
        answer = handle.read()
    _, ended = os.waitpid(child, 0)
    alarm.cancel()
    if answer:
        with contextlib.suppress(ValueError):
            found: dict[str, Any] = json.loads(answer)
            return found
    if time.monotonic() - started >= request["seconds"]:
        return {"status": "slow", "how": f"{request['seconds']:.0f}"}
    code = os.waitstatus_to_exitcode(ended)
    how = f"exit code {code}"
    if code < 0:
        with contextlib.suppress(ValueError):
            how = signal.Signals(-code).name
    return {"status": "died", "how": how}


def _read(request: dict[str, Any]) -> dict[str, Any]:
    import importlib

    from gripbench.logs.mapping.map_tables import LogFile

    path, shown = Path(request["path"]), request["shown"]
    wanted = None if request["wanted"] is None else frozenset(request["wanted"])
    try:
        module = importlib.import_module(f"gripbench.logs.readers.{request['module']}")
        content = module.read(path, LogFile.model_validate(request["file"]), wanted)
        _pack(content, Path(request["out"]))
    except GripbenchError as error:
        return {"status": "refused", "how": str(error).replace(request["path"], shown)}
    except MemoryError:
        return {"status": "memory", "how": ""}
    except BaseException as error:  # a damaged file may fail anywhere in a format's library
        lines = str(error).replace(request["path"], shown).strip().splitlines()
        return {"status": "failed", "how": lines[0] if lines else type(error).__name__}
    return {"status": "ok"}


def _pack(content: Content, out: Path) -> None:
    about: dict[str, Any] = {
        "names": content.names,
        "notes": content.notes,
        "twins": content.twins,
        "suggestions": content.suggestions,
        "columns": [],
    }
    times: list[np.ndarray[Any, Any]] = []
    arrays: list[np.ndarray[Any, Any]] = []
    for name, column in content.columns.items():
        entry: dict[str, Any] = {"name": name, "unit": column.unit, "times": -1}
        if column.times is not None:
            same = [i for i, one in enumerate(times) if one is column.times]
            if not same:
                times.append(column.times)
            entry["times"] = same[0] if same else len(times) - 1
        if column.is_text:
            entry["text"] = [None if value is None else str(value) for value in column.values]
        else:
            arrays.append(np.asarray(column.values, dtype=np.float64))
        about["columns"].append(entry)
    about["clocks"] = len(times)
    with out.open("wb") as handle:
        np.lib.format.write_array(handle, np.frombuffer(json.dumps(about).encode(), np.uint8))
        for array in [*times, *arrays]:
            np.lib.format.write_array(handle, np.asarray(array, dtype=np.float64))


def _unpacked(out: Path) -> Content:
    with out.open("rb") as handle:
        about = json.loads(_array(handle).tobytes())
        times = [_array(handle) for _ in range(about["clocks"])]
        content = Content(
            names=about["names"],
            notes=about["notes"],
            twins={name: tuple(several) for name, several in about["twins"].items()},
            suggestions=about["suggestions"],
        )
        for entry in about["columns"]:
            values = np.array(entry["text"], dtype=object) if "text" in entry else _array(handle)
            clock = times[entry["times"]] if entry["times"] >= 0 else None
            content.columns[entry["name"]] = LogColumn(values, clock, entry["unit"])
    return content


def _array(handle: IO[bytes]) -> np.ndarray[Any, Any]:
    return np.lib.format.read_array(handle, allow_pickle=False)


def _limit_memory(memory: int) -> None:
    try:
        import resource
    except ImportError:  # not on this system
        return
    with contextlib.suppress(OSError, ValueError):
        with open("/proc/self/statm", encoding="ascii") as file:
            used = int(file.read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + memory, used + memory))
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _die_with(parent: int) -> None:
    """Ask Linux to kill this process with its parent, however that one ends."""
    if sys.platform == "linux":
        import ctypes

        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(1, signal.SIGKILL)
        if os.getppid() != parent:  # it ended before
            os._exit(1)
