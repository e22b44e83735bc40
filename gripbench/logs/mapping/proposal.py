"""Propose a channel map: logs in, the text of a TOML file out, with every guess marked as one."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from gripbench.envs.signals import SIGNALS
from gripbench.errors import GripbenchError
from gripbench.logs.importing import assemble, mapped_series
from gripbench.logs.mapping.channel_map import ChannelMap
from gripbench.logs.mapping.naming import REFERENCE_ALWAYS, Guess, guesses, written_unit
from gripbench.logs.mapping.time_columns import TimeTable, time_table
from gripbench.logs.mapping.units import UNITS, proposed_unit
from gripbench.logs.quality.plausibility import settled
from gripbench.logs.quality.speeds import speed_of
from gripbench.logs.readers.log import Log, LogColumn

_SPEEDS = ("speed_x", "speed_gps")
_STEERING_RATIO = 16.0
_WIDEST_ROAD_ANGLE = 0.9  # rad; wheels turn no further
_RADIUS = 0.3  # m
_MENDS = 3
_CAR_SPEED = 12.0  # m/s; what drives so fast is of a passenger car's size
_CAR = {
    "mass": 1500.0, "yaw_inertia": 2500.0, "cg_to_front": 1.2, "cg_to_rear": 1.5,
    "cg_height": 0.55, "track_front": 1.55, "track_rear": 1.55, "wheel_radius": _RADIUS,
    "longitudinal_stiffness": 80000.0, "cornering_stiffness_front": 100000.0,
    "cornering_stiffness_rear": 120000.0,
}  # fmt: skip
"""A middling passenger car, stiffnesses of both tyres of an axle."""
_SIGN_NAMES = re.compile(r"(sign|vz|vorzeichen|dir(ection)?)$", re.I)
_VALID_NAMES = re.compile(r"(valid|ok|qf|validity)$", re.I)


@dataclass
class Entry:
    """One mapped column: its keys, and what was taken for granted."""

    keys: dict[str, Any]
    reasons: list[str] = field(default_factory=list)
    told: bool = True  # whether the log itself tells the unit


@dataclass
class Draft:
    """A map being proposed; `tables` has the columns by key, such as `channels.yaw_rate`."""

    top: dict[str, Any]
    times: dict[str, TimeTable]
    files: dict[str, dict[str, Any]]
    tables: dict[str, Entry]
    instruments: list[str] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    extra: dict[str, dict[str, Any]] = field(default_factory=dict)
    vehicle: dict[str, dict[str, Any]] = field(default_factory=dict)

    def content(self) -> dict[str, Any]:
        """Return the map as a dictionary."""
        whole: dict[str, Any] = dict(self.top)
        for short, table in self.times.items():
            if short:
                whole.setdefault("files", {})[short] = {**self.files[short], "time": table.keys}
            elif table.keys:
                whole["time"] = table.keys
        for key, entry in self.tables.items():
            table_name, _, name = key.partition(".")
            whole.setdefault(table_name, {})[name] = entry.keys
        whole |= self.extra
        if self.vehicle:
            whole["vehicle"] = self.vehicle
        if self.instruments:
            whole["derived"] = {"instruments": self.instruments}
        return whole


def propose(path: Path, logs: dict[str, Log], databases: tuple[str, ...] = ()) -> str:
    """Return a map for logs by short name; one that is alone has the empty name."""
    made = draft(path, logs, databases)
    _mend_by_physics(made, logs)
    _add_vehicle(made, logs)
    return text_of(made)


def draft(path: Path, logs: dict[str, Log], databases: tuple[str, ...]) -> Draft:
    """Return the map that the columns' names, units and numbers suggest."""
    name = re.sub(r"\W+", "_", path.stem.lower()).strip("_")
    top: dict[str, Any] = {
        "name": name if re.match(r"[a-z]", name) and name.isascii() else "log_" + re.sub(
            r"[^a-z0-9_]+", "_", name
        ),
        "description": "",
        "licence": "",
    }  # fmt: skip
    files: dict[str, dict[str, Any]] = {}
    for short, log in logs.items():
        about: dict[str, Any] = {"sha256": log.sha256}
        if databases:
            about["database"] = databases[0] if len(databases) == 1 else list(databases)
        if "decimal" in log.suggestions:
            about["decimal"] = ","
        if short:
            files[short] = {"path": log.path.name, **about}
        else:
            top |= about
    made = Draft(top, {short: time_table(log) for short, log in logs.items()}, files, {})
    for short, log in logs.items():
        _add_columns(made, short, log)
    _settle_speed(made)
    _add_poses(made, logs)
    return made


def text_of(made: Draft) -> str:
    """Return the TOML text of a draft."""
    lines = [
        "# Proposed from the names, units and numbers of the columns. Look at every line that is",
        "# marked GUESS; the rest is what the log itself says.",
    ]
    lines += [f"{key} = {_toml(value)}" for key, value in made.top.items()]
    for short, table in made.times.items():
        if short:
            lines += ["", f"[files.{short}]"]
            lines += [f"{key} = {_toml(value)}" for key, value in made.files[short].items()]
        if table.keys or table.reasons:
            lines += ["", f"[files.{short}.time]" if short else "[time]"]
        lines += [f"# GUESS: {reason}" for reason in table.reasons]
        lines += [f"{key} = {_toml(value)}" for key, value in table.keys.items()]
    for key, entry in made.tables.items():
        lines += ["", f"[{key}]"]
        lines += [f"# GUESS: {reason}" for reason in entry.reasons]
        lines += [f"{name} = {_toml(value)}" for name, value in entry.keys.items()]
    for key, keys in made.extra.items():
        lines += ["", f"[{key}]"]
        lines += [f"{name} = {_toml(value)}" for name, value in keys.items()]
    if made.instruments:
        lines += ["", "[derived]", "# GUESS: the reference's speed serves as a sensor, too"]
        lines.append(f"instruments = {_toml(made.instruments)}")
    if made.vehicle:
        lines += [
            "", "[vehicle]",
            "# GUESS: all of it, a middling passenger car; put your car's own values and sources.",
            "# 'gripbench identify' and 'study' find the stiffnesses where the log tells them.",
        ]  # fmt: skip
        lines += [f"{name} = {_toml(value)}" for name, value in made.vehicle.items()]
    if made.unknown:
        lines += ["", "# Columns that no signal was found for:"]
        lines += [f"#   {_toml(name)}{made.left_out.get(name, '')}" for name in made.unknown]
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(one)}" for key, one in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml(one) for one in value) + "]"
    return repr(value)


def _add_columns(made: Draft, short: str, log: Log) -> None:
    time = made.times[short].keys
    of_time = {time.get("column"), time.get("date")}
    found = guesses(name for name in log.columns if name not in of_time)
    rivals: dict[str, list[str]] = {}
    for name, column in log.columns.items():
        if name in of_time:
            continue
        guess = found.get(name)
        if guess is None or column.is_text or not np.isfinite(column.values).any():
            made.unknown.append(f"{short}: {name}" if short else name)
            if guess is not None:
                made.left_out[made.unknown[-1]] = _why_not(guess, column)
            continue
        table = "reference" if guess.reference or guess.signal in REFERENCE_ALWAYS else "channels"
        key = f"{table}.{guess.signal}"
        if key in made.tables:
            rivals.setdefault(key, []).append(name)
            continue
        entry = _entry(name, column, guess, log)
        if entry is None:
            made.unknown.append(f"{short}: {name}" if short else name)
            continue
        if short:
            entry.keys = {"column": name, "file": short, **entry.keys}
        made.tables[key] = entry
    for key, names in rivals.items():
        made.tables[key].reasons.append(f"taken before {', '.join(names[:5])}")


def _why_not(guess: Guess, column: LogColumn) -> str:
    """Return why a column that looks like a signal is none."""
    words = [str(one) for one in column.values if isinstance(one, str) and not _number(one)]
    held = f"it holds text such as {_toml(words[0][:20])}" if words else "it is blank"
    return f": {guess.signal} by its name, but {held}"


def _number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _entry(name: str, column: LogColumn, guess: Guess, log: Log) -> Entry | None:
    """Return the table of a column, or None where its unit measures something else."""
    unit, told = _unit(name, column, guess)
    if unit is None:
        return None
    keys: dict[str, Any] = {"column": name, "unit": unit}
    reasons = [guess.reason] if guess.reason else []
    if not told:
        reasons.append(f"no unit is written: {unit} is taken")
    if guess.sign < 0:
        keys["sign"] = -1
    if guess.offset:
        keys["offset"] = guess.offset
    if UNITS[unit].dimension != UNITS[SIGNALS[guess.signal].unit].dimension:
        keys["per"] = "wheel_radius"
        keys["radius"] = _RADIUS
        reasons.append(f"where the map names no vehicle, the wheels' radius is {_RADIUS:g} m")
    if guess.signal == "steer_angle":
        _steering(name, column, keys, reasons, log)
    return Entry(keys, reasons, told)


def _unit(name: str, column: LogColumn, guess: Guess) -> tuple[str | None, bool]:
    """Return a column's unit, None where it is of another kind, and whether the log tells it."""
    target = SIGNALS[guess.signal].unit
    wanted = [UNITS[target].dimension]
    if guess.signal.startswith("wheel_speed"):
        wanted.append(UNITS["m/s"].dimension)  # a wheel's speed at its circumference
    written = proposed_unit(column.unit) if column.unit else None
    for unit in (written, written_unit(name)):
        if unit is not None and UNITS[unit].dimension in wanted:
            return unit, True
    if written is not None and written != "-":
        return None, True
    if guess.unit:
        return guess.unit, True
    return target, False


def _steering(
    name: str, column: LogColumn, keys: dict[str, Any], reasons: list[str], log: Log
) -> None:
    """Add the ratio of a steering wheel, and what else its sensor puts beside the angle."""
    stem = re.sub(r"[^.:/]*$", "", name)
    for other in log.columns:
        if other == name or not other.startswith(stem):
            continue
        if "steer" not in other.lower() and not stem:
            continue
        if _SIGN_NAMES.search(other) and np.all(column.values[np.isfinite(column.values)] >= 0.0):
            keys["negative_where"] = other
        elif _VALID_NAMES.search(other) and len(log.columns[other].values) == len(column.values):
            keys["valid_where"] = other
    filled = column.values[np.isfinite(column.values)]
    widest = float(np.max(np.abs(filled))) * UNITS[keys["unit"]].factor
    wheel = re.search(r"wheel|sw\b|_sw|swa|lws|lenk|steered|esp|lwi|hand", name, re.I)
    if widest > _WIDEST_ROAD_ANGLE or (wheel and widest > 0.1):
        keys["scale"] = 1.0 / _STEERING_RATIO
        reasons.append(
            f"a steering wheel's angle; {_STEERING_RATIO:g} is a usual steering ratio, put your "
            "car's own"
        )


def _mend_by_physics(made: Draft, logs: dict[str, Log]) -> None:
    """Set units and signs that the log does not tell so that the laws of the vehicle hold."""
    free = {key for key, entry in made.tables.items() if not entry.told}
    try:
        content = ChannelMap.model_validate(made.content())
        channels, reference, _ = mapped_series(logs, content, {})
    except (GripbenchError, ValidationError):  # the import will say it
        return
    if free:
        _set(made, settled(channels, reference, {}, free))
    for _ in range(_MENDS):
        try:
            report = assemble(logs, ChannelMap.model_validate(made.content()), {}).report
        except (GripbenchError, ValidationError):  # the import will say it
            return
        changes = {
            key: keys
            for finding in report.findings
            if finding.check == "physics"
            for key, keys in finding.changes.items()
            if key in made.tables and (not made.tables[key].told or "unit" not in keys)
        }
        if not changes:
            return
        _set(made, changes)


def _add_vehicle(made: Draft, logs: dict[str, Log]) -> None:
    """Propose a passenger car's parameters where the log is one's, for without them little runs."""
    try:
        content = ChannelMap.model_validate(made.content())
        channels, reference, _ = mapped_series(logs, content, {})
    except (GripbenchError, ValidationError):  # the import will say it
        return
    speed = speed_of(channels, reference, {"wheel_radius": _RADIUS})
    turns = {"yaw_rate", "steer_angle"} & set(channels)
    if speed is not None and turns and np.nanpercentile(np.abs(speed.values), 90.0) > _CAR_SPEED:
        source = "guess: a middling passenger car"
        made.vehicle = {
            name: {"value": value, "source": source, "guess": True} for name, value in _CAR.items()
        }


def _set(made: Draft, changes: dict[str, dict[str, Any]]) -> None:
    for key, keys in changes.items():
        if key in made.tables:
            made.tables[key].keys |= keys
            said = ", ".join(f"{name} = {_toml(value)}" for name, value in keys.items())
            made.tables[key].reasons.append(f"{said}: so says the physics of the other channels")


def _add_poses(made: Draft, logs: dict[str, Log]) -> None:
    """Map positions and quaternions, which no single column's name tells."""
    for short, log in logs.items():
        file = {"file": short} if short else {}
        names = {
            re.sub(r"[^a-z]", "", name.lower().rpartition(".")[2]): name for name in log.columns
        }
        latitude = names.get("lat", names.get("latitude"))
        longitude = names.get("lon", names.get("long", names.get("longitude", names.get("lng"))))
        usable = find_spec("pymap3d") is not None
        if usable and latitude and longitude and "geodetic" not in made.extra:
            made.extra["geodetic"] = {
                "latitude": {"column": latitude, "unit": "deg", **file},
                "longitude": {"column": longitude, "unit": "deg", **file},
            }
            made.unknown = [name for name in made.unknown if name not in (latitude, longitude)]
        parts = [names.get(one) for one in ("qx", "qy", "qz", "qw")]
        if all(parts) and "attitude" not in made.extra:
            made.extra["attitude"] = {"quaternion": parts, "counts_from": "north", **file}
            for name, target in (("tx", "position_x"), ("ty", "position_y")):
                if name in names and f"channels.{target}" not in made.tables:
                    entry = Entry(
                        {"column": names[name], "unit": "m", **file},
                        ["the frame of the pose is taken for north and west"],
                    )
                    made.tables[f"channels.{target}"] = entry
            known = {*parts, names.get("tx"), names.get("ty")}
            made.unknown = [name for name in made.unknown if name not in known]


def _settle_speed(made: Draft) -> None:
    """Leave a forward speed beside its lateral one, and see that some channel has a speed."""
    if "channels.speed_x" in made.tables and "reference.speed_y" in made.tables:
        entry = made.tables.pop("channels.speed_x")
        made.tables.setdefault("reference.speed_x", entry)
    if not any(key.startswith("channels.") for key in made.tables):
        made.tables = {
            "channels." + key.partition(".")[2]: entry for key, entry in made.tables.items()
        }
    channels = {key.partition(".")[2] for key in made.tables if key.startswith("channels.")}
    if not channels & set(_SPEEDS) and "reference.speed_x" in made.tables:
        made.instruments.append("speed_x")
