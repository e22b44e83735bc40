"""Where the files of published recordings are looked for."""

from __future__ import annotations

import os
from pathlib import Path

VARIABLE = "GRIPBENCH_DATA"
"""Environment variable that names the folder with the files of published recordings."""


def data_folder(setting: Path | None = None) -> Path:
    """Return the folder with the files of published recordings; it need not exist.

    Parameters
    ----------
    setting
        Folder that is given on the command line; it comes before the environment variable, and
        that before `gripbench/data` in the user's data folder.
    """
    if setting is not None:
        return setting
    named = os.environ.get(VARIABLE, "")
    if named:
        return Path(named)
    base = os.environ.get("XDG_DATA_HOME", "")
    return (Path(base) if base else Path.home() / ".local" / "share") / "gripbench" / "data"


def use_data_folder(folder: Path | None) -> None:
    """Look there in this process and those that it starts; None: stay where it is."""
    if folder is not None:
        os.environ[VARIABLE] = str(folder.absolute())
