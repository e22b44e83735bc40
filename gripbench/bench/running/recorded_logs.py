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
        return _mapped(place, _files_beside(path))
    about = path / "recording.json"
    return _stored(place, about.stat().st_mtime_ns if about.is_file() else 0)


def _files_beside(path: Path) -> tuple[tuple[str, int, int], ...]:
    """Return what tells the files beside a map, its log and vehicle among them, from others."""
    if not path.parent.is_dir():
        return ()
    entries = ((entry.name, entry.stat()) for entry in path.parent.iterdir() if entry.is_file())
    return tuple(sorted((name, about.st_mtime_ns, about.st_size) for name, about in entries))


@lru_cache(maxsize=4)
def _mapped(place: str, beside: tuple[tuple[str, int, int], ...]) -> ImportedLog:
    from gripbench.logs.importing import import_log
    from gripbench.logs.mapping.beside import log_beside

    del beside  # part of the cache's key only: the log or its map may be another one
    return import_log(log_beside(Path(place)), Path(place))


@lru_cache(maxsize=4)
def _published(name: str, folder: Path) -> ImportedLog:
    from gripbench.logs.published import load_recording

    return load_recording(name, folder)


@lru_cache(maxsize=4)
def _stored(place: str, changed: int) -> ImportedLog:
    from gripbench.logs.storing import load

    del changed  # part of the cache's key only: the log may be imported again
    return load(Path(place))
