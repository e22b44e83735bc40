"""Which column of a log is its time, and in which unit: a log in, the map's time table out."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from gripbench.logs.channels.clock import epoch_unit
from gripbench.logs.mapping.map_tables import DATETIME
from gripbench.logs.mapping.naming import guesses, is_time, written_unit
from gripbench.logs.mapping.units import UNITS, proposed_unit
from gripbench.logs.readers.log import Log, LogColumn

_SERIAL_DAYS = (20_000.0, 80_000.0)  # of a spreadsheet: 1954 to 2119
_KITTI_RATES = (10.0, 100.0)
_DATE = re.compile(r"\s*\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}")
_MOMENT = re.compile(r"\s*(\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}|\d{1,2}:\d{2})")


@dataclass(frozen=True)
class TimeTable:
    """The keys of a map's time table, and what was taken for granted."""

    keys: dict[str, str | float] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()


def time_table(log: Log) -> TimeTable:
    """Return the likeliest time table; without keys where samples carry their times."""
    if all(column.times is not None for column in log.columns.values()):
        return TimeTable()
    name = _time_column(log)
    if not name:
        rate = _kitti_rate(log)
        if rate:
            reason = f"no timestamps.txt: the speed's change fits a rate of {rate:g} Hz"
            return TimeTable({"rate": rate}, (reason,))
        return TimeTable({}, ("no column looks like the time: name one, or the rate of the rows",))
    column = log.columns[name]
    if column.is_text:
        keys: dict[str, str | float] = {"column": name, "unit": DATETIME}
        date = _date_column(log, name)
        if date:
            keys["date"] = date
        return TimeTable(keys)
    unit, reason = _unit(log, name, column)
    return TimeTable({"column": name, "unit": unit}, (reason,) if reason else ())


def _time_column(log: Log) -> str:
    named = [name for name, column in log.columns.items() if is_time(name) and _rises(column)]
    if named:
        return named[0]
    first = next(iter(log.columns))
    column = log.columns[first]
    unnamed = first.isdecimal() or not guesses([first])
    if unnamed and not column.is_text and len(column.values) > 1 and "navstat" not in log.columns:
        steps = np.diff(column.values)
        if np.all(steps > 0.0) and np.median(steps) > 0.5 * np.mean(steps):
            return first
    return ""


def _rises(column: LogColumn) -> bool:
    """Whether a column may be a time: mostly increasing numbers, or dates."""
    if column.is_text:
        filled = column.values[~pd.isna(column.values)]
        return all(_MOMENT.match(str(text)) for text in filled[:20])
    filled = column.values[np.isfinite(column.values)]
    return len(filled) > 1 and filled[-1] > filled[0] and float(np.mean(np.diff(filled) < 0)) < 0.1


def _date_column(log: Log, name: str) -> str:
    """Return the column with the dates of a column that has the time of day only."""
    first = str(log.columns[name].values[~pd.isna(log.columns[name].values)][0])
    if _DATE.match(first):
        return ""
    for other, column in log.columns.items():
        if other != name and column.is_text and re.search(r"dat(e|um)", other, re.I):
            filled = column.values[~pd.isna(column.values)]
            if len(filled) == len(column.values) and _DATE.match(str(filled[0])):
                return other
    return ""


def _unit(log: Log, name: str, column: LogColumn) -> tuple[str, str]:
    """Return the unit of a numeric time, and what was taken for granted."""
    epoch = epoch_unit(column.values)
    if epoch:
        return epoch, ""
    for text in (column.unit, None):
        unit = proposed_unit(text) if text else written_unit(name)
        if unit is not None and UNITS[unit].dimension == UNITS["s"].dimension:
            return unit, ""
    filled = column.values[np.isfinite(column.values)]
    steps = np.diff(filled)
    usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 1.0
    if _SERIAL_DAYS[0] < filled[0] < filled[-1] < _SERIAL_DAYS[1] and usual < 1.0 / 86400.0:
        return "d", "no unit is written: days of a spreadsheet, less than a second apart"
    whole = bool(np.all(filled == np.round(filled)))
    if whole and usual >= 1.0 and len(log.columns) > 1:
        for unit, longest in (("ms", 1e3), ("us", 1e6), ("ns", 1e9)):
            if usual <= longest:
                return unit, f"no unit is written: whole numbers {usual:g} apart, taken as {unit}"
    return "s", ""


def _kitti_rate(log: Log) -> float:
    """Return the rate at which the forward speed changes as the accelerometer says; 0: unknown."""
    if not {"vf", "af", "navstat"} <= set(log.columns):
        return 0.0
    speed, accel = log.columns["vf"].values, log.columns["af"].values
    change = float(np.mean(np.diff(speed))) if len(speed) > 2 else 0.0
    wanted = float(np.mean(accel))
    if abs(change) < 1e-4 or wanted * change <= 0.0:
        return 0.0
    return min(_KITTI_RATES, key=lambda rate: abs(np.log(rate * change / wanted)))
