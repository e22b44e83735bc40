"""Name, folder or map of a recording in, its imported log out, read once while nothing changes."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from gripbench.bench.catalogue.scenarios import PREFIX as PREFIX
from gripbench.errors import InputError

if TYPE_CHECKING:
    from gripbench.logs.importing import ImportedLog

STORED = Path("recordings")
"""Where `gripbench import` keeps recordings unless told otherwise."""


def imported_of(name: str) -> ImportedLog:
    """Return a recording by name, folder or map with what was found about it.

    Raises
    ------
    InputError
        If there is no such recording, or its files are not at hand.
    """
    return load_place(place_of(name.removeprefix(PREFIX)))


def place_of(name: str) -> str:
    """Return what names a recording from any folder: its name, or the path of folder or map."""
    from gripbench.errors import unknown
    from gripbench.logs.published import recording_files

    if name in recording_files():
        return name
    if name.endswith(".toml"):
        return str(Path(name).resolve())
    for folder in (Path(name), STORED / name):
        if (folder / "recording.json").is_file():
            return str(folder.resolve())
    if Path(name).is_dir():
        raise InputError(f"{name}: is no recording; gripbench import makes one of a log")
    stored = {path.parent.name for path in STORED.glob("*/recording.json")}
    raise unknown("recording", name, {*recording_files(), *stored})


def load_place(place: str) -> ImportedLog:
    """Return a recording by what `place_of` returned; it is read again where files changed."""
    from gripbench.logs.locations import data_folder
    from gripbench.logs.published import recording_files

    if place in recording_files():
        return _published(place, data_folder())
    path = Path(place)
    if place.endswith(".toml"):
        from gripbench.logs.mapping.beside import log_beside

        log = log_beside(path)
        files = [path, *(sorted(log.iterdir()) if log.is_dir() else [log])]
        return _mapped(place, log, tuple(file.stat().st_mtime_ns for file in files))
    about = path / "recording.json"
    return _stored(place, about.stat().st_mtime_ns if about.is_file() else 0)


@lru_cache(maxsize=4)
def _mapped(place: str, log: Path, changed: tuple[int, ...]) -> ImportedLog:
    from gripbench.logs.importing import import_log

    del changed  # part of the cache's key only: the log or its map may be another one
    return import_log(log, Path(place))


@lru_cache(maxsize=4)
def _published(name: str, folder: Path) -> ImportedLog:
    from gripbench.logs.published import load_recording

    return load_recording(name, folder)


@lru_cache(maxsize=4)
def _stored(place: str, changed: int) -> ImportedLog:
    from gripbench.logs.storing import load

    del changed  # part of the cache's key only: the log may be imported again
    return load(Path(place))
