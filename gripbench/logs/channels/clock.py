"""The times of a log's rows: a time column, dates, or a known rate in; seconds out."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

from gripbench.errors import InputError
from gripbench.logs.mapping.map_tables import DATETIME, TimeColumn
from gripbench.logs.mapping.units import conversion
from gripbench.logs.readers.log import Log, LogColumn

Floats = npt.NDArray[np.float64]

EPOCHS = {"s": (3e8, 1e11), "ms": (3e11, 1e14), "us": (3e14, 1e17), "ns": (3e17, 1e20)}
"""Size of a number of seconds, milli-, micro- and nanoseconds since 1970, from 1979 on."""

_LATEST = 1e11  # s since 1970: the year 5138
_FEWEST_TIMES = 0.5  # of the rows
_ROWS_TO_JUDGE = 10
_DAY = 86400.0
_DATE = re.compile(r"\s*(\d{4}-\d{2}-\d{2}|\d{1,4}[/.-]\d{1,2}[/.-]\d{1,4}[ T])")
_ZONE = re.compile(r"(?:[zZ]|[+-]\d{2}:?\d{2})\s*$")
_PARTS = (
    r"^\s*(\d{1,4})[/.-](\d{1,2})[/.-](\d{1,4})[ T]+(\d{1,2}):(\d{2})(?::(\d{1,2}(?:[.,]\d+)?))?"
    r"\s*([AaPp])?\.?[Mm]?\.?\s*$"
)
_OF_DAY = r"^\s*(\d{1,3}):(\d{2})(?::(\d{1,2}(?:[.,]\d+)?))?\s*([AaPp])?\.?[Mm]?\.?\s*$"


def times_of(log: Log, raw: LogColumn, time: TimeColumn, own: str, key: str) -> Floats:
    """Return the times [s] of a column's rows, as the log counts them.

    Parameters
    ----------
    log, raw
        The log and the column.
    time
        The file's time column.
    own
        Name of the column's own time column; empty: the file's.
    key
        What asks, for messages.

    Raises
    ------
    InputError
        If there is no time column, it holds something other than its unit says, or its numbers
        have too few digits to tell the rows apart.
    """
    if raw.times is not None and not own:
        return raw.times
    if time.rate > 0.0 and not own:
        return np.arange(len(raw.values)) / time.rate
    name = own or time.column
    where = f"{key}.time" if own else "time.column"
    stamps = _stamps(log, name, where)
    if time.unit == DATETIME:
        seconds = _seconds_of_dates(log, where, stamps, time)
    else:
        if stamps.is_text:
            text = str(stamps.values[~pd.isna(stamps.values)][0])
            if _DATE.match(text) or re.match(_OF_DAY, text):
                raise InputError(
                    f"{log.path}: key '{where}': column '{name}' holds dates such as "
                    f"'{text[:40]}': say unit = \"datetime\""
                )
        seconds = log.numbers(name, where) * conversion(time.unit, "s")
        _refuse_another_epoch(log.path, seconds, time.unit)
    if not own:
        _refuse_few_digits(log.path, name, seconds)
    return seconds


def epoch_unit(stamps: Floats) -> str:
    """Return the unit in which numbers count the time since 1970; empty where they do not."""
    finite = stamps[np.isfinite(stamps)]
    middle = float(np.median(finite)) if len(finite) else 0.0
    return next((unit for unit, (low, high) in EPOCHS.items() if low <= middle < high), "")


def _stamps(log: Log, name: str, where: str) -> LogColumn:
    if name not in log.columns and name not in log.twins and where == "time.column":
        try:
            log.column(name, where)
        except InputError as error:
            raise InputError(f"{error}; without a time column say time.rate") from None
    return log.column(name, where)


def _refuse_another_epoch(path: Path, seconds: Floats, unit: str) -> None:
    finite = seconds[np.isfinite(seconds)]
    if not len(finite) or np.median(finite) < _LATEST:
        return
    raw = finite / conversion(unit, "s")
    right = epoch_unit(raw)
    hint = f'the column counts in {right}: say unit = "{right}"' if right else "check the unit"
    raise InputError(
        f"{path}: key 'time.unit': in '{unit}' the log begins {finite[0] / 3.15576e7 + 1970.0:.0f} "
        f"years after Christ: {hint}"
    )


def _refuse_few_digits(path: Path, name: str, seconds: Floats) -> None:
    finite = seconds[np.isfinite(seconds)]
    different = len(np.unique(finite))
    if len(finite) >= _ROWS_TO_JUDGE and 1 < different < _FEWEST_TIMES * len(finite):
        raise InputError(
            f"{path}: key 'time.column': column '{name}' has {different} different times in "
            f"{len(finite)} rows: it was written with too few digits; export it with more, or say "
            "time.rate"
        )


def _seconds_of_dates(log: Log, where: str, column: LogColumn, time: TimeColumn) -> Floats:
    path = log.path
    if not column.is_text:
        raise InputError(f"{path}: key '{where}': holds numbers, not dates; name a unit of time")
    texts = pd.Series(column.values, dtype=object)
    if time.date and where == "time.column":
        dates = log.column(time.date, "time.date")
        texts = pd.Series(dates.values, dtype=object).astype(str) + " " + texts.astype(str)
        texts = texts.where(~pd.isna(column.values), None)
    filled = texts.notna().to_numpy()
    given = texts[filled].astype(str).reset_index(drop=True)
    zones = {
        found.group().strip().upper() if (found := _ZONE.search(text[10:])) else "none"
        for text in given
    }
    if len(zones) > 1:
        shown = ", ".join(sorted(zones)[:4])
        raise InputError(f"{path}: key '{where}': the dates mix time zones ({shown}); use one")
    seconds = np.full(len(column.values), np.nan)
    found_seconds = _of_iso(given)
    if found_seconds is None:
        found_seconds = _of_parts(given)
    if found_seconds is None:
        found_seconds = _of_day(given)
    if found_seconds is None:
        raise InputError(
            f"{path}: key '{where}': not all dates are ISO 8601, or such as 31.12.2025 10:00:00, "
            f"such as {given.iloc[0][:40]!r}"
        )
    seconds[filled] = found_seconds
    return seconds


def _of_iso(texts: pd.Series[str]) -> Floats | None:
    try:
        moments = pd.to_datetime(texts, format="ISO8601", utc=True)
    except (ValueError, OverflowError):
        return None
    nanoseconds = moments.astype("datetime64[ns, UTC]").astype("int64").to_numpy()
    return np.asarray(nanoseconds // 10**9 + (nanoseconds % 10**9) * 1e-9, dtype=np.float64)


def _of_parts(texts: pd.Series[str]) -> Floats | None:
    """Return the seconds of dates such as 05/13/2025 10:00:00.5, 13.05.2025 10:00, with am and pm.

    The day comes first after a point, or where a first number exceeds 12; the order decides
    nothing but the date itself.
    """
    parts = texts.str.extract(_PARTS)
    if parts[[0, 1, 2, 3, 4]].isna().any().any():
        return None
    a, b, c = (parts[i].astype(int) for i in (0, 1, 2))
    if (parts[0].str.len() == 4).all():
        year, month, day = a, b, c
    else:
        dotted = texts.str.match(r"\s*\d+\.").all()
        day_first = (dotted or (a > 12).any()) and not (b > 12).any()
        day, month = (a, b) if day_first else (b, a)
        year = c.where(c > 99, c + 2000)
    try:
        days = pd.to_datetime(pd.DataFrame({"year": year, "month": month, "day": day}))
    except ValueError:
        return None
    whole = (days.astype("datetime64[ns]").astype("int64") // 10**9).to_numpy(dtype=np.float64)
    return whole + _clock_seconds(parts[3], parts[4], parts[5], parts[6])


def _of_day(texts: pd.Series[str]) -> Floats | None:
    """Return the seconds of times of the day; past midnight they count on."""
    parts = texts.str.extract(_OF_DAY)
    if parts[[0, 1]].isna().any().any():
        return None
    times = _clock_seconds(parts[0], parts[1], parts[2], parts[3])
    return times + _DAY * np.cumsum(np.diff(times, prepend=times[:1]) < -0.5 * _DAY)


def _clock_seconds(
    hours: pd.Series[str], minutes: pd.Series[str], seconds: pd.Series[str], half: pd.Series[str]
) -> Floats:
    count = hours.astype(float)
    afternoon, morning = half.str.lower() == "p", half.str.lower() == "a"
    count = count + 12.0 * (afternoon & (count < 12)) - 12.0 * (morning & (count == 12))
    rest = seconds.fillna("0").str.replace(",", ".", regex=False).astype(float)
    return np.asarray(3600.0 * count + 60.0 * minutes.astype(float) + rest, dtype=np.float64)
