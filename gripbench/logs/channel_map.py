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
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from gripbench.configuration import Configuration, parse, read_toml
from gripbench.envs.signals import NEW, VARIANCE, signal
from gripbench.envs.vehicles import VEHICLE_PARAMETERS, load_vehicle
from gripbench.errors import GripbenchError, InputError, unknown
from gripbench.logs.units import conversion

DATETIME = "datetime"
"""Unit of a time column that holds ISO 8601 dates."""


Name = Annotated[str, Field(pattern=r"^[^\x00-\x1f]*$")]
"""Name of a column or file: on one line, for it appears in messages."""


class TimeColumn(Configuration):
    """Where the time of a file's rows stands.

    Attributes
    ----------
    column
        Name of the column; not looked at where the format carries a time with every sample.
    unit
        A unit of time, or `datetime` for ISO 8601 text.
    backwards
        What to do with a row that is earlier than one before it: refuse the log, or drop the row
        and say so.
    shift
        Seconds to add, to bring the files of one recording to one clock.
    """

    column: Name = "time"
    unit: str = "s"
    backwards: Literal["refuse", "drop"] = "refuse"
    shift: float = 0.0

    @field_validator("unit")
    @classmethod
    def _check_unit(cls, value: str) -> str:
        if value != DATETIME:
            _convertible(value, "s")
        return value


class LogFile(Configuration):
    """One file of a recording.

    Attributes
    ----------
    path
        File name, looked for beside the log that is imported.
    sha256
        Hash of the file that this map was written for; empty: not checked.
    time
        Its time column.
    database
        DBC file that decodes a CAN log, relative to the map.
    delimiter, decimal
        How a CSV file separates columns and writes numbers; an empty delimiter is found by itself.
    """

    path: Name
    sha256: str = Field(default="", pattern=r"^([0-9a-f]{64})?$")
    time: TimeColumn = TimeColumn()
    database: Name = ""
    delimiter: Literal["", ",", ";", "\t", "|"] = ""
    decimal: Literal[".", ","] = "."


class Column(Configuration):
    """What one column of a log is.

    Attributes
    ----------
    column
        Name of the column.
    file
        Which of the map's `files` has it; empty where there is only one.
    unit
        Unit of the column, see `gripbench.logs.units.UNITS`.
    sign
        -1 where the log counts the other way than the signal table.
    scale, offset
        Further factor, and a constant in the column's own unit that is subtracted.
    per
        Vehicle parameter by which the column is divided, such as `wheel_radius`.
    rate
        Samples a second where rows come faster than samples and hold the last one: a row is new
        where the value changes or a sample is overdue.
    new_when
        Column that changes whenever this one has a new sample.
    new_where
        Column that is not 0 in the rows with a new sample.
    time
        Column with this channel's own time, on the file's clock; empty: the file's time.
    rate_over
        Take the column's change over the last so many seconds, per second, instead of its value;
        `unit` is then that of the rate. 0: the value.
    delay
        Age [s] of the value at its time. An observation stays where it arrived, for GPS the
        channel `gps_time` tells its age; a reference is moved back to when it was true.
    zero
        Take the mean over the first standstill, or the first straight stretch, for the zero.
    """

    column: Name = Field(min_length=1)
    file: Name = ""
    unit: str
    sign: Literal[1, -1] = 1
    scale: float = Field(default=1.0, gt=0.0)
    offset: float = 0.0
    per: str = ""
    rate: float = Field(default=0.0, ge=0.0)
    new_when: Name = ""
    new_where: Name = ""
    time: Name = ""
    rate_over: float = Field(default=0.0, ge=0.0, le=60.0)
    delay: float = Field(default=0.0, ge=0.0, le=10.0)
    zero: Literal["", "standstill", "straight"] = ""

    @field_validator("per")
    @classmethod
    def _check_per(cls, value: str) -> str:
        if value and value not in VEHICLE_PARAMETERS:
            raise ValueError(str(unknown("vehicle parameter", value, VEHICLE_PARAMETERS)))
        return value


class Bound(Configuration):
    """What is known of a signal that no instrument measured: it lay within an interval.

    Attributes
    ----------
    low, high
        The interval, in SI units.
    start, end
        When it holds [s]; by default always.
    source
        How it is known.
    """

    low: float
    high: float
    start: float = 0.0
    end: float = 1e9
    source: str

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if self.low > self.high or self.start >= self.end:
            raise ValueError("low must not exceed high, and start must come before end")
        return self


class Derived(Configuration):
    """What is computed from other columns, said openly because no instrument gave it.

    Attributes
    ----------
    velocity_window
        Width [s] of the local straight line whose slope gives the reference's velocity and yaw
        rate from its position and yaw; 0: they are not derived.
    acceleration_window
        The same for its acceleration from velocity and yaw rate, and with it `mu_used`, the
        horizontal acceleration over gravity: what the road has given, so a lower bound of what
        it can give.
    sideslip_above
        Speed [m/s] from which the sideslip follows from v_y and v_x; below, it means nothing.
    reference_ahead
        Distance [m] of the point whose velocity the reference gives before the centre of gravity;
        its `speed_y` is brought there with the yaw rate.
    gps_velocity
        Whether the channels `velocity_north` and `velocity_west` follow from `speed_gps` and
        `course`.
    instruments
        Channels that a method may read although they come from the reference: motion capture in
        the place of a speed sensor.
    """

    velocity_window: float = Field(default=0.0, ge=0.0, le=5.0)
    acceleration_window: float = Field(default=0.0, ge=0.0, le=5.0)
    sideslip_above: float = Field(default=1.0, gt=0.0)
    reference_ahead: float = Field(default=0.0, ge=-10.0, le=10.0)
    gps_velocity: bool = False
    instruments: tuple[str, ...] = ()


class ChannelMap(Configuration):
    """A channel map as its file gives it.

    Attributes
    ----------
    name
        Name of the recording.
    description, licence, source, version
        Provenance: what it is, under which licence, where to get it, which release of it.
    vehicle
        Name of a vehicle that ships, or path of its file relative to the map.
    time, sha256, database, delimiter, decimal
        Those of the only file, see `LogFile`.
    files
        The files by a short name, where the recording has several.
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
        Named lists of intervals [s]: `train`, `test` and others. A score is taken over `test`
        where there is one.
    settings
        Parameters of methods, by method, that belong to the place or the vehicle (the earth's
        field, the speed from which a small car's tyres tell something) or were tuned on the
        training windows.
    score_from
        Samples before this time [s] do not count in any score.
    """

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    description: str = ""
    licence: str = ""
    source: str = ""
    version: str = ""
    vehicle: Name = ""
    time: TimeColumn = TimeColumn()
    sha256: str = Field(default="", pattern=r"^([0-9a-f]{64})?$")
    database: Name = ""
    delimiter: Literal["", ",", ";", "\t", "|"] = ""
    decimal: Literal[".", ","] = "."
    files: dict[str, LogFile] = Field(default_factory=dict)
    rows: str = ""
    runs: Name = ""
    training_runs: tuple[int, ...] = ()
    channels: dict[str, Column] = Field(min_length=1)
    reference: dict[str, Column] = Field(default_factory=dict)
    derived: Derived = Derived()
    bounds: dict[str, tuple[Bound, ...]] = Field(default_factory=dict)
    windows: dict[str, tuple[tuple[float, float], ...]] = Field(default_factory=dict)
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
            _convertible(column.unit, signal(name).unit, per, name)
        return value

    @field_validator("bounds")
    @classmethod
    def _check_bounds(cls, value: dict[str, tuple[Bound, ...]]) -> dict[str, tuple[Bound, ...]]:
        for name in value:
            _known_signal(name)
        return value

    @field_validator("windows")
    @classmethod
    def _check_windows(
        cls, value: dict[str, tuple[tuple[float, float], ...]]
    ) -> dict[str, tuple[tuple[float, float], ...]]:
        for name, intervals in value.items():
            for start, end in intervals:
                if start >= end:
                    raise ValueError(f"{name}: an interval must start before it ends")
        return value

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        both = [f"channels.{name}" for name in self.channels]
        for key, column in [*self._columns()]:
            if column.file and column.file not in self.files:
                raise ValueError(f"{key}.file: {unknown('file', column.file, self.files)}")
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
    name = channel_map.vehicle
    if not name:
        return {}
    if name.endswith(".toml") and beside is not None:
        name = str(beside.parent / name)
    try:
        return load_vehicle(name).values()
    except InputError as error:
        raise InputError(f"{beside or 'channel map'}: key 'vehicle': {error}") from None


def _known_signal(name: str) -> None:
    try:
        signal(name)
    except GripbenchError as error:
        raise ValueError(str(error)) from None
    if name.endswith(VARIANCE):
        raise ValueError(f"'{name}' is an estimate's variance, no column of a log")


def _convertible(unit: str, target: str, per: str = "", name: str = "") -> None:
    try:
        conversion(unit, target, per)
    except GripbenchError as error:
        where = f"{name}.unit: " if name else ""
        raise ValueError(f"{where}{error}") from None
