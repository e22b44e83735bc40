"""Turn a log and its channel map into recordings like simulated ones.

Rates are kept: a row holds the last sample of every channel, and `<channel>_new` is 1 in the
rows where a sample of it arrived. The reference is interpolated between its own samples, which
its `_new` flags mark; where it has a hole the truth is NaN.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from gripbench.configuration import parse
from gripbench.envs.recordings import Recording
from gripbench.envs.signals import NEW, record_type
from gripbench.envs.vehicles import CarOnPaper
from gripbench.errors import InputError
from gripbench.logs.channels.derivation import derive_channels, derive_reference
from gripbench.logs.channels.geometry import SAE_TURNED, levelled, placed
from gripbench.logs.channels.initial import zeroed
from gripbench.logs.channels.series import Floats, Series, series_of, wrapped
from gripbench.logs.channels.sources import add_sources
from gripbench.logs.mapping.channel_map import ChannelMap, LogFile, load_channel_map, vehicle_values
from gripbench.logs.mapping.map_tables import Column
from gripbench.logs.quality.report import QualityReport, judge
from gripbench.logs.quality.speeds import speed_of
from gripbench.logs.readers.log import Log, LogColumn, log_of_frame
from gripbench.logs.readers.reading import read_log
from gripbench.logs.windows import check_windows, placed_bound, placed_windows

_MAXIMUM_GAP = 3.0  # reference samples further apart than this many median intervals leave a hole
_GPS = ("course", "speed_gps", "velocity_north", "velocity_west")


@dataclass(frozen=True)
class Provenance:
    """Where a recording comes from.

    Attributes
    ----------
    name, description, licence, source, version
        As the map says.
    files
        Hash (SHA-256) of every file, by file name.
    channel_map
        The map itself.
    gripbench
        Version that imported it.
    """

    name: str
    description: str
    licence: str
    source: str
    version: str
    files: dict[str, str]
    channel_map: dict[str, Any]
    gripbench: str


@dataclass(frozen=True, eq=False)
class ImportedLog:
    """The recordings of a log, one a run, with what was found about them."""

    recordings: tuple[Recording, ...]
    report: QualityReport
    provenance: Provenance


def import_log(log: Path, channel_map: ChannelMap | Path) -> ImportedLog:
    """Import a log.

    Parameters
    ----------
    log
        The file, or for a map with several files the folder that holds them.
    channel_map
        The map or its file; a vehicle or database given by path lies beside the map's file.

    Raises
    ------
    InputError
        On the first mistake in the map or the log, with file and key.
    """
    beside = channel_map if isinstance(channel_map, Path) else None
    chosen = load_channel_map(channel_map) if isinstance(channel_map, Path) else channel_map
    logs = {}
    for short, file in chosen.log_files(log.name).items():
        path = log / file.path if chosen.files else log
        if chosen.files and not log.is_dir():
            raise InputError(f"{log}: is no folder; the map '{chosen.name}' has several files")
        if beside is not None and file.database:
            databases = tuple(_beside(beside, entry) for entry in file.databases())
            file = file.model_copy(update={"database": databases})
        logs[short] = read_log(path, file, _wanted(chosen, short, file))
    return assemble(logs, chosen, vehicle_values(chosen, beside))


def _beside(channel_map: Path, entry: str) -> str:
    """Return an entry `[CHANNEL=]FILE` with the file's whole path."""
    channel, equals, name = entry.rpartition("=")
    return f"{channel}{equals}{(channel_map.parent / name).resolve()}"


def import_frame(frame: pd.DataFrame, channel_map: ChannelMap | Mapping[str, Any]) -> ImportedLog:
    """Import a frame with a time column.

    Parameters
    ----------
    frame
        One column a channel, and the time column that the map names.
    channel_map
        The map, or its content as a dictionary.
    """
    chosen = (
        channel_map
        if isinstance(channel_map, ChannelMap)
        else parse(ChannelMap, channel_map, "channel map")
    )
    if len(chosen.log_files()) > 1:
        raise InputError("channel map: key 'files': a frame is one log, not several")
    short = next(iter(chosen.log_files()))
    return assemble({short: log_of_frame(frame)}, chosen, vehicle_values(chosen, None))


def _wanted(channel_map: ChannelMap, short: str, file: LogFile) -> set[str]:
    names = {file.time.column, file.time.date, channel_map.runs}
    columns = {**channel_map.keyed_columns(), **channel_map.source_columns()}
    for column in columns.values():
        if channel_map.file_of(column) == short:
            names |= {column.column, column.time, column.new_when, column.new_where}
            names |= {column.negative_where, column.valid_where}
    return names - {""}


def assemble(
    logs: dict[str, Log], channel_map: ChannelMap, vehicle: dict[str, float]
) -> ImportedLog:
    """Return the recordings of logs that are read, by the short names of the map's files.

    Raises
    ------
    InputError
        On the first mistake in the map or the logs.
    """
    recordings: list[Recording] = []
    report = QualityReport(())
    notes = [f"{log.path}: {note}" for log in logs.values() for note in log.notes]
    for run, part in _runs(logs, channel_map):
        recording, found = _recording(part, channel_map, vehicle, run)
        recordings.append(recording)
        report = report.joined(found, run if channel_map.runs else None)
    check_windows(channel_map, recordings)
    provenance = Provenance(
        name=channel_map.name,
        description=channel_map.description,
        licence=channel_map.licence,
        source=channel_map.source,
        version=channel_map.version,
        files={log.path.name: log.sha256 for log in logs.values()},
        channel_map=channel_map.model_dump(mode="json", exclude_defaults=True),
        gripbench=version("gripbench"),
    )
    return ImportedLog(tuple(recordings), report.with_notes(notes), provenance)


def _runs(logs: dict[str, Log], channel_map: ChannelMap) -> list[tuple[int, dict[str, Log]]]:
    if not channel_map.runs:
        return [(0, logs)]
    if len(logs) > 1:
        raise InputError("channel map: key 'runs': works for a log of one file")
    ((short, log),) = logs.items()
    marks = log.numbers(channel_map.runs, "runs")
    if any(column.times is not None for column in log.columns.values()):
        raise InputError(f"{log.path}: key 'runs': works for a table with one row a sample")
    if not np.all(np.isfinite(marks)):
        raise InputError(f"{log.path}: key 'runs': column '{channel_map.runs}' has blanks")
    starts = np.flatnonzero(np.append(True, np.diff(marks) != 0.0))
    ends = np.append(starts[1:], len(marks))
    runs = []
    for order, (start, end) in enumerate(zip(starts, ends, strict=True)):
        mark = marks[start]
        columns = {
            name: LogColumn(column.values[start:end], unit=column.unit)
            for name, column in log.columns.items()
        }
        number = int(mark) if float(mark).is_integer() and mark >= 0 else order
        runs.append((number, {short: replace(log, columns=columns)}))
    numbers = [number for number, _ in runs]
    if len(set(numbers)) < len(numbers):  # a run's number comes twice: count them in order
        return [(order, part) for order, (_, part) in enumerate(runs)]
    return runs


def _recording(
    logs: dict[str, Log], channel_map: ChannelMap, vehicle: dict[str, float], run: int
) -> tuple[Recording, QualityReport]:
    channels, reference, zeros = mapped_series(logs, channel_map, vehicle)
    for name in channel_map.derived.instruments:
        if name not in reference:
            raise InputError(
                f"channel map: key 'derived.instruments': the reference has no '{name}'; "
                f"it has {', '.join(sorted(reference)) or 'nothing'}"
            )
        channels[name] = reference[name]
    rows, dropped = _rows(channels, channel_map, next(iter(logs.values())).path)
    origin = float(rows[0])
    observations = _held(channels, rows, origin)
    truth = _interpolated(reference, rows, origin)
    report = judge(channels, reference, dropped, zeros, vehicle)
    end = float(rows[-1]) - origin
    windows = placed_windows(channel_map, rows)
    if channel_map.training_runs:
        windows["train" if run in channel_map.training_runs else "test"] = ((0.0, end),)
    if channel_map.score_from >= end:
        raise InputError(
            f"channel map: key 'score_from': {channel_map.score_from:g} s is not before the end "
            f"of the recording ({end:.3f} s)"
        )
    recording = Recording(
        scenario=channel_map.name,
        seed=run,
        vehicle=CarOnPaper(vehicle),
        observations=observations,
        truth=truth,
        score_from=channel_map.score_from,
        notes={"time_origin": origin, **{f"zero_{name}": value for name, value in zeros.items()}},
        windows=windows,
        bounds=tuple(
            placed_bound(channel_map, name, bound, origin)
            for name, bounds in channel_map.bounds.items()
            for bound in bounds
        ),
    )
    return recording, report


def mapped_series(
    logs: dict[str, Log], channel_map: ChannelMap, vehicle: dict[str, float]
) -> tuple[dict[str, Series], dict[str, Series], dict[str, float]]:
    """Return channels and reference by signal, in SI units at the centre of gravity, and zeros.

    Raises
    ------
    InputError
        On the first mistake in the map or the logs.
    """
    files = channel_map.log_files()

    def read(name: str, key: str, column: Column, target: str = "") -> Series:
        short = channel_map.file_of(column)
        time = files[short].time
        found = series_of(logs[short], name, key, column, time, vehicle, target)
        if channel_map.axes == "SAE" and not target and name in SAE_TURNED:
            found = replace(found, values=-found.values)
        return found

    series = {
        key: read(key.partition(".")[2], key, column)
        for key, column in channel_map.keyed_columns().items()
    }
    channels = {s.name: s for key, s in series.items() if key.startswith("channels.")}
    reference = {
        s.name: replace(s, times=s.times - s.column.delay)
        for key, s in series.items()
        if key.startswith("reference.")
    }
    add_sources(channel_map, read, channels, reference)
    channels = _with_ratios(channels, reference, vehicle)
    channels, zeros = zeroed(channels)
    channels, reference = placed(channels, reference, channel_map.sensors)
    channels = levelled(channels, reference, channel_map.level)
    channels = derive_channels(channels, channel_map.derived)
    reference = derive_reference(reference, channel_map.derived)
    return channels, reference, zeros


def _with_ratios(
    channels: dict[str, Series], reference: dict[str, Series], vehicle: dict[str, float]
) -> dict[str, Series]:
    """Return the channels divided by what their ratio is at the speed of the moment."""
    found = dict(channels)
    for name, series in channels.items():
        if not series.column.ratio_over_speed:
            continue
        speed = speed_of(channels, reference, vehicle)
        if speed is None:
            raise InputError(
                f"channel map: key '{series.key}.ratio_over_speed': no speed is mapped"
            )
        now = np.interp(series.times, speed.times, np.abs(speed.values))
        at, ratio = zip(*series.column.ratio_over_speed, strict=True)
        if min(abs(one) for one in ratio) == 0.0:
            raise InputError(f"channel map: key '{series.key}.ratio_over_speed': a ratio is 0")
        found[name] = replace(series, values=series.values / np.interp(now, at, ratio))
    return found


def _rows(
    channels: dict[str, Series], channel_map: ChannelMap, path: Path
) -> tuple[Floats, dict[str, int]]:
    """Return the times of the rows, and how many samples fall between them, by channel."""
    if channel_map.rows:
        rows = channels[channel_map.rows].times
    else:
        rows = _merged([s.times for s in channels.values()])
    first = max(s.times[0] for s in channels.values())
    latest = min(channels.values(), key=lambda s: s.times[-1])
    if first > latest.times[-1]:
        late = max(channels.values(), key=lambda s: s.times[0])
        raise InputError(
            f"{path}: key '{late.key}' starts after '{latest.key}' has ended: "
            "their clocks differ, see time.shift"
        )
    rows = rows[rows >= first]
    if len(rows) < 2:
        raise InputError(f"{path}: key '{channel_map.rows or 'channels'}': only {len(rows)} sample")
    dropped = {}
    for name, series in channels.items():
        if np.array_equal(series.times, rows):
            dropped[name] = 0
            continue
        inside = series.times[(series.times >= first) & (series.times <= rows[-1])]
        dropped[name] = int((np.diff(np.searchsorted(rows, inside)) == 0).sum())
    return rows, dropped


def _merged(arrays: list[Floats]) -> Floats:
    """Return all times of the arrays, each once, in order."""
    kept: list[Floats] = []
    for array in arrays:
        if not any(np.array_equal(array, other) for other in kept):
            kept.append(array)
    if len(kept) == 1:
        return kept[0]
    times = np.sort(np.concatenate(kept))
    return times[np.append(True, np.diff(times) > 0.0)]


def _held(channels: dict[str, Series], rows: Floats, origin: float) -> npt.NDArray[Any]:
    names = list(channels)
    flags = [name + NEW for name in names]
    gps = next((name for name in _GPS if name in channels and "gps_time" not in channels), None)
    extra = [] if gps is None else ["gps_time"]
    observations = np.empty(len(rows), record_type(["time", *names, *extra, *flags]))
    observations["time"] = rows - origin
    for name, series in channels.items():
        if np.array_equal(series.times, rows):
            at = np.arange(len(rows))
        else:
            at = np.searchsorted(series.times, rows, side="right") - 1
        values = series.values - origin if name == "gps_time" else series.values
        observations[name] = values[at]
        observations[name + NEW] = np.append(True, np.diff(at) > 0)
        if name == gps:
            observations["gps_time"] = series.times[at] - series.column.delay - origin
    return observations


def _interpolated(reference: dict[str, Series], rows: Floats, origin: float) -> npt.NDArray[Any]:
    names = list(reference)
    truth = np.empty(len(rows), record_type(["time", *names, *(name + NEW for name in names)]))
    truth["time"] = rows - origin
    for name, series in reference.items():
        values = series.values
        if name in ("course", "yaw"):
            values = np.unwrap(values)
        at = np.searchsorted(series.times, rows, side="right") - 1
        spacing = np.diff(series.times)
        longest = _MAXIMUM_GAP * np.median(spacing) if len(spacing) else 0.0
        after = np.minimum(at + 1, len(series.times) - 1)
        hole = (at < 0) | (series.times[after] - series.times[np.maximum(at, 0)] > longest)
        hole |= rows > series.times[-1]
        hole &= ~np.isin(rows, series.times)
        between = np.interp(rows, series.times, values)
        between[hole] = np.nan
        truth[name] = wrapped(between) if name == "course" else between
        truth[name + NEW] = np.append(at[0] >= 0, np.diff(at) > 0)
    return truth
