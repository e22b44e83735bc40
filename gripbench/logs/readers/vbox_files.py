"""Read Racelogic VBOX text (.vbo): sections, then a table; times and positions are unpacked.

Its time of day is HHMMSS.sss, its latitude and longitude are minutes, west positive: they come out
as seconds of the day and as degrees, north and east positive.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gripbench.errors import InputError
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers.log import Content, LogColumn, distinct
from gripbench.logs.readers.text_tables import text_of

_DAY = 86400.0
_UNITS = {"time": "s", "lat": "deg", "long": "deg", "heading": "deg", "height": "m", "sats": ""}


def read(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Read a VBOX file.

    Raises
    ------
    InputError
        If it has no `[column names]` or no `[data]`, or a row has another number of values.
    """
    text = text_of(path)
    sections = _sections(text)
    for name in ("column names", "data"):
        if not sections.get(name):
            raise InputError(f"{path}: the section [{name}] is missing or empty")
    given = " ".join(sections["column names"]).split()
    rows = [line.replace(",", ".").split() for line in sections["data"]]
    content = Content()
    if len(rows[-1]) != len(given) and len(rows) > 1:
        content.notes.append("the last line is cut off and was left out")
        rows.pop()
    for order, row in enumerate(rows):
        if len(row) != len(given):
            raise InputError(
                f"{path}: row {order + 1} of [data] has {len(row)} values, [column names] "
                f"names {len(given)}"
            )
    try:
        table = np.array(rows, dtype=np.float64)
    except ValueError as error:
        raise InputError(f"{path}: [data] holds something other than numbers ({error})") from None
    names, content.twins = distinct(given)
    content.names = names
    units = _units(sections, given)
    for index, name in enumerate(names):
        values = table[:, index]
        if given[index] == "time":
            values = _seconds_of_day(values)
        elif given[index] in ("lat", "latitude"):
            values = values / 60.0
        elif given[index] in ("long", "longitude"):
            values = -values / 60.0
        if wanted is None or name in wanted:
            content.columns[name] = LogColumn(values, unit=units[index])
    return content


def _sections(text: str) -> dict[str, list[str]]:
    sections: dict[str, list[str]] = {}
    current: list[str] = []
    for line in text.split("\n"):
        found = re.fullmatch(r"\s*\[([^\]]+)\]\s*", line)
        if found:
            current = sections.setdefault(found.group(1).strip().lower(), [])
        elif line.strip():
            current.append(line.strip())
    return sections


def _units(sections: dict[str, list[str]], names: list[str]) -> list[str]:
    """Return the unit of each column; [channel units] are those of the last columns."""
    units = [_UNITS.get(name, "") for name in names]
    header = sections.get("header", [])
    for index, name in enumerate(names):
        if name.startswith("velocity") or name == "speed":
            spelled = header[index].lower() if index < len(header) else ""
            units[index] = next(
                (unit for word, unit in (("mph", "mph"), ("knots", "kn"), ("m/s", "m/s"))
                 if word in spelled),
                "km/h",
            )  # fmt: skip
    own = sections.get("channel units", [])
    if own and len(own) <= len(names):
        units[len(names) - len(own) :] = own
    return units


def _seconds_of_day(stamps: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    hours, rest = np.divmod(stamps, 10_000.0)
    minutes, seconds = np.divmod(rest, 100.0)
    times = 3600.0 * hours + 60.0 * minutes + seconds
    midnights = np.cumsum(np.diff(times, prepend=times[0]) < -0.5 * _DAY)
    return times + _DAY * midnights
