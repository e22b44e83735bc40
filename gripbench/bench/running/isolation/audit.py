"""Watches what a plug-in's process reads: `install` comes before its code, `report` after it.

Files that are opened, folders that are listed, libraries that are loaded and environment variables
that are asked for are reported with the digest that they had then. What no digest can follow (a
connection, another program, a device) is named. A compiled library that opens a file by itself is
not seen, unless the file stays mapped: a method declares such files (`files`). This is no defence
against a plug-in that hides what it reads; it finds what its author did not think of.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import os
import site
import stat
import sys
import sysconfig
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import gripbench
from gripbench.methods.foreign.fmu import place_of_units

ABSENT = "absent"
"""Stands for the digest of what is not there."""

MOST = 500
"""Most things whose digests a report holds; who reads more is not followed."""


def digest_of(kind: str, name: str, environment: Mapping[str, str] = os.environ) -> str:
    """Return the digest of what is there now under a reported kind and name."""
    if kind == "environment":
        value = environment.get(name)
        return ABSENT if value is None else _digest(value.encode("utf-8", "surrogateescape"))
    try:
        if kind == "folder":
            return _digest("\n".join(sorted(os.listdir(name))).encode("utf-8", "surrogateescape"))
        if not stat.S_ISREG(os.stat(name).st_mode):
            return ABSENT
        with open(name, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()[:32]
    except OSError:
        return ABSENT


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:32]


class _Witness:
    def __init__(self) -> None:
        self.seen: dict[tuple[str, str], str] = {}
        self.untracked: dict[str, None] = {}
        self.made: set[str] = set()
        self.own = "\0"  # no path begins so
        self.busy = threading.local()
        self.home = str(Path(gripbench.__file__).resolve().parent) + os.sep
        self.units = str(place_of_units()) + os.sep  # copies of what a declared file holds
        self.program = os.path.join(self.home, "methods", "foreign", "program.py")

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        act = _EVENTS.get(event)
        if act is None or getattr(self.busy, "now", False):
            return
        self.busy.now = True
        try:
            act(self, event, arguments)
        except Exception:  # a hook must not change what it watches
            self.untracked.setdefault(f"something that could not be followed ({event})")
        finally:
            self.busy.now = False

    def note(self, kind: str, name: str) -> None:
        if (kind, name) in self.seen:
            return
        if len(self.seen) >= MOST:
            self.untracked.setdefault(f"more than {MOST} files")
            return
        self.seen[kind, name] = digest_of(kind, name)

    def foreign(self, path: str) -> bool:
        """Tell whether a file belongs to Python, an installed package or gripbench."""
        return path.startswith((*_PLACES, self.home, self.units, self.own)) or _installed(path)

    def asked(self) -> bool:
        """Tell whether the plug-in's own code asked, itself or through a library."""
        frame = sys._getframe(3)  # past this, what handles the event, and `__call__`
        while frame is not None:
            name = frame.f_code.co_filename
            if name == self.program:  # starts what the plug-in names
                return True
            if name.startswith("<frozen importlib") or name.startswith(self.home):
                return False
            if not name.startswith("<frozen") and not self.foreign(name):
                return True
            frame = frame.f_back  # type: ignore[assignment]
        return False


def _opened(witness: _Witness, _: str, arguments: tuple[Any, ...]) -> None:
    given, _, flags = (*arguments, None, 0)[:3]
    if isinstance(given, int) or given is None:
        return
    path = os.path.abspath(os.fsdecode(given))
    flags = flags if isinstance(flags, int) else 0
    if flags & (os.O_TRUNC | os.O_EXCL):
        witness.made.add(path)  # what it then reads there is its own
        return
    if flags & 3 == os.O_WRONLY or path in witness.made:
        return
    if path.endswith(".pyc") and "__pycache__" in path:
        with contextlib.suppress(ValueError):
            path = importlib.util.source_from_cache(path)
    if path.endswith((".nbi", ".nbc")) or witness.foreign(path):
        return
    if path.startswith(("/proc/", "/sys/", "/dev/")):
        if path != os.devnull and witness.asked():
            witness.untracked.setdefault(path)
        return
    kind = os.stat(path).st_mode if os.path.exists(path) else stat.S_IFREG
    if stat.S_ISREG(kind):
        witness.note("file", path)
    elif not stat.S_ISDIR(kind) and witness.asked():
        witness.untracked.setdefault(path)


def _listed(witness: _Witness, _: str, arguments: tuple[Any, ...]) -> None:
    given = arguments[0] if arguments else "."
    if isinstance(given, int) or not witness.asked():
        return
    path = os.path.abspath(os.fsdecode(given or "."))
    if not witness.foreign(path + os.sep):
        witness.note("folder", path)


def _loaded(witness: _Witness, event: str, arguments: tuple[Any, ...]) -> None:
    given = arguments[1] if event == "import" else arguments[0]
    if isinstance(given, str | bytes):
        path = os.path.abspath(os.fsdecode(given))
        if os.path.isfile(path) and not witness.foreign(path):
            witness.note("file", path)


def _reached(witness: _Witness, event: str, _: tuple[Any, ...]) -> None:
    if witness.asked():
        what = "a connection" if event.startswith(("socket", "urllib")) else "another program"
        witness.untracked.setdefault(what)


_EVENTS: dict[str, Callable[[_Witness, str, tuple[Any, ...]], None]] = {
    "open": _opened,
    "sqlite3.connect": _opened,
    "os.listdir": _listed,
    "os.scandir": _listed,
    "import": _loaded,
    "ctypes.dlopen": _loaded,
    **dict.fromkeys(
        (
            "subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.spawn",
            "os.startfile", "pty.spawn", "socket.connect", "socket.sendto", "socket.bind",
            "socket.getaddrinfo", "urllib.Request",
        ),
        _reached,
    ),
}  # fmt: skip

_PLACES = tuple(
    {
        place.rstrip(os.sep) + os.sep
        for name in ("stdlib", "platstdlib", "purelib", "platlib")
        for place in (sysconfig.get_path(name), os.path.realpath(sysconfig.get_path(name)))
    }
    | {place.rstrip(os.sep) + os.sep for place in site.getsitepackages()}
    | {os.path.join(sys.base_prefix, lib, "python") for lib in ("lib", "lib64")}  # its zip file
)
_SYSTEM_LIBRARIES = ("/usr/lib/", "/usr/lib64/", "/lib/", "/lib64/", "/usr/local/lib/")


def _installed(path: str) -> bool:
    parts = path.split(os.sep)
    return "site-packages" in parts or "dist-packages" in parts


_witness: _Witness | None = None


def install() -> None:
    """Watch from now on what this process and those forked from it read."""
    global _witness
    if _witness is None:
        _witness = _Witness()
        sys.addaudithook(_witness)
        _watch_environment(_witness)


def ignore(folder: str) -> None:
    """Follow nothing that this process does in a folder of its own, which ends with it."""
    if _witness is not None:
        _witness.own = os.path.join(os.path.abspath(folder), "")


def report() -> dict[str, Any]:
    """Return what was seen: `seen`, lists of kind, name and digest, and `untracked`, words."""
    if _witness is None:
        return {"seen": [], "untracked": []}
    _witness.busy.now = True
    try:
        for path in _mapped():
            if not _witness.foreign(path) and not path.startswith(_SYSTEM_LIBRARIES):
                _witness.note("file", path)
    finally:
        _witness.busy.now = False
    seen = [[kind, name, digest] for (kind, name), digest in sorted(_witness.seen.items())]
    return {"seen": seen, "untracked": sorted(_witness.untracked)}


def _mapped() -> set[str]:
    """Return the files that are mapped into this process, libraries among them (Linux)."""
    found = set()
    with contextlib.suppress(OSError), open("/proc/self/maps", encoding="utf-8") as file:
        for line in file:
            path = line.split(maxsplit=5)[5:]
            if path and path[0].startswith("/") and not path[0].startswith(("/dev/", "/memfd:")):
                found.add(path[0].rstrip("\n"))
    executable = os.path.realpath(sys.executable)
    prefix = os.path.join(os.path.realpath(sys.base_prefix), "")
    return {
        path
        for path in found
        if path != executable and not path.startswith(prefix) and not path.endswith(" (deleted)")
        and not path.endswith((".nbi", ".nbc", "locale-archive", "gconv-modules.cache"))
    }  # fmt: skip


def _watch_environment(witness: _Witness) -> None:
    """Note the variables that the plug-in's own code asks for; no audit event tells of them."""
    kind = type(os.environ)
    usual = kind.__getitem__

    def getitem(self: Any, key: Any) -> Any:
        if isinstance(key, str) and key != "TMPDIR" and not getattr(witness.busy, "now", False):
            frame = sys._getframe(1)
            while frame is not None and frame.f_code.co_filename.startswith(("<frozen", *_STDLIB)):
                frame = frame.f_back  # type: ignore[assignment]
            name = "" if frame is None else frame.f_code.co_filename
            if name and not witness.foreign(name):
                witness.note("environment", key)
        return usual(self, key)

    kind.__getitem__ = getitem  # type: ignore[method-assign]


_STDLIB = tuple(
    os.path.join(place, name)
    for place in {sysconfig.get_path("stdlib"), os.path.realpath(sysconfig.get_path("stdlib"))}
    for name in ("os.py", "_collections_abc.py")
)
