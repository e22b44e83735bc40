"""Look at a log before there is a map: list its columns and propose a map to start from."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from gripbench.envs.signals import SIGNALS
from gripbench.logs.channel_map import LogFile
from gripbench.logs.readers import Log, LogColumn, read_log
from gripbench.logs.units import UNITS, proposed_unit


@dataclass(frozen=True)
class Summary:
    """One column of a log in figures; those of a text column are its first values."""

    name: str
    unit: str
    samples: int
    blanks: int
    low: str
    high: str


@dataclass(frozen=True)
class Inspection:
    """What is in a log, and the map that is proposed for it."""

    columns: tuple[Summary, ...]
    time: str
    proposal: str


_GUESSES: tuple[tuple[str, str, int], ...] = (
    # pattern of the column's name, signal, sign where the name itself tells it
    (r"(steer|swa|lws).*(wheel|sw|angle)|^steer|^delta", "steer_angle", 1),
    (r"(w|wheel|v|speed|spd|n).*(fl|front_?left|lf)\b", "wheel_speed_front_left", 1),
    (r"(w|wheel|v|speed|spd|n).*(fr|front_?right|rf)\b", "wheel_speed_front_right", 1),
    (r"(w|wheel|v|speed|spd|n).*(rl|rear_?left|lr)\b", "wheel_speed_rear_left", 1),
    (r"(w|wheel|v|speed|spd|n).*(rr|rear_?right)\b", "wheel_speed_rear_right", 1),
    (r"beta|side_?slip|slip_?angle", "sideslip", 1),
    (r"course|cog|track_?angle", "course", -1),
    (r"(gps|gnss).*(speed|vel)|^sog|speed_?(gps|gnss)", "speed_gps", 1),
    (r"(gyr|omega|rate|gyro).*(z|yaw|up)\b|yaw_?rate|^psi_?dot|^r(_imu)?$", "yaw_rate", 1),
    (r"(gyr|omega|rate|gyro).*down", "yaw_rate", -1),
    (r"(gyr|omega|rate|gyro).*(x|roll|fwd)\b|roll_?rate", "roll_rate", 1),
    (r"(gyr|omega|rate|gyro).*(y|pitch|left)\b|pitch_?rate", "pitch_rate", 1),
    (r"a(cc|ccel|cceleration)?_?(x|fwd|long\w*)(_imu)?\b", "accel_x", 1),
    (r"a(cc|ccel|cceleration)?_?(y|left|lat\w*)(_imu)?\b", "accel_y", 1),
    (r"a(cc|ccel|cceleration)?_?right", "accel_y", -1),
    (r"a(cc|ccel|cceleration)?_?(z|up|vert\w*)(_imu)?\b", "accel_z", 1),
    (r"a(cc|ccel|cceleration)?_?down", "accel_z", -1),
    (r"mag\w*_?(x|fwd)\b", "magnetic_field_x", 1),
    (r"mag\w*_?(y|left)\b", "magnetic_field_y", 1),
    (r"mag\w*_?right", "magnetic_field_y", -1),
    (r"mag\w*_?(z|up)\b", "magnetic_field_z", 1),
    (r"mag\w*_?down", "magnetic_field_z", -1),
    (r"^(v|vel|speed|velocity)_?(x|fwd)\b", "speed_x", 1),
    (r"^(v|vel|speed|velocity)_?(y|left)\b", "speed_y", 1),
    (r"^(v|vel|speed|velocity)_?right", "speed_y", -1),
    (r"heading|^yaw|^psi", "yaw", 1),
)
_REFERENCE = ("sideslip", "speed_x", "speed_y", "yaw")
_TIME = re.compile(r"^(t|time|timestamps?|t_s|utc|zeit|date_?time)(_?(s|ms|us|ns|sec))?$", re.I)


def inspect_log(path: Path, database: str = "") -> Inspection:
    """List the columns of a log and propose a map.

    Parameters
    ----------
    path
        The file.
    database
        DBC file, for a CAN trace.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    log = read_log(path, LogFile(path=path.name, database=database))
    columns = tuple(_summary(name, column) for name, column in log.columns.items())
    time = _time_column(log)
    return Inspection(columns, time, _proposal(log, time, database))


def _summary(name: str, column: LogColumn) -> Summary:
    blanks = int(pd.isna(column.values).sum())
    filled = column.values[~pd.isna(column.values)]
    if not len(filled):
        return Summary(name, column.unit, len(column.values), blanks, "-", "-")
    if column.is_text:
        low, high = str(filled[0])[:24], str(filled[-1])[:24]
    else:
        low, high = f"{np.min(filled):.6g}", f"{np.max(filled):.6g}"
    return Summary(name, column.unit, len(column.values), blanks, low, high)


def _time_column(log: Log) -> str:
    """Return the column that is most likely the time; empty where samples carry theirs."""
    if all(column.times is not None for column in log.columns.values()):
        return ""
    named = [name for name in log.columns if _TIME.match(name)]
    if named:
        return named[0]
    for name, column in log.columns.items():
        if not column.is_text and len(column.values) > 1 and np.all(np.diff(column.values) > 0.0):
            return name
    return ""


def _proposal(log: Log, time: str, database: str) -> str:
    name = re.sub(r"\W+", "_", log.path.stem.lower()).strip("_")
    lines = [
        "# Proposed from the names of the columns: check every unit and sign.",
        f'name = "{name if name[:1].isalpha() else "log_" + name}"',
        'description = ""',
        'licence = ""',
        f'sha256 = "{log.sha256}"',
    ]
    if database:
        lines.append(f'database = "{database}"')
    if time:
        unit = "datetime" if log.columns[time].is_text else _unit_of(time, "s", "")
        lines += ["", "[time]", f'column = "{time}"', f'unit = "{unit}"']
    taken: set[str] = {"time"}
    for column_name, column in log.columns.items():
        if column_name == time or column.is_text:
            continue
        guess = _guess(column_name)
        if guess is None or guess[0] in taken:
            continue
        target, sign = guess
        taken.add(target)
        table = "reference" if target in _REFERENCE else "channels"
        unit = _unit_of(column_name, SIGNALS[target].unit, column.unit)
        lines += ["", f"[{table}.{target}]", f'column = "{column_name}"', f'unit = "{unit}"']
        if sign < 0:
            lines.append("sign = -1")
        if UNITS[unit].dimension != UNITS[SIGNALS[target].unit].dimension:
            lines.append('per = "wheel_radius"  # of the vehicle that the map names')
    return "\n".join(lines) + "\n"


def _guess(column: str) -> tuple[str, int] | None:
    plain = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", column).lower()
    plain = re.sub(r"[^a-z0-9]+", "_", plain.rpartition(".")[2]).strip("_")
    plain = re.sub(r"_(mps2?|m_s2?|kmh|kph|deg|degs|rad|rads|g|raw|ut)$", "", plain)
    if plain in SIGNALS:
        return plain, 1
    spaced = plain.replace("_", " ")
    for pattern, target, sign in _GUESSES:
        if re.search(pattern, plain) or re.search(pattern, spaced):
            return target, sign
    return None


def _unit_of(column: str, target: str, written: str) -> str:
    """Return the unit that the log writes or the column's name ends in, else the signal's own."""
    wanted = [UNITS[target].dimension]
    if target == "rad/s" and "gyr" not in column.lower():
        wanted.append(UNITS["m/s"].dimension)  # a wheel's speed at its circumference
    ending = re.search(r"(?:_|\[|\()([^_\[\]()]+)[\])]?$", column)
    for text in (written, ending.group(1) if ending else ""):
        unit = proposed_unit(text) if text else None
        if unit is not None and UNITS[unit].dimension in wanted:
            return unit
    return target
