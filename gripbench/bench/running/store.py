"""The store of rows: one JSON file a row, written whole or not at all.

`<results>/rows/<scenario>/<label>/<seed>.json`. Every file carries a checksum of its content, so
a truncated or damaged one is known as such, and that cell alone runs again.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from gripbench.bench.running.rows import Row, frame_of, row_from
from gripbench.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

DEFAULT_RESULTS = Path("results")
"""Where commands keep results unless told otherwise, under the working directory."""

_HEAD = '{"checksum": "'
_MIDDLE = '", "row": '
_DIGEST = 64
_START = len(_HEAD) + _DIGEST + len(_MIDDLE)


class DamagedRowError(InputError):
    """A stored row is truncated or was changed by something else than gripbench."""


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

    def path(self, scenario: str, label: str, seed: int) -> Path:
        """Return the file of a cell."""
        return self.rows / scenario / quote(label, safe=":") / f"{seed}.json"

    def write(self, row: Row) -> None:
        """Write a row in one atomic step.

        Raises
        ------
        InputError
            If the folder cannot be written: disk full, read-only, not a folder.
        """
        path = self.path(row.scenario, row.label, row.seed)
        write_atomically(path, seal(row))

    def read(self, scenario: str, label: str, seed: int) -> Row | None:
        """Return the row of a cell, None where there is none.

        Raises
        ------
        DamagedRowError
            If the file is truncated or its content does not fit its checksum.
        InputError
            If a newer gripbench wrote it, or it cannot be read.
        """
        return read_row(self.path(scenario, label, seed))

    def files(
        self, scenarios: tuple[str, ...] = (), labels: tuple[str, ...] = ()
    ) -> Iterator[Path]:
        """Yield the files of stored rows, by scenario, label and seed; empty: all of them."""
        for folder in _folders(self.rows):
            if scenarios and folder.name not in scenarios:
                continue
            for inner in _folders(folder):
                if labels and inner.name not in {quote(label, safe=":") for label in labels}:
                    continue
                yield from sorted(inner.glob("[0-9]*.json"), key=lambda path: int(path.stem))

    def read_all(
        self, scenarios: tuple[str, ...] = (), labels: tuple[str, ...] = ()
    ) -> Iterator[Row]:
        """Yield the stored rows in a fixed order; damaged ones are left out."""
        for path in self.files(scenarios, labels):
            try:
                row = read_row(path)
            except DamagedRowError:
                continue
            if row is not None:
                yield row


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
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except UnicodeDecodeError:
        raise DamagedRowError(
            f"{path}: damaged row (not text); run the same command again"
        ) from None
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
        raise DamagedRowError(f"{path}: damaged row (checksum); run the same command again")
    return row_from(json.loads(body), str(path))


def write_atomically(path: Path, text: str) -> None:
    """Write a text file so that a reader sees the old content or the new one, never a part.

    Raises
    ------
    InputError
        If it cannot be written; what was there before is left as it was.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        try:
            _write(temporary, text)
        except FileNotFoundError:  # the folder, on its first row
            path.parent.mkdir(parents=True, exist_ok=True)
            _write(temporary, text)
        temporary.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise InputError(f"{path}: cannot be written: {_remedy(error)}") from None


def leftovers(results: Path | str) -> list[Path]:
    """Return the temporary files that killed runs left behind."""
    return sorted((Path(results) / "rows").glob("*/*/.*.tmp"))


def _write(path: Path, text: str) -> None:
    with path.open("w", encoding="utf-8") as file:
        file.write(text)


def _remedy(error: OSError) -> str:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return (
            "the disk is full; make room and run the same command again, what is finished is kept"
        )
    if error.errno in (errno.EROFS, errno.EACCES, errno.EPERM):
        return "the results folder is read-only; choose another with --results"
    return str(error.strerror or error).lower()


def _digest(body: str) -> str:
    return hashlib.sha256(body.encode()).hexdigest()


def _folders(path: Path) -> list[Path]:
    return sorted(entry for entry in path.iterdir() if entry.is_dir()) if path.is_dir() else []
