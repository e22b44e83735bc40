"""What Linux's Landlock and seccomp can keep a process from: rules in, a confined process out.

Rules hold for the process that enters them and for all that it starts, and nothing takes them back.
Where a kernel has neither, nothing happens.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import platform
import stat
import struct
import sys
from collections.abc import Iterable
from pathlib import Path

_SET_NO_NEW_PRIVILEGES, _SET_SECCOMP, _DROP_FROM_BOUND = 38, 22, 24
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_PATH_BENEATH = 1

_WRITE_FILE, _READ_FILE, _MAKE_BLOCK_DEVICE, _TRUNCATE = 1 << 1, 1 << 2, 1 << 11, 1 << 14
_CHANGE = _WRITE_FILE | sum(1 << bit for bit in range(4, 13))  # remove and make whatever there is
_OF_FILES = _WRITE_FILE | _READ_FILE | _TRUNCATE
_SCOPES = 1 | 2  # abstract sockets and signals stay inside

_DEVICES = ("/dev/null", "/dev/zero", "/dev/full")

MOST_BESIDE = 3000
"""Most files and folders beside a closed one: each needs a rule."""


def landlock_version() -> int:
    """Return the version of the kernel's Landlock; 0: it has none."""
    if sys.platform != "linux":
        return 0
    try:
        found = ctypes.CDLL(None).syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), 1)
    except (OSError, AttributeError):
        return 0
    return max(int(found), 0)


def enter_domain(
    closed: tuple[str, tuple[str, ...]] | None = None,
    writable: Iterable[str] | None = None,
    scoped: bool = True,
) -> None:
    """Enter a domain of its own: the kernel refuses to trace what is outside, at least.

    Parameters
    ----------
    closed
        A folder and names in it of what cannot be read.
    writable
        Folders below which alone files can be written, made and removed; None: anywhere.
    scoped
        Whether processes outside cannot be signalled either.
    """
    version = landlock_version()
    if version < 1:
        return
    beside = _beside(*closed) if closed else []
    rules = [(place, _READ_FILE) for place in beside]
    handled = _MAKE_BLOCK_DEVICE | (_READ_FILE if beside else 0)
    if writable is not None:
        change = _CHANGE | (_TRUNCATE if version >= 3 else 0)
        handled |= change
        rules += [(place, change | (_READ_FILE if beside else 0)) for place in writable]
        rules += [(place, change) for place in _DEVICES]
    scopes = _SCOPES if version >= 6 and scoped else 0
    library = ctypes.CDLL(None, use_errno=True)
    attributes = struct.pack("=QQQ", handled, 0, scopes)
    size = ctypes.c_size_t(24 if version >= 6 else 8)
    ruleset = library.syscall(_CREATE_RULESET, ctypes.create_string_buffer(attributes), size, 0)
    if ruleset < 0:
        return
    for place, rights in rules:
        _add(library, ruleset, place, rights)
    library.prctl(_SET_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    library.syscall(_RESTRICT_SELF, ruleset, 0)
    os.close(ruleset)


_POWERS = (16, 17, 19, 21, 38, 39)
"""Numbers of the capabilities that look past a domain: kernel modules and memory, ptrace, system
administration, performance monitoring (which reads environments), BPF."""


def drop_powers() -> None:
    """Give up, for good, what root may do and no domain refuses."""
    if sys.platform != "linux":
        return
    with contextlib.suppress(OSError, AttributeError):
        library = ctypes.CDLL(None)
        for power in _POWERS:
            library.prctl(_DROP_FROM_BOUND, power, 0, 0, 0)
        header = ctypes.create_string_buffer(struct.pack("=Ii", 0x20080522, 0))
        sets = ctypes.create_string_buffer(24)
        if library.capget(header, sets) == 0:
            words = list(struct.unpack("=6I", sets.raw[:24]))
            for power in _POWERS:
                for k in range(3 * (power // 32), 3 * (power // 32) + 3):
                    words[k] &= ~(1 << power % 32)
            library.capset(header, ctypes.create_string_buffer(struct.pack("=6I", *words)))


def _add(library: ctypes.CDLL, ruleset: int, place: str, rights: int) -> None:
    with contextlib.suppress(OSError):
        descriptor = os.open(place, os.O_PATH | os.O_NOFOLLOW | os.O_CLOEXEC)
        try:
            mode = os.fstat(descriptor).st_mode
            allowed = rights if stat.S_ISDIR(mode) else rights & _OF_FILES
            rule = ctypes.create_string_buffer(struct.pack("=Qi", allowed, descriptor))
            library.syscall(_ADD_RULE, ruleset, _PATH_BENEATH, rule, 0)
        finally:
            os.close(descriptor)


def _beside(folder: str, names: tuple[str, ...]) -> list[str]:
    """Return what lies beside the way to a folder, and in it beside these names; too much: none."""
    parts = Path(folder).parts
    found: list[str] = []
    place = Path(parts[0])
    for hidden in (*((part,) for part in parts[1:]), names):
        try:
            with os.scandir(place) as entries:
                found += [entry.path for entry in entries if entry.name not in hidden]
        except OSError:
            return found  # it is not there yet: what will come has no rule
        place = place / hidden[0]
        if len(found) > MOST_BESIDE:
            return []
    return found


_MACHINES = {
    "x86_64": (0xC000003E, (
        29, 30, 31, 64, 65, 66, 67, 68, 69, 70, 71, 220,  # System V: memory, semaphores, messages
        240, 248, 249, 250,  # mq_open, the kernel's keys
        188, 189, 190, 463,  # extended attributes
    )),
    "aarch64": (0xC00000B7, (
        186, 187, 188, 189, 190, 191, 192, 193, 194, 195, 196, 197,
        180, 217, 218, 219,
        5, 6, 7, 463,
    )),
}  # fmt: skip
"""By machine: its number, and the system calls through which something is kept without a file."""


def refuse_kept_memory() -> None:
    """Have the kernel refuse what outlives a process and is no file: System V and the like."""
    if sys.platform != "linux" or platform.machine() not in _MACHINES:
        return
    machine, calls = _MACHINES[platform.machine()]
    load, equal, least, answer = 0x20, 0x15, 0x35, 0x06
    refused, allowed = 0x00050001, 0x7FFF0000  # EPERM
    count = len(calls)
    program = [
        (load, 0, 0, 4),  # the machine: programs of another one know other numbers
        (equal, 0, count + 3, machine),
        (load, 0, 0, 0),
        (least, count + 1, 0, 0x40000000),  # nor those of x32
        *((equal, count - k, 0, call) for k, call in enumerate(calls)),
        (answer, 0, 0, allowed),
        (answer, 0, 0, refused),
    ]
    content = b"".join(struct.pack("=HBBI", *step) for step in program)
    steps = ctypes.create_string_buffer(content)
    filter_ = ctypes.create_string_buffer(struct.pack("@HP", len(program), ctypes.addressof(steps)))
    with contextlib.suppress(OSError, AttributeError):
        library = ctypes.CDLL(None)
        library.prctl(_SET_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
        library.prctl(_SET_SECCOMP, 2, filter_, 0, 0)
