"""Find how a text table is laid out: its first lines in; separator, header, units, first row out.

Loggers put titles above the header, a row of units or sources below it, a comment sign before it,
or no header at all. What tells them apart is that the rows of the body hold numbers.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from dataclasses import dataclass

from gripbench.logs.mapping.units import proposed_unit

DELIMITERS = (",", ";", "\t", "|", " ")
"""Separators that are looked for; a blank stands for any run of white space."""

MISSING = frozenset(
    (
        "-", "--", "---", "na", "n/a", "#n/a", "n.a.", "nan", "-nan", "null", "none", "nil", "?",
        "err", "error", "invalid", "inv", "overflow", "ovf", "missing", "sna", "nv", "void", "*",
        "nodata", "***", "#value!", "#div/0!", "#num!", "#ref!", "#name?", "1.#qnan", "-1.#ind",
        "1.#ind", "undef", "undefined", "unavailable",
    )
)  # fmt: skip
"""Cells, in lower case, that say that there is no value."""

_NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)([eE][-+]?\d+)?$")
_INFINITE = re.compile(r"[-+]?inf(inity)?$", re.I)
_MOMENT = re.compile(
    r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}([ T]+\d{1,2}:.*)?$|"
    r"\d{1,2}:\d{2}(:\d{2}([.,:]\d+)?)?( ?[AaPp]\.?[Mm]\.?)?$"
)
_COMMENT = re.compile(r"\s*(#+|%+|//+|!)\s?")
_BODY_ROWS = 3


@dataclass(frozen=True)
class Layout:
    """How a text table is laid out.

    Attributes
    ----------
    delimiter
        Separator of its columns; a blank stands for any white space.
    names
        Name of each column, empty where it has none; all empty without a header.
    units
        Unit of each column as a row of units or its name says; empty where neither does.
    sources
        What a further row below the header says of each column, such as its device.
    first
        Index of the first line of the body.
    header
        Index of the line with the names; -1 without one.
    decimal
        `,` where the body writes decimal commas, else `.`.
    misfit
        Names in a line right above the body that has another number of cells; 0: there is none.
    """

    delimiter: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    sources: tuple[str, ...]
    first: int
    header: int
    decimal: str
    misfit: int = 0


def cells_of(line: str, delimiter: str) -> list[str]:
    """Return the cells of one line, without surrounding blanks."""
    if delimiter == " ":
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]


def is_comment(line: str) -> bool:
    """Whether a line starts with a comment sign."""
    return _COMMENT.match(line) is not None


def is_number(cell: str) -> bool:
    """Whether a cell holds a number, with a decimal point or comma."""
    return _NUMBER.match(cell) is not None or _INFINITE.match(cell) is not None


def is_value(cell: str) -> bool:
    """Whether a cell holds a number, a date, a time, or says that it has no value."""
    return is_number(cell) or _MOMENT.match(cell) is not None or cell.lower() in MISSING


def find_layout(lines: list[str], delimiter: str = "", header: int = 0) -> Layout | None:
    """Return how a table is laid out, or None where no line holds numbers.

    Parameters
    ----------
    lines
        Its first lines, without line ends.
    delimiter
        The separator, where it is known.
    header
        Number of the line with the names, counted from 1; 0: it is looked for.
    """
    chosen = delimiter or _delimiter(lines)
    split = [cells_of(line, chosen) for line in lines]
    count = _usual_count(lines, split)
    first = _first_row(lines, split, count, header)
    if first is None:
        return None
    names_at, unit_row, source_row = _header_rows(lines, split, first, count, chosen, header)
    names = _padded(_bare(lines, names_at, chosen), count) if names_at >= 0 else ("",) * count
    units = tuple(
        written or unit_in_name(name)
        for written, name in zip(_padded(unit_row, count), names, strict=True)
    )
    body = [cell for row in split[first:] if len(row) == count for cell in row if is_number(cell)]
    commas = any("," in cell for cell in body) and not any("." in cell for cell in body)
    return Layout(
        delimiter=chosen,
        names=names,
        units=units,
        sources=_padded(source_row, count),
        first=first,
        header=names_at,
        decimal="," if commas and chosen != "," else ".",
        misfit=_misfit(lines, first, chosen) if names_at < 0 else 0,
    )


def unit_in_name(name: str) -> str:
    """Return the unit that a column's name ends in, in brackets; empty without one."""
    found = re.search(r"[\[(]([^\[\]()]*)[\])]\s*$", name)
    if found and proposed_unit(found.group(1)) not in (None, "-"):
        return found.group(1).strip()
    return ""


def _delimiter(lines: list[str]) -> str:
    filled = [line for line in lines if line.strip() and not is_comment(line)]
    sample = filled[len(filled) // 2 :][:100] or filled
    best, chosen = 0.0, ","
    for delimiter in DELIMITERS:
        rows = [cells_of(line, delimiter) for line in sample]
        counts = Counter(len(row) for row in rows)
        if not counts:
            continue
        count, agreeing = max(counts.items(), key=lambda item: (item[1], item[0]))
        cells = [cell for row in rows if len(row) == count for cell in row if cell]
        share = sum(map(is_value, cells)) / len(cells) if cells else 0.0
        score = share * agreeing / len(rows) * (1.0 if count > 1 else 0.5)
        if score > best:
            best, chosen = score, delimiter
    return chosen


def _usual_count(lines: list[str], split: list[list[str]]) -> int:
    counts = Counter(
        len(row)
        for line, row in zip(lines, split, strict=True)
        if line.strip() and not is_comment(line) and _is_body(row)
    )
    return max(counts.items(), key=lambda item: (item[1], item[0]))[0] if counts else 0


def _is_body(row: list[str]) -> bool:
    filled = [cell for cell in row if cell]
    values = sum(map(is_value, filled))
    numbers = any(is_number(cell) or _MOMENT.match(cell) for cell in filled)
    return numbers and 2 * values >= len(filled)


def _first_row(lines: list[str], split: list[list[str]], count: int, header: int) -> int | None:
    rows = [
        index
        for index, line in enumerate(lines)
        if line.strip() and not is_comment(line) and index >= header
    ]
    for order, index in enumerate(rows):
        following = rows[order : order + _BODY_ROWS]
        if all(len(split[i]) == count and _is_body(split[i]) for i in following[:1]) and all(
            _is_body(split[i]) or i == rows[-1] for i in following
        ):
            return index
    return None


def _header_rows(
    lines: list[str], split: list[list[str]], first: int, count: int, delimiter: str, header: int
) -> tuple[int, list[str], list[str]]:
    """Return the line of the names (-1: none), and the cells of the units' and sources' rows."""
    if header:
        names_at = header - 1
        block = [i for i in range(names_at + 1, first) if lines[i].strip()]
    else:
        block = _block_above(lines, first, count, delimiter)
        if not block:
            return -1, [], []
        names_at = max(
            block, key=lambda i: (_name_likeness(_bare(lines, i, delimiter), lines[i]), -i)
        )
        block = [i for i in block if i > names_at]
    units: list[str] = []
    sources: list[str] = []
    for index in block:
        row = _bare(lines, index, delimiter)
        if not units and _is_unit_row(row):
            units = [cell.strip("[]()") for cell in row]
        elif not sources:
            sources = row
    return names_at, units, sources


def _block_above(lines: list[str], first: int, count: int, delimiter: str) -> list[int]:
    """Return the lines of text right above the body that have its number of cells."""
    index = first - 1
    while index >= 0 and not lines[index].strip():
        index -= 1
    block = []
    while index >= 0 and lines[index].strip():
        row = _bare(lines, index, delimiter)
        while len(row) > count and not row[-1]:
            row = row[:-1]
        # A row may end in a separator that its header lacks, and the other way round.
        if len(row) not in (count, count - 1) or not any(row):
            break
        if len(row) == count - 1 and not _ends_blank(lines, first, count, delimiter):
            break
        if all(is_number(cell) for cell in row if cell):
            break
        block.append(index)
        index -= 1
    return block


def _misfit(lines: list[str], first: int, delimiter: str) -> int:
    """Return how many names a line right above a body without header has."""
    if first == 0 or not lines[first - 1].strip() or is_comment(lines[first - 1]):
        return 0
    row = cells_of(lines[first - 1], delimiter)
    return len(row) if len(row) > 1 and not any(map(is_value, row)) and all(row) else 0


def _ends_blank(lines: list[str], first: int, count: int, delimiter: str) -> bool:
    rows = (cells_of(line, delimiter) for line in lines[first:] if line.strip())
    return all(not row[count - 1] for row in rows if len(row) == count)


def _name_likeness(row: list[str], line: str) -> float:
    filled = [cell for cell in row if cell]
    units = sum(_is_unit(cell) for cell in filled)
    values = sum(is_value(cell) for cell in filled)
    likeness = (
        len(filled) / len(row)
        + len(set(filled)) / len(row)
        - 2.0 * units / len(filled)
        - 2.0 * values / len(filled)
    )
    return likeness - (0.5 if is_comment(line) else 0.0)


def _is_unit(cell: str) -> bool:
    bare = cell.strip("[]() ")
    known = proposed_unit(bare) if bare else None
    # A lone letter such as `t`, `h`, `m` or `T` may be a name as well.
    return known is not None and (len(bare) > 1 or cell != bare or bare in "s°g%")


def _is_unit_row(row: list[str]) -> bool:
    filled = [cell for cell in row if cell]
    known = sum(_is_unit(cell) or proposed_unit(cell) is not None for cell in filled)
    bracketed = all(cell[0] in "[(" and cell[-1] in "])" for cell in filled)
    return bool(filled) and (2 * known >= len(filled) or bracketed)


def _bare(lines: list[str], index: int, delimiter: str) -> list[str]:
    """Return a line's cells without a comment sign before them."""
    return cells_of(_COMMENT.sub("", lines[index], count=1), delimiter)


def _padded(row: list[str], count: int) -> tuple[str, ...]:
    return tuple((row + [""] * count)[:count])
