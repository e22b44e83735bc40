"""The store of rows: one JSON file a row, written whole or not at all.

`<results>/rows/<scenario>/<label>/<seed>.json`, in names that every file system takes. Every file
carries a checksum of its content, so a truncated or damaged one is known as such, and that cell
alone runs again. What other programs leave in the folder is not looked at.
"""

from __future__ import annotations

import hashlib
import json
import re
import stat
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from gripbench.bench.running.check_records import mark_of
from gripbench.bench.running.rows import Checked, Row, frame_of, is_newer, row_from
from gripbench.errors import InputError, one_line
from gripbench.sources import digest
from gripbench.writing import DEFAULT_RESULTS, write_atomically

if TYPE_CHECKING:
    import pandas as pd

_HEAD = '{"checksum": "'
_MIDDLE = '", "row": '
_DIGEST = 64
_START = len(_HEAD) + _DIGEST + len(_MIDDLE)

_LONGEST_NAME = 180
"""Most characters of a folder's name: file systems take 255 bytes, temporary names add some."""

_RESERVED = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
"""Names that Windows keeps for devices."""

_SEED = re.compile(r"(0|[1-9][0-9]{0,18})\.json", re.ASCII)


class DamagedRowError(InputError):
    """A stored row is truncated or was changed by something else than gripbench."""


def row_path(scenario: str, label: str, seed: int) -> Path:
    """Return where the row of a cell lies below the folder of rows, on any system."""
    return Path(_folder(scenario), _folder(label), f"{seed}.json")


def _folder(name: str) -> str:
    """Return a name as one that every file system takes, another one for every name."""
    text = quote(name, safe="")
    if _RESERVED.fullmatch(text):
        text = f"%{ord(text[0]):02X}{text[1:]}"
    if len(text) > _LONGEST_NAME:
        text = f"{text[:_LONGEST_NAME]}~{digest(name)[:16]}"
    return text


def _earlier(name: str) -> tuple[str, ...]:
    """Return the folders in which earlier versions kept the rows of a scenario or method."""
    return tuple(dict.fromkeys((name, quote(name, safe=":"))))


class Store:
    """Rows below a results folder.

    Parameters
    ----------
    results
        The results folder; it is made when the first row is written.
    """

    def __init__(self, results: Path | str = DEFAULT_RESULTS) -> None:
        self.results = Path(results)
        self.rows = self.results / "rows"
        self._marks: dict[tuple[str, str], Checked] = {}

    def path(self, scenario: str, label: str, seed: int) -> Path:
        """Return the file of a cell."""
        return self.rows / row_path(scenario, label, seed)

    def write(self, row: Row) -> None:
        """Write a row in one atomic step.

        Raises
        ------
        InputError
            If the folder cannot be written: disk full, read-only, not a folder.
        """
        path = self.path(row.scenario, row.label, row.seed)
        write_atomically(path, seal(row))
        for earlier in self._earlier(row.scenario, row.label, row.seed):
            earlier.unlink(missing_ok=True)

    def read(self, scenario: str, label: str, seed: int) -> Row | None:
        """Return the row of a cell, None where there is none.

        Raises
        ------
        DamagedRowError
            If the file is truncated, its content does not fit its checksum, or is no row.
        InputError
            If a newer gripbench wrote it, or it cannot be read.
        """
        path = self.path(scenario, label, seed)
        if not path.exists():
            path = next(iter(self._earlier(scenario, label, seed)), path)
        row = read_row(path)
        if row is not None and (row.scenario, row.label, row.seed) != (scenario, label, seed):
            raise _damaged(path, "of another cell")
        return row

    def marked(self, row: Row) -> Row:
        """Return a row with what is known of its method's checks; see `Row.checked`."""
        if not row.method_digest:
            return row
        what = (row.label, row.method_digest)
        if what not in self._marks:
            self._marks[what] = mark_of(self.results, *what)
        return row.model_copy(update={"checked": self._marks[what]})

    def remove(self, scenario: str, label: str, seed: int) -> None:
        """Remove the row of a cell, where there is one."""
        self.path(scenario, label, seed).unlink(missing_ok=True)
        for path in self._earlier(scenario, label, seed):
            path.unlink(missing_ok=True)

    def _earlier(self, scenario: str, label: str, seed: int) -> list[Path]:
        """Return the files of a cell under the names of earlier versions."""
        if _folder(scenario) == scenario and _folder(label) == quote(label, safe=":"):
            return []
        now = self.path(scenario, label, seed)
        places = (
            self.rows / outer / inner / f"{seed}.json"
            for outer in dict.fromkeys((*_earlier(scenario), _folder(scenario)))
            for inner in (*_earlier(label), _folder(label))
        )
        return [place for place in places if place != now and _plain_file(place)]

    def files(
        self, scenarios: tuple[str, ...] = (), labels: tuple[str, ...] = ()
    ) -> Iterator[Path]:
        """Yield the files of stored rows, by scenario, label and seed; empty: all of them.

        Only plain files with a row's name: a copy, a FIFO or a note of somebody is none.
        """
        outer = {name for given in scenarios for name in (_folder(given), *_earlier(given))}
        inner = {name for given in labels for name in (_folder(given), *_earlier(given))}
        for folder in _folders(self.rows):
            if outer and folder.name not in outer:
                continue
            for place in _folders(folder):
                if inner and place.name not in inner:
                    continue
                found = [path for path in _entries(place) if _SEED.fullmatch(path.name)]
                yield from sorted(filter(_plain_file, found), key=lambda path: int(path.stem))

    def read_all(
        self, scenarios: tuple[str, ...] = (), labels: tuple[str, ...] = ()
    ) -> Iterator[Row]:
        """Yield the stored rows in a fixed order.

        What is damaged, or lies where another cell's row belongs, is left out and named on
        standard error.
        """
        left_out: list[Path] = []
        for path in self.files(scenarios, labels):
            try:
                row = read_row(path)
            except DamagedRowError:
                left_out.append(path)
                continue
            if row is None:
                continue
            if path == self.path(row.scenario, row.label, row.seed):
                yield self.marked(row)
            elif path in self._earlier(row.scenario, row.label, row.seed):
                if not self.path(row.scenario, row.label, row.seed).exists():
                    yield self.marked(row)
            else:
                left_out.append(path)
        if left_out:
            more = f" and {len(left_out) - 1} more" if len(left_out) > 1 else ""
            print(
                f"gripbench: {one_line(str(left_out[0]))}{more}: damaged or no row of its place, "
                "left out; run the same command again, or 'gripbench results prune'",
                file=sys.stderr,
            )


def read_rows(
    results: Path | str = DEFAULT_RESULTS,
    scenarios: tuple[str, ...] = (),
    labels: tuple[str, ...] = (),
) -> pd.DataFrame:
    """Return the stored rows as a frame, one line for each target of each row.

    Parameters
    ----------
    results
        The results folder.
    scenarios, labels
        Only these; empty: all.
    """
    return frame_of(Store(results).read_all(scenarios, labels))


def seal(row: Row) -> str:
    """Return a row as the text of its file: content and checksum."""
    body = row.model_dump_json()
    return f"{_HEAD}{_digest(body)}{_MIDDLE}{body}}}\n"


def read_row(path: Path) -> Row | None:
    """Return the row in a file, None where there is no file; see `Store.read`."""
    try:
        if not _plain_file(path):
            return None
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except UnicodeDecodeError:
        raise _damaged(path, "not text") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    body = text[_START:-2]
    intact = (
        text[: len(_HEAD)] == _HEAD
        and text[len(_HEAD) + _DIGEST : _START] == _MIDDLE
        and text[-2:] == "}\n"
        and text[len(_HEAD) : len(_HEAD) + _DIGEST] == _digest(body)
    )
    if not intact:
        raise _damaged(path, "checksum")
    try:
        content = json.loads(body)
    except (ValueError, RecursionError):
        raise _damaged(path, "not JSON") from None
    if isinstance(content, dict) and is_newer(content):
        return row_from(content, str(path))  # says so
    try:
        return row_from(content, str(path))
    except InputError as error:
        raise _damaged(path, str(error).removeprefix(f"{path}: ")) from None


def leftovers(results: Path | str) -> list[Path]:
    """Return the temporary files that killed runs left behind."""
    found = (Path(results) / "rows").glob("*/*/.*.tmp*")
    return sorted(path for path in found if re.fullmatch(r"\.[^.]+\..*tmp(\.json)?", path.name))


def _damaged(path: Path, why: str) -> DamagedRowError:
    return DamagedRowError(f"{path}: damaged row ({why}); run the same command again")


def _digest(body: str) -> str:
    return hashlib.sha256(body.encode()).hexdigest()


def _plain_file(path: Path) -> bool:
    try:
        return stat.S_ISREG(path.stat().st_mode)
    except FileNotFoundError:
        return False
    except OSError:
        return True  # reading it says why not


def _folders(path: Path) -> list[Path]:
    return sorted(entry for entry in _entries(path) if entry.is_dir())


def _entries(path: Path) -> list[Path]:
    """Return what lies in a folder; nothing where it is none.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        return list(path.iterdir()) if path.is_dir() else []
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
