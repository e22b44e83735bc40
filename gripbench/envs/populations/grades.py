"""Grades of instruments: by name, the errors of every channel that a car of that grade has."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Self

from pydantic import model_validator

from gripbench.configuration import CONFIGS, Configuration, named_file, parse, read_toml
from gripbench.envs.instruments.sensors import Sensor
from gripbench.envs.signals import signal
from gripbench.errors import GripbenchError

IDEAL = "ideal"
"""Grade of the instruments that the scenario itself names, those of the papers."""


class Grade(Configuration):
    """Instruments of one grade; channels that a plant has no truth for are left out.

    Attributes
    ----------
    name
        Unique name; the file has the same.
    description
        One sentence.
    sensors
        Sensor by channel.
    """

    name: str
    description: str
    sensors: dict[str, Sensor]

    @model_validator(mode="after")
    def _check_channels(self) -> Self:
        for channel in self.sensors:
            try:
                found = signal(channel)
            except GripbenchError as error:
                raise ValueError(f"key 'sensors.{channel}': {error}") from None
            if found.idealised:
                raise ValueError(f"key 'sensors.{channel}': no instrument in a vehicle gives it")
        return self


def grade_files() -> dict[str, Path]:
    """Return the grades that ship with gripbench, by name."""
    return {path.stem: path for path in sorted((CONFIGS / "instruments").glob("*.toml"))}


def load_grade(name: str) -> Grade | None:
    """Return a grade by name or by the path of a TOML file; None for `ideal`.

    Raises
    ------
    InputError
        If there is no such grade or its file has a mistake.
    """
    if name == IDEAL:
        return None
    path = named_file("instrument grade", name, {**grade_files(), IDEAL: Path()})
    return _load(path, path.stat().st_mtime_ns if path.is_file() else 0)


@lru_cache(maxsize=16)
def _load(path: Path, changed: int) -> Grade:
    del changed  # part of the cache's key only
    return parse(Grade, read_toml(path), path)
