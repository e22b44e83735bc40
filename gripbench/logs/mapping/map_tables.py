"""The tables of a channel map that read a log: a file, its time, a column."""

from __future__ import annotations

import itertools
from typing import Annotated, Literal

from pydantic import Field, field_validator

from gripbench.configuration import Configuration
from gripbench.envs.vehicles import VEHICLE_PARAMETERS
from gripbench.errors import GripbenchError, unknown
from gripbench.logs.mapping.units import conversion

DATETIME = "datetime"
"""Unit of a time column that holds ISO 8601 dates."""


Name = Annotated[str, Field(pattern=r"^[^\x00-\x1f]*$")]
"""Name of a column or file: on one line, for it appears in messages."""


Databases = Name | tuple[Name, ...]
Delimiter = Literal["", ",", ";", "\t", "|", " "]


class TimeColumn(Configuration):
    """Where the time of a file's rows stands.

    Attributes
    ----------
    column
        Name of the column; not looked at where the format carries a time with every sample.
    date
        Column with the date, where `column` has the time of day only; their texts are joined.
    rate
        Rows a second, where no column has the time; `column` is then not looked at.
    unit
        A unit of time, or `datetime` for dates as text: ISO 8601, or day, month and year.
    backwards
        What to do with a row that is earlier than one before it: refuse the log, or drop the row
        and say so.
    shift
        Seconds to add, to bring the files of one recording to one clock.
    """

    column: Name = "time"
    date: Name = ""
    rate: float = Field(default=0.0, ge=0.0)
    unit: str = "s"
    backwards: Literal["refuse", "drop"] = "refuse"
    shift: float = 0.0

    @field_validator("unit")
    @classmethod
    def _check_unit(cls, value: str) -> str:
        if value != DATETIME:
            convertible(value, "s")
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
        DBC file that decodes a CAN log, relative to the map, or several; `CHANNEL=FILE` is for the
        frames of one channel, counted from 0.
    delimiter, decimal
        How a text separates columns and writes numbers; an empty delimiter is found by itself, a
        blank stands for any white space.
    header
        Number of the line that names the columns, counted from 1; 0: it is found by itself.
    """

    path: Name
    sha256: str = Field(default="", pattern=r"^([0-9a-f]{64})?$")
    time: TimeColumn = TimeColumn()
    database: Databases = ""
    delimiter: Delimiter = ""
    decimal: Literal[".", ","] = "."
    header: int = Field(default=0, ge=0)

    def databases(self) -> tuple[str, ...]:
        """Return the entries of `database`, none where it is empty."""
        if isinstance(self.database, str):
            return (self.database,) if self.database else ()
        return self.database


class Column(Configuration):
    """What one column of a log is.

    Attributes
    ----------
    column
        Name of the column.
    file
        Which of the map's `files` has it; empty where there is only one.
    unit
        Unit of the column, see `gripbench.logs.mapping.units.UNITS`.
    sign
        -1 where the log counts the other way than the signal table.
    scale, offset
        Further factor, and a constant in the column's own unit that is subtracted.
    per
        Vehicle parameter by which the column is divided, such as `wheel_radius`.
    radius
        What the column is divided by [m] where `per` names the wheel's radius and the map no
        vehicle that has it.
    table
        Pairs of the column's value and the value that it means in `unit`, the first rising: a
        steering gear's curve. Between them it is linear, beyond them the value is missing.
    ratio_over_speed
        Pairs of a speed [m/s], rising, and what the column is divided by at it.
    pulses
        Pulses a revolution, by which a count or a frequency of pulses is divided.
    rollover
        Where a counter starts at 0 again, such as 65536; it is made to run on.
    sensor
        Which of the map's `sensors` measured it.
    negative_where
        Column that is not 0 where the value is negative, of a log that keeps magnitude and sign.
    valid_where
        Column that is 0 where the value means nothing.
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
    shift
        Seconds to add to the column's times: its clock, against that of the other columns.
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
    radius: float = Field(default=0.0, ge=0.0)
    table: tuple[tuple[float, float], ...] = ()
    ratio_over_speed: tuple[tuple[float, float], ...] = ()
    pulses: int = Field(default=0, ge=0)
    rollover: float = Field(default=0.0, ge=0.0)
    sensor: str = ""
    negative_where: Name = ""
    valid_where: Name = ""
    rate: float = Field(default=0.0, ge=0.0)
    new_when: Name = ""
    new_where: Name = ""
    time: Name = ""
    rate_over: float = Field(default=0.0, ge=0.0, le=60.0)
    delay: float = Field(default=0.0, ge=0.0, le=10.0)
    shift: float = Field(default=0.0, ge=-1e4, le=1e4)
    zero: Literal["", "standstill", "straight"] = ""

    @field_validator("table", "ratio_over_speed")
    @classmethod
    def _check_rising(
        cls, value: tuple[tuple[float, float], ...]
    ) -> tuple[tuple[float, float], ...]:
        if value and (len(value) < 2 or any(a[0] >= b[0] for a, b in itertools.pairwise(value))):
            raise ValueError("two or more pairs, the first of each above that of the pair before")
        return value

    @field_validator("per")
    @classmethod
    def _check_per(cls, value: str) -> str:
        if value and value not in VEHICLE_PARAMETERS:
            raise ValueError(str(unknown("vehicle parameter", value, VEHICLE_PARAMETERS)))
        return value


def convertible(unit: str, target: str, per: str = "", name: str = "") -> None:
    """Refuse a unit that does not convert, in a validator's way."""
    try:
        conversion(unit, target, per)
    except GripbenchError as error:
        where = f"{name}.unit: " if name else ""
        raise ValueError(f"{where}{error}") from None
