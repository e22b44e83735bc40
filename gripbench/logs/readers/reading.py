"""Read a log of any known format: a path in, a `Log` out, or one line that says what is wrong.

Text is read here; formats that a compiled library reads are read in a process of their own. Formats
beyond text, Parquet, Feather and MATLAB up to v7 need the extra `logs`.
"""

from __future__ import annotations

import hashlib
import importlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from gripbench.errors import GripbenchError, InputError
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers.log import Content, Log, LogColumn, log_of_frame, optional
from gripbench.logs.readers.reader_process import read_apart
from gripbench.logs.readers.text_tables import COMPRESSED

__all__ = ["Content", "Log", "LogColumn", "log_of_frame", "optional", "read_log"]


@dataclass(frozen=True)
class _Format:
    kind: str
    module: str
    apart: bool = True


_TEXT = _Format("a table of text", "text_formats", apart=False)
_TRACE = _Format("a CAN trace", "can_traces")
_TEXT_TRACE = _Format("a CAN trace", "can_traces", apart=False)
_SHEET = _Format("a spreadsheet", "excel_files")
_BAG = _Format("a ROS bag", "ros_bags")
_ARROW = _Format("Parquet", "arrow_files")
_HDF5 = _Format("HDF5", "hdf5_files")
_MDF = _Format("MDF", "mdf_files")

_FORMATS: Mapping[str, _Format] = {
    ".csv": _TEXT,
    ".txt": _TEXT,
    ".tsv": _TEXT,
    ".dat": _Format("MDF or a table of text", "text_formats", apart=False),
    ".vbo": _Format("VBOX", "vbox_files", apart=False),
    ".erg": _Format("a CarMaker result", "carmaker_files", apart=False),
    ".parquet": _ARROW,
    ".feather": _Format("Feather", "arrow_files"),
    ".mat": _Format("MATLAB", "matlab_files"),
    ".h5": _HDF5,
    ".hdf5": _HDF5,
    ".mf4": _MDF,
    ".mdf": _MDF,
    ".mf3": _MDF,
    ".blf": _TRACE,
    ".asc": _TEXT_TRACE,
    ".trc": _TEXT_TRACE,
    ".log": _TEXT_TRACE,
    ".mcap": _BAG,
    ".bag": _BAG,
    ".db3": _BAG,
    ".xlsx": _SHEET,
    ".xls": _SHEET,
    ".ods": _SHEET,
}


def read_log(path: Path, file: LogFile | None = None, wanted: Iterable[str] | None = None) -> Log:
    """Read a log.

    Parameters
    ----------
    path
        The file, whose suffix tells the format; or a folder: a ROS 2 bag, the `oxts` of a KITTI
        drive, or files with one channel each.
    file
        How it is written; by default a file of that name without peculiarities.
    wanted
        Columns to read; by default all. Names that the file lacks are not an error here.

    Raises
    ------
    InputError
        If the file is missing, empty, of an unknown format, truncated or damaged, or needs an
        extra that is not installed.
    """
    file = file or LogFile(path=path.name)
    form = _format_of(path)
    sha256 = _hash(path)
    if file.sha256 and file.sha256 != sha256:
        raise InputError(
            f"{path}: key 'sha256': the map was written for another file "
            f"({file.sha256[:12]}..., this one is {sha256[:12]}...)"
        )
    selection = None if wanted is None else frozenset(wanted)
    try:
        if form.apart:
            names = None if selection is None else sorted(selection)
            content = read_apart(form.module, path, file.model_dump(mode="json"), names)
        else:
            module = importlib.import_module(f"gripbench.logs.readers.{form.module}")
            content = module.read(path, file, selection)
    except GripbenchError:
        raise
    except MemoryError:
        raise InputError(f"{path}: too large for the memory of this machine") from None
    except Exception as error:  # a damaged file may fail anywhere in a format's library
        lines = str(error).strip().splitlines()
        reason = lines[0] if lines else type(error).__name__
        raise InputError(
            f"{path}: cannot be read as {form.kind}, it may be truncated or damaged "
            f"({reason[:200]})"
        ) from None
    return Log(
        path,
        content.columns,
        tuple(content.names),
        sha256,
        tuple(content.notes),
        content.twins,
        content.suggestions,
    )


def is_known(path: Path) -> bool:
    """Whether a file's suffix is that of a known format."""
    suffixes = [suffix.lower() for suffix in path.suffixes]
    if suffixes and suffixes[-1] in COMPRESSED:
        return len(suffixes) == 1 or suffixes[-2] in _FORMATS
    return bool(suffixes) and suffixes[-1] in _FORMATS


def _format_of(path: Path) -> _Format:
    if path.is_dir():
        if (path / "metadata.yaml").is_file():
            return _BAG
        return _Format("a folder of channels", "folders", apart=False)
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty")
    suffix = path.suffix.lower()
    if suffix in COMPRESSED:
        inner = Path(path.stem).suffix.lower()
        if inner and _FORMATS.get(inner, _TEXT).apart:
            raise InputError(f"{path}: unpack it first: only text is read compressed")
        return _TEXT
    if suffix == ".dat":  # INCA writes MDF 3 so; others write text
        with path.open("rb") as handle:
            if handle.read(8).startswith((b"MDF", b"UnFinMF")):
                return _MDF
    if suffix not in _FORMATS:
        raise InputError(
            f"{path}: unknown format '{suffix}': known are {', '.join(sorted(_FORMATS))}"
        )
    return _FORMATS[suffix]


def _hash(path: Path) -> str:
    if path.is_file():
        with path.open("rb") as handle:
            return hashlib.file_digest(handle, "sha256").hexdigest()
    whole = hashlib.sha256()
    for one in sorted(path.rglob("*")):
        if one.is_file():
            whole.update(f"{one.relative_to(path).as_posix()}\0{_hash(one)}\n".encode())
    return whole.hexdigest()
