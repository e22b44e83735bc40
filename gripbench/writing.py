"""One way to write a file: a path and its content in, the whole file there or an error.

Everything that the project writes passes here. A reader sees the old content or the new one, never
a part; a symbolic link is written through; what is not a plain file (a device, a FIFO, a folder)
is refused; `-` is standard output.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from gripbench.errors import InputError

STANDARD_OUTPUT = Path("-")
"""The path that means standard output."""

DEFAULT_RESULTS = Path("results")
"""Folder of everything that commands write, unless they are told another."""


def write_atomically(path: Path, content: str | bytes) -> None:
    """Write a file in one atomic step, and its folder where there is none.

    Parameters
    ----------
    path
        The file; `-` writes to standard output.
    content
        Text, stored as UTF-8, or bytes.

    Raises
    ------
    InputError
        If it cannot be written; what was there before is left as it was.
    """
    data = content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
    with being_written(path) as temporary:
        _write(temporary, data)


@contextlib.contextmanager
def being_written(path: Path) -> Iterator[Path]:
    """Give a temporary path to write to; it becomes `path` where the block ends without an error.

    The temporary path has the suffix of `path`, for libraries that choose a format by it.

    Raises
    ------
    InputError
        As `write_atomically`.
    """
    target = _target(path)
    if path == STANDARD_OUTPUT:
        with tempfile.TemporaryDirectory() as scratch:
            temporary = Path(scratch) / target.name
            yield temporary
            _print(temporary.read_bytes())
        return
    folder = target.parent
    temporary = folder / f".{target.stem}.{os.getpid()}.tmp{target.suffix}"
    try:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            yield temporary
            with contextlib.suppress(OSError):
                temporary.chmod(stat.S_IMODE(target.stat().st_mode))
            temporary.replace(target)
        except BaseException:
            with contextlib.suppress(OSError):
                temporary.unlink()
            raise
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {_remedy(error)}") from None


def check_writable(path: Path) -> None:
    """Check, before any work is done, that a file can be written; nothing is written.

    Raises
    ------
    InputError
        If it is no plain file, one of its folders is a file, or its folder is read-only.
    """
    target = _target(path)
    if path == STANDARD_OUTPUT:
        return
    folder = target.parent
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    if not folder.is_dir():
        raise InputError(f"{path}: cannot be written: {folder} is a file, not a folder")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"{path}: cannot be written: {_remedy(PermissionError(errno.EACCES, ''))}")


def _target(path: Path) -> Path:
    """Return the plain file, there or not, that a path leads to."""
    if path == STANDARD_OUTPUT:
        return Path("output")
    try:
        target = Path(os.path.realpath(path)) if path.is_symlink() else path
        mode = target.stat().st_mode
    except FileNotFoundError:
        return target
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be written: {_remedy(error)}") from None
    if not stat.S_ISREG(mode):
        kind = "a folder" if stat.S_ISDIR(mode) else "no plain file; '-' is standard output"
        raise InputError(f"{path}: cannot be written: it is {kind}")
    return target


def _print(data: bytes) -> None:
    sys.stdout.flush()
    sys.stdout.buffer.write(data)
    sys.stdout.flush()


def _write(path: Path, data: bytes) -> None:
    with path.open("wb") as file:
        file.write(data)


def _remedy(error: OSError | ValueError) -> str:
    code = getattr(error, "errno", None)
    if code in (errno.ENOSPC, errno.EDQUOT):
        return (
            "the disk is full; make room and run the same command again, what is finished is kept"
        )
    if code in (errno.EROFS, errno.EACCES, errno.EPERM):
        return "the folder is read-only; choose another"
    if code in (errno.ENOTDIR, errno.EEXIST):
        return "one of its folders is a file"
    return str(getattr(error, "strerror", None) or error).lower()


def own_folder(path: Path) -> None:
    """Make a folder for what is executed later: nobody else may have made it, or write into it.

    Raises
    ------
    OSError
        If it cannot be made, or is not this user's own.
    """
    path.mkdir(mode=0o700, exist_ok=True)
    about = path.lstat()
    owner = getattr(os, "getuid", lambda: about.st_uid)()
    if not stat.S_ISDIR(about.st_mode) or about.st_uid != owner or about.st_mode & 0o022:
        raise OSError(f"{path} is not this user's own")
