"""One mapped column as a series: its samples in SI units at their own times."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.compilation import compiled
from gripbench.envs.signals import signal
from gripbench.envs.vehicles import VEHICLE_PARAMETERS
from gripbench.errors import InputError
from gripbench.logs.channels.clock import times_of
from gripbench.logs.mapping.map_tables import Column, TimeColumn
from gripbench.logs.mapping.units import conversion
from gripbench.logs.readers.log import Log

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Series:
    """The samples of one channel.

    Attributes
    ----------
    name
        Signal.
    key
        Where the map has it, such as `channels.yaw_rate`.
    times
        Strictly increasing times [s], shape (n,).
    values
        Values in the signal's unit, shape (n,), all finite.
    column
        The entry of the map.
    log_unit
        Unit as the log writes it.
    repeated, backwards, missing, infinite
        How many rows of the log had the time of the row before, went back in time, had no value,
        or an infinite one; none of them is in `values` (of rows with one time the last one is).
    """

    name: str
    key: str
    times: Floats
    values: Floats
    column: Column
    log_unit: str = ""
    repeated: int = 0
    backwards: int = 0
    missing: int = 0
    infinite: int = 0


def series_of(
    log: Log,
    name: str,
    key: str,
    column: Column,
    time: TimeColumn,
    vehicle: dict[str, float],
    target: str = "",
) -> Series:
    """Return one mapped column of a log.

    Parameters
    ----------
    log
        The log that has the column.
    name, key, column
        Signal, its place in the map, and its entry there.
    time
        The file's time column.
    vehicle
        Vehicle parameters, of which `column.per` names one.
    target
        Unit that the values come out in; empty: the signal's.

    Raises
    ------
    InputError
        If a column is missing or holds no numbers, times go backwards, no sample is left, or the
        vehicle parameter is not given.
    """
    raw = log.column(column.column, f"{key}.column")
    values = log.numbers(column.column, f"{key}.column")
    times = times_of(log, raw, time, column.time, key)
    if len(times) != len(values):
        raise InputError(
            f"{log.path}: key '{key}': {len(values)} values but {len(times)} times: "
            "name this channel's own time column"
        )
    values = _signed_and_valid(log, key, column, values)
    if column.table:
        low, high = column.table[0][0], column.table[-1][0]
        beyond = (values - column.offset < low) | (values - column.offset > high)
        values = np.where(beyond, np.nan, values)
    if column.rollover > 0.0:
        values = _run_on(values, column.rollover)
    finite = np.isfinite(values) & np.isfinite(times)
    infinite = int(np.isinf(values).sum())
    missing = len(values) - int(finite.sum()) - infinite
    marks = _marks(log, key, column, len(values))
    times, values = times[finite], values[finite]
    if not len(times):
        raise InputError(f"{log.path}: key '{key}': column '{column.column}' has no sample")
    keep, repeated, backwards = _forward(log.path, key, times, time)
    times, values = times[keep], values[keep]
    new = _new_samples(times, values, column.rate, None if marks is None else marks[finite][keep])
    times, values = times[new], values[new]
    if column.rate_over > 0.0:
        times, values = _change_rate(log.path, key, times, values, column.rate_over)
    return Series(
        name=name,
        key=key,
        times=times + (time.shift + column.shift),
        values=_convert(log.path, name, key, values, column, vehicle, target),
        column=column,
        log_unit=raw.unit,
        repeated=repeated,
        backwards=backwards,
        missing=missing,
        infinite=infinite,
    )


def _signed_and_valid(log: Log, key: str, column: Column, values: Floats) -> Floats:
    """Return the values with the sign, and blanks, that columns beside them tell."""
    for name, marked in (
        ("negative_where", column.negative_where),
        ("valid_where", column.valid_where),
    ):
        if not marked:
            continue
        marks = log.numbers(marked, f"{key}.{name}")
        if len(marks) != len(values):
            raise InputError(
                f"{log.path}: key '{key}.{name}': column '{marked}' has another length"
            )
        if name == "negative_where":
            values = np.where(marks != 0.0, -values, values)
        else:
            values = np.where(marks != 0.0, values, np.nan)
    return values


def _run_on(counts: Floats, rollover: float) -> Floats:
    """Return a counter that does not start at 0 again."""
    found = counts.copy()
    filled = np.flatnonzero(np.isfinite(counts))
    steps = np.diff(counts[filled])
    steps -= rollover * np.round(steps / rollover)
    found[filled[1:]] = counts[filled[0]] + np.cumsum(steps)
    return found


def _forward(
    path: Path, key: str, times: Floats, time: TimeColumn
) -> tuple[npt.NDArray[Any], int, int]:
    """Return which rows to keep so that time strictly increases, and what was left out."""
    latest = np.maximum.accumulate(times)
    early = times < latest
    if early.any() and time.backwards == "refuse":
        row = int(np.argmax(early))
        raise InputError(
            f"{path}: key '{key}': time runs backwards at sample {row + 1} "
            f"({times[row]:.6f} s after {latest[row]:.6f} s): split the log with 'runs', or say "
            'time.backwards = "drop"'
        )
    kept = np.flatnonzero(~early)
    last_of_time = np.append(np.diff(times[kept]) > 0.0, True)
    return kept[last_of_time], int((~last_of_time).sum()), int(early.sum())


def _marks(log: Log, key: str, column: Column, length: int) -> npt.NDArray[np.bool_] | None:
    """Return which rows have a new sample as a column of the log tells, or None."""
    name = column.new_when or column.new_where
    if not name:
        return None
    where = f"{key}.{'new_when' if column.new_when else 'new_where'}"
    marks = log.numbers(name, where)
    if len(marks) != length:
        raise InputError(f"{log.path}: key '{where}': column '{name}' has another length")
    new = marks != 0.0
    if column.new_when:
        new = np.append(True, np.diff(marks) != 0.0)
    new[0] = True
    return new


def _new_samples(
    times: Floats, values: Floats, rate: float, marks: npt.NDArray[np.bool_] | None
) -> npt.NDArray[np.bool_]:
    if marks is not None:
        return marks
    if rate > 0.0:
        return _changed_or_due(times, values, 1.5 / rate)
    return np.ones(len(times), dtype=bool)


@compiled
def _changed_or_due(times, values, longest):  # type: ignore[no-untyped-def]
    new = np.ones(len(times), dtype=np.bool_)
    since = times[0]
    for row in range(1, len(times)):
        new[row] = values[row] != values[row - 1] or times[row] - since >= longest
        if new[row]:
            since = times[row]
    return new


def _change_rate(
    path: Path, key: str, times: Floats, values: Floats, over: float
) -> tuple[Floats, Floats]:
    """Return the change per second up to each sample, from that `over` seconds before it."""
    later = times >= times[0] + over
    if not later.any():
        raise InputError(f"{path}: key '{key}.rate_over': the log is shorter than {over:g} s")
    before = np.interp(times[later] - over, times, values)
    return times[later], (values[later] - before) / over


def _convert(
    path: Path,
    name: str,
    key: str,
    values: Floats,
    column: Column,
    vehicle: dict[str, float],
    target: str,
) -> Floats:
    per_unit = VEHICLE_PARAMETERS[column.per].unit if column.per else ""
    try:
        unit = conversion(column.unit, target or signal(name).unit, per_unit)
    except InputError as error:
        raise InputError(f"channel map: key '{key}.unit': {error}") from None
    factor = column.sign * column.scale * unit / (column.pulses or 1)
    if column.per == "wheel_radius" and column.per not in vehicle and column.radius > 0.0:
        factor /= column.radius
    elif column.per:
        if column.per not in vehicle:
            raise InputError(
                f"{path}: key '{key}.per': the vehicle gives no '{column.per}'; "
                "name a vehicle that does"
            )
        factor /= vehicle[column.per]
    counted = values - column.offset
    if column.table:
        given, meant = zip(*column.table, strict=True)
        counted = np.interp(counted, given, meant)
    converted = factor * counted
    return wrapped(converted) if name == "course" and not target else converted


def wrapped(angle: Floats) -> Floats:
    """Return an angle within -pi to pi."""
    return np.arctan2(np.sin(angle), np.cos(angle))
