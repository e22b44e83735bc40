"""Columns and plain values in, a table with its shown texts and best cells out.

A table says what its columns are (title, unit, format, which value is best) and holds plain
values; how they look is the renderer's matter (see `gripbench.bench.publishing.tables`). The best
value of a column, within its group of rows, is marked, and every value that ties with it too: by
default those that read the same as shown, or, where the caller knows more, those that a flag marks
(statistical ties of a ranking).
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from gripbench.errors import InputError, nearest, one_line

if TYPE_CHECKING:
    import pandas as pd

MISSING = "–"
"""What a renderer shows where there is no value; CSV leaves the cell empty."""


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes
    ----------
    key
        Name of the value in each row.
    title
        Heading without unit.
    unit
        Unit, shown in brackets behind the title; empty: none.
    format
        Format specification of numbers as `format()` takes it, such as `.3g`; text is shown as
        it is.
    best
        Which number of the column is the best one; empty: none.
    tied
        Name of a boolean in each row that says whether its value shares the best one's mark;
        empty: those that read the same as the best.
    right
        Whether its texts stand at the right, as numbers do.
    """

    key: str
    title: str
    unit: str = ""
    format: str = ""
    best: Literal["", "lowest", "highest"] = ""
    tied: str = ""
    right: bool = False

    @property
    def heading(self) -> str:
        """Title with unit."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


@dataclass(frozen=True)
class Table:
    """A table: its columns and rows.

    Attributes
    ----------
    columns
        Columns from left to right.
    rows
        One mapping a row with a value for each column's key: number, text, boolean, or None
        where there is none (NaN counts as none).
    caption
        What the table shows, one sentence; empty: none.
    notes
        Remarks below the table.
    group_by
        Key of a column: consecutive rows with the same value form a group; the best is sought
        within each group and a rule divides them. Empty: one group.
    headed
        Whether that value stands above its group on a terminal, instead of in a column.

    Raises
    ------
    InputError
        If a row lacks a value or there are two columns with one key.
    """

    columns: tuple[Column, ...]
    rows: tuple[Mapping[str, Any], ...]
    caption: str = ""
    notes: tuple[str, ...] = ()
    group_by: str = ""
    headed: bool = False
    _groups: tuple[range, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "columns", tuple(self.columns))
        object.__setattr__(self, "rows", tuple(self.rows))
        object.__setattr__(self, "notes", tuple(self.notes))
        keys = [column.key for column in self.columns]
        if len(set(keys)) != len(keys):
            raise InputError(f"table: a column occurs twice among {', '.join(keys)}")
        needed = {*keys, *(column.tied for column in self.columns), self.group_by} - {""}
        for index, row in enumerate(self.rows):
            for key in needed - row.keys():
                raise InputError(f"table: row {index} has no '{key}': {nearest(key, row)}")
        object.__setattr__(self, "_groups", tuple(_groups(self.rows, self.group_by)))

    @classmethod
    def from_frame(
        cls,
        frame: pd.DataFrame,
        columns: Iterable[Column],
        caption: str = "",
        notes: Iterable[str] = (),
        group_by: str = "",
    ) -> Table:
        """Return the rows of a frame as a table; the frame may have more columns."""
        rows = tuple({str(k): v for k, v in row.items()} for row in frame.to_dict("records"))
        return cls(tuple(columns), rows, caption, tuple(notes), group_by)

    @classmethod
    def of_texts(
        cls, headings: Sequence[str], lines: Iterable[Sequence[str]], caption: str = ""
    ) -> Table:
        """Return a table of texts as they are, by its headings and lines."""
        keys = list(map(str, range(len(headings))))
        columns = tuple(Column(key, heading) for key, heading in zip(keys, headings, strict=True))
        return cls(columns, tuple(dict(zip(keys, line, strict=True)) for line in lines), caption)

    @property
    def groups(self) -> tuple[range, ...]:
        """Indices of the rows of each group."""
        return self._groups

    def text(self, row: int, column: Column) -> str:
        """Return a cell as shown, on one line; `MISSING` where there is no value."""
        value = self.rows[row][column.key]
        if is_missing(value):
            return MISSING
        if is_truth(value):
            return "yes" if value else "no"
        if isinstance(value, numbers.Real):
            return _without_exponent(format(value, column.format), float(value))
        return one_line(str(value))

    def best(self) -> frozenset[tuple[int, str]]:
        """Return the cells that are best, as (index of the row, key of the column)."""
        cells: set[tuple[int, str]] = set()
        for column in self.columns:
            if column.best:
                for group in self.groups:
                    cells.update((row, column.key) for row in self._best_rows(column, group))
        return frozenset(cells)

    def _best_rows(self, column: Column, group: range) -> list[int]:
        rows = [row for row in group if is_number(self.rows[row][column.key])]
        if not rows:
            return []
        choose = min if column.best == "lowest" else max
        best = choose(rows, key=lambda row: self.rows[row][column.key])
        if column.tied:
            return [row for row in rows if row == best or bool(self.rows[row][column.tied])]
        shown = self.text(best, column)
        return [row for row in rows if self.text(row, column) == shown]


def _without_exponent(text: str, value: float) -> str:
    """Return a number in full where rounding to a few digits gave it an exponent for nothing."""
    return f"{float(text):.0f}" if "e+" in text and abs(value) < 1e7 else text


def is_missing(value: Any) -> bool:
    """Return whether a cell has no value: None, NaN or pandas' NA."""
    return (
        value is None
        or type(value).__name__ == "NAType"
        or (isinstance(value, float) and math.isnan(value))
    )


def is_truth(value: Any) -> bool:
    """Return whether a cell holds a yes or no, Python's or NumPy's."""
    return isinstance(value, bool) or type(value).__name__ == "bool"


def _groups(rows: Sequence[Mapping[str, Any]], key: str) -> Iterable[range]:
    first = 0
    for index in range(1, len(rows) + 1):
        if index == len(rows) or (key and rows[index][key] != rows[first][key]):
            yield range(first, index)
            first = index


def is_number(value: Any) -> bool:
    """Return whether a cell holds a number, which a boolean is not."""
    number = isinstance(value, numbers.Real) and not is_truth(value)
    return number and not is_missing(value)


def is_numeric(table: Table, column: Column) -> bool:
    """Return whether a column holds numbers only; an empty one counts by its format."""
    values = [row[column.key] for row in table.rows if not is_missing(row[column.key])]
    return all(map(is_number, values)) if values else bool(column.format)


def is_right(table: Table, column: Column) -> bool:
    """Return whether a column stands at the right."""
    return column.right or is_numeric(table, column)
