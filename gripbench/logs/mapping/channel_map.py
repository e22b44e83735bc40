"""The channel map: which column of a log is which signal, in which unit and with which sign.

A map is a TOML file::

    name = "my_drive"
    description = "Winter test, lap 3"
    licence = "MIT"
    vehicle = "my_car.toml"

    [time]
    column = "t"
    unit = "ms"

    [channels.yaw_rate]
    column = "GyroZ"
    unit = "deg/s"
    sign = -1          # the log counts clockwise

    [reference.sideslip]
    column = "beta_correvit"
    unit = "deg"
    delay = 0.1

The SI value of a channel is `sign * scale * (column - offset) * unit / per`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal, Self

from pydantic import Field, field_validator, model_validator

from gripbench.configuration import Configuration, parse, read_toml
from gripbench.envs.signals import NEW, VARIANCE, signal
from gripbench.envs.vehicles import VEHICLE_PARAMETERS, Value, Vehicle, load_vehicle
from gripbench.errors import GripbenchError, InputError, unknown
from gripbench.logs.mapping.interval_tables import Bound, Windows
from gripbench.logs.mapping.map_tables import (
    DATETIME,
    Column,
    Databases,
    Delimiter,
    LogFile,
    Name,
    TimeColumn,
    convertible,
)
from gripbench.logs.mapping.source_tables import (
    Attitude,
    Brake,
    Derived,
    Drive,
    Geodetic,
    Level,
    Sensor,
)

__all__ = [
    "DATETIME", "Bound", "ChannelMap", "Column", "Derived", "LogFile", "TimeColumn",
    "load_channel_map", "vehicle_values",
]  # fmt: skip


class ChannelMap(Configuration):
    """A channel map as its file gives it.

    Attributes
    ----------
    name
        Name of the recording.
    description, licence, source, version
        Provenance: what it is, under which licence, where to get it, which release of it.
    vehicle
        Name of a vehicle that ships, or path of its file relative to the map, or a table of its
        parameters as they stand in such a file.
    time, sha256, database, delimiter, decimal, header
        Those of the only file, see `LogFile`.
    files
        The files by a short name, where the recording has several.
    axes
        Axes of the log: ISO 8855 (x forward, y left, z up) or SAE J670 (x forward, y right, z
        down), which turns the sign of every signal that does not lie along x.
    sensors
        Where sensors sit and how they are turned, by a name that columns give as `sensor`.
    level
        Angles whose component of gravity is taken off the accelerometers.
    brake, drive
        Torques by axle from brake pressure, engine and gear.
    geodetic, attitude
        Position from latitude and longitude, yaw from a quaternion.
    rows
        Channel whose samples make the rows; empty: the samples of all, merged.
    runs
        Column whose value tells one run from the next; each run is a recording of its own.
    training_runs
        Runs whose whole length is the window `train`; the others are `test`.
    channels, reference
        Columns by signal name: what a method may read, and what it is judged by.
    derived
        What is computed from other columns.
    bounds
        Intervals in which a signal is known to lie, by signal name.
    windows
        Named lists of intervals [s] of the log's own clock: `train`, `test` and others. A score is
        taken over `test` where there is one.
    settings
        Parameters of methods, by method, that belong to the place or the vehicle (the earth's
        field, the speed from which a small car's tyres tell something) or were tuned on the
        training windows.
    score_from
        Samples of the first so many seconds do not count in any score.
    """

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    description: str = ""
    licence: str = ""
    source: str = ""
    version: str = ""
    vehicle: Name | dict[str, Value] = ""
    time: TimeColumn = TimeColumn()
    sha256: str = Field(default="", pattern=r"^([0-9a-f]{64})?$")
    database: Databases = ""
    delimiter: Delimiter = ""
    decimal: Literal[".", ","] = "."
    header: int = Field(default=0, ge=0)
    files: dict[str, LogFile] = Field(default_factory=dict)
    axes: Literal["ISO", "SAE"] = "ISO"
    sensors: dict[str, Sensor] = Field(default_factory=dict)
    level: Level = Level()
    brake: dict[Literal["front", "rear"], Brake] = Field(default_factory=dict)
    drive: Drive | None = None
    geodetic: Geodetic | None = None
    attitude: Attitude | None = None
    rows: str = ""
    runs: Name = ""
    training_runs: tuple[int, ...] = ()
    channels: dict[str, Column] = Field(default_factory=dict)
    reference: dict[str, Column] = Field(default_factory=dict)
    derived: Derived = Derived()
    bounds: dict[str, tuple[Bound, ...]] = Field(default_factory=dict)
    windows: Windows = Windows()
    settings: dict[str, dict[str, float]] = Field(default_factory=dict)
    score_from: float = Field(default=0.0, ge=0.0)

    @field_validator("channels", "reference")
    @classmethod
    def _check_signals(cls, value: dict[str, Column]) -> dict[str, Column]:
        for name, column in value.items():
            _known_signal(name)
            if name == "time":
                raise ValueError("'time' is mapped by the table [time], not as a channel")
            if name.endswith(NEW):
                raise ValueError(f"'{name}' is a flag that the import sets by itself")
            per = VEHICLE_PARAMETERS[column.per].unit if column.per else ""
            convertible(column.unit, signal(name).unit, per, name)
        return value

    @field_validator("bounds")
    @classmethod
    def _check_bounds(cls, value: dict[str, tuple[Bound, ...]]) -> dict[str, tuple[Bound, ...]]:
        for name in value:
            _known_signal(name)
        return value

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        both = [f"channels.{name}" for name in self.channels]
        placed = self.geodetic is not None and self.geodetic.to == "channels"
        if not (self.channels or self.brake or self.drive or placed):
            raise ValueError("channels: none is mapped; a table [channels.SIGNAL] names a column")
        for key, column in [*self._columns()]:
            if column.file and column.file not in self.files:
                raise ValueError(f"{key}.file: {unknown('file', column.file, self.files)}")
            if column.sensor and column.sensor not in self.sensors:
                raise ValueError(f"{key}.sensor: {unknown('sensor', column.sensor, self.sensors)}")
            if self.files and not column.file and len(self.files) > 1:
                raise ValueError(f"{key}: say which of the files ({', '.join(self.files)}) has it")
        if self.rows and self.rows not in self.channels:
            raise ValueError(f"rows: '{self.rows}' is none of {', '.join(both)}")
        for name in self.derived.instruments:
            _known_signal(name)
            if name in self.channels:
                raise ValueError(f"derived.instruments: '{name}' has a column of its own")
        if self.files and (self.sha256 or self.database):
            raise ValueError("sha256 and database belong into each of [files]")
        return self

    def _columns(self) -> list[tuple[str, Column]]:
        return [
            *((f"channels.{name}", column) for name, column in self.channels.items()),
            *((f"reference.{name}", column) for name, column in self.reference.items()),
        ]

    def source_columns(self) -> dict[str, Column]:
        """Return the columns of `brake`, `drive`, `geodetic` and `attitude` by their keys."""
        found = {f"brake.{axle}.pressure": brake.pressure for axle, brake in self.brake.items()}
        for name in ("drive", "geodetic"):
            table = getattr(self, name)
            for part in ("engine", "gear", "latitude", "longitude", "height"):
                column = getattr(table, part, None)
                if column is not None:
                    found[f"{name}.{part}"] = column
        if self.attitude is not None:
            for index, column_name in enumerate(self.attitude.quaternion):
                found[f"attitude.quaternion[{index}]"] = Column(
                    column=column_name, unit="-", file=self.attitude.file
                )
        return found

    def keyed_columns(self) -> dict[str, Column]:
        """Return every mapped column by its key in the file, such as `channels.yaw_rate`."""
        return dict(self._columns())

    def log_files(self, only: str = "") -> dict[str, LogFile]:
        """Return the files by short name; a map for a single log calls it by the empty name."""
        if self.files:
            return dict(self.files)
        return {
            "": LogFile(
                path=only,
                sha256=self.sha256,
                time=self.time,
                database=self.database,
                delimiter=self.delimiter,
                decimal=self.decimal,
                header=self.header,
            )
        }

    def file_of(self, column: Column) -> str:
        """Return the short name of the file that has a column."""
        if column.file or not self.files:
            return column.file
        return next(iter(self.files))


def load_channel_map(path: Path) -> ChannelMap:
    """Read a channel map.

    Raises
    ------
    InputError
        On the first mistake, with file, key and what is allowed.
    """
    return parse(ChannelMap, read_toml(path), path)


def vehicle_values(channel_map: ChannelMap, beside: Path | None) -> dict[str, float]:
    """Return the parameters of the map's vehicle; none where it names no vehicle.

    Parameters
    ----------
    channel_map
        The map.
    beside
        The map's file, beside which a vehicle given by path is looked for.
    """
    given = channel_map.vehicle
    if not given:
        return {}
    try:
        if not isinstance(given, str):
            values = {name: value.model_dump() for name, value in given.items()}
            about = {"name": channel_map.name, "description": "", "parameters": values}
            return parse(Vehicle, about, "its table").values()
        if given.endswith(".toml") and beside is not None:
            given = str(beside.parent / given)
        return load_vehicle(given).values()
    except InputError as error:
        raise InputError(f"{beside or 'channel map'}: key 'vehicle': {error}") from None


def _known_signal(name: str) -> None:
    try:
        signal(name)
    except GripbenchError as error:
        raise ValueError(str(error)) from None
    if name.endswith(VARIANCE):
        raise ValueError(f"'{name}' is an estimate's variance, no column of a log")
