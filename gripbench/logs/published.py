"""The published recordings that gripbench has maps of; their files are the user's to fetch."""

from __future__ import annotations

from pathlib import Path

from gripbench.configuration import CONFIGS
from gripbench.errors import InputError, unknown
from gripbench.logs.importing import ImportedLog, import_log
from gripbench.logs.locations import VARIABLE, data_folder
from gripbench.logs.mapping.channel_map import load_channel_map


class AbsentDataError(InputError):
    """The files of a published recording are not where they are looked for."""


def recording_files() -> dict[str, Path]:
    """Return the maps of published recordings, by name."""
    return {path.stem: path for path in sorted((CONFIGS / "recordings").glob("*.toml"))}


def load_recording(name: str, folder: Path | None = None) -> ImportedLog:
    """Import a published recording.

    Parameters
    ----------
    name
        Name of a map that ships.
    folder
        Where its files lie; by default see `data_folder`.

    Raises
    ------
    AbsentDataError
        If a file is not there; the message says where to get it.
    InputError
        If there is no such recording or a file is not the one of the map.
    """
    maps = recording_files()
    if name not in maps:
        raise unknown("recording", name, maps)
    channel_map = load_channel_map(maps[name])
    place = data_folder(folder)
    for file in channel_map.log_files().values():
        if not (place / file.path).is_file():
            raise AbsentDataError(
                f"{name}: {file.path} is not in {_shown(place)}; get it from "
                f"{channel_map.source} and set {VARIABLE} to its folder"
            )
    return import_log(place, maps[name])


def _shown(place: Path) -> str:
    """Name a folder without the user's home: results that are published may quote it."""
    home = Path.home()
    return f"~/{place.relative_to(home).as_posix()}" if place.is_relative_to(home) else str(place)
