"""A map in, the log that lies beside it out: the file that it names, or one of the same name."""

from __future__ import annotations

import hashlib
from pathlib import Path

from gripbench.errors import InputError
from gripbench.logs.mapping.channel_map import load_channel_map


def log_beside(channel_map: Path) -> Path:
    """Return the log of a map, for several files the folder that holds them.

    Parameters
    ----------
    channel_map
        Path of the map.

    Raises
    ------
    InputError
        If no file beside the map, or more than one, can be its log.
    """
    chosen = load_channel_map(channel_map)
    if chosen.files:
        return channel_map.parent
    others = [
        path
        for path in sorted(channel_map.parent.iterdir())
        if path.is_file() and path.suffix != ".toml" and not path.name.startswith(".")
    ]
    if chosen.sha256:
        same = [path for path in others if _sha256(path) == chosen.sha256]
        if same:
            return same[0]
    found = [path for path in others if path.stem == channel_map.stem]
    if not found:
        found = [path for path in others if path.stem == chosen.name]
    if len(found) == 1:
        return found[0]
    what = ", ".join(path.name for path in found) or "none"
    raise InputError(
        f"{channel_map}: its log must lie beside it, as {channel_map.stem}.SUFFIX, or be named by "
        f"[files.log] path; found: {what}"
    )


def _sha256(path: Path) -> str:
    with path.open("rb") as source:
        return hashlib.file_digest(source, "sha256").hexdigest()
