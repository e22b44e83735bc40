"""Read a table of text, as loggers and tools export it: CSV in all its dialects in, columns out."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
import pyarrow as pa
import pyarrow.csv

from gripbench.errors import InputError
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers.log import Content, LogColumn, as_values, distinct
from gripbench.logs.readers.text_layout import (
    MISSING,
    Layout,
    cells_of,
    find_layout,
    is_comment,
    is_value,
)

COMPRESSED: dict[str, Callable[..., Any]] = {
    ".gz": gzip.open,
    ".bz2": bz2.open,
    ".xz": lzma.open,
}
"""How a compressed text is opened, by the suffix that it adds."""

_HEAD = 400  # lines that tell the layout
_FEW = 0.1  # share of cells that may hold words in a column of numbers
_NULLS = sorted({form for word in MISSING for form in (word, word.upper(), word.title())} | {""})
_ODD = re.compile(r"[\x00-\x08\x0e-\x1a\x1c-\x1f\x7f]")
_LARGEST = 8 << 30


def read(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Read a table of text.

    Raises
    ------
    InputError
        If it is no text, no line of it holds numbers, or a row has too many or too few values.
    """
    return parse_table(path, text_of(path), file, wanted)


def text_of(path: Path) -> str:
    """Return a file's text: UTF-8, UTF-16 with its mark, or else Windows' western European.

    Raises
    ------
    InputError
        If it is no text, or compressed and damaged.
    """
    try:
        opener = COMPRESSED.get(path.suffix.lower())
        if opener is None:
            data = path.read_bytes()
        else:
            with opener(path, "rb") as handle:
                data = handle.read(_LARGEST)
    except (OSError, EOFError, lzma.LZMAError, ValueError) as error:
        raise InputError(f"{path}: cannot be unpacked, it may be cut off ({error})") from None
    except Exception as error:  # zlib.error, which a damaged stream brings
        raise InputError(f"{path}: cannot be unpacked, it is damaged ({error})") from None
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("cp1252", errors="replace")
    if _ODD.search(text[:100_000]) or text[:1000].count("\ufffd") > 20:
        raise InputError(f"{path}: is no text, it may be damaged or of another format")
    text = text.replace("\u2212", "-")  # the typographic minus
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text


_FORTRAN = re.compile(r"(?<=[\d.])[dD](?=[-+]?\d+$)")
"""The letter before the exponent of a double in Fortran."""


def parse_table(path: Path, text: str, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Return the columns of a table of text; `path` is for messages."""
    lines = text[:4_000_000].split("\n", _HEAD)[:_HEAD]
    layout = find_layout(lines, file.delimiter, file.header)
    if layout is None or (file.header and file.header > len(lines)):
        filled = sum(bool(line.strip()) for line in lines)
        what = "the file has a header but no rows" if filled == 1 else "no line holds numbers"
        raise InputError(f"{path}: {what}")
    if layout.misfit:
        raise InputError(
            f"{path}: line {layout.first + 1}: the row has {len(layout.names)} values, the header "
            f"names {layout.misfit}: {_too_many(layout, file)}"
        )
    names, twins, dropped = _names(layout)
    content = Content(names=[n for n in names if n not in dropped], twins=twins)
    if file.decimal == "." and layout.decimal == ",":
        content.suggestions["decimal"] = '","'
    start = sum(len(line) + 1 for line in lines[: layout.first])
    body = _body(text[start:], layout)
    table, odd = _parsed(path, body, names, layout, file)
    _judge_odd_rows(path, text, odd, layout, file, content)
    if table.num_rows == 0:
        raise InputError(f"{path}: the file has a header but no rows")
    for index, name in enumerate(names):
        values = _values(table.column(index), name, file, content)
        if name in dropped:
            if values.dtype == object or np.isfinite(values).any():
                shown = sum(one not in dropped for one in names)
                raise InputError(
                    f"{path}: a row has {len(names)} values, the header names {shown}: "
                    f"{_too_many(layout, file)}"
                )
        elif wanted is None or name in wanted:
            content.columns[name] = LogColumn(values, unit=layout.units[index])
    if text and not text.endswith("\n") and not content.notes:
        content.notes.append("the last line has no line end: the file may be cut off")
    return content


def _names(layout: Layout) -> tuple[list[str], dict[str, tuple[str, ...]], set[str]]:
    """Return distinct names, which of them share one, and which columns must be blank."""
    count = len(layout.names)
    given = list(layout.names)
    for index, name in enumerate(given):
        source = layout.sources[index]
        if name and source and layout.names.count(name) > 1:
            named = f"{name} ({source})"
            pairs = [(n, s) for n, s in zip(layout.names, layout.sources, strict=True)]
            if pairs.count((layout.names[index], source)) == 1:
                given[index] = named
    twins = {
        name: tuple(one for one, plain in zip(given, layout.names, strict=True) if plain == name)
        for name in set(layout.names)
        if name and layout.names.count(name) > 1
    }
    last = max((i for i, name in enumerate(given) if name), default=count - 1)
    numbered = [name or str(index + 1) for index, name in enumerate(given)]
    unique, more = distinct(numbered)
    for name, several in more.items():
        twins[name] = several
    dropped = {unique[index] for index in range(last + 1, count)}
    return unique, twins, dropped


def _body(text: str, layout: Layout) -> str:
    if re.search(r"(?m)^\s*(#|%|//|!)", text):
        text = "\n".join(line for line in text.split("\n") if not is_comment(line))
    if layout.delimiter == " ":
        text = re.sub(r"(?m)^[ \t]+|[ \t]+$", "", text)
        text = re.sub(r"[ \t]+", "\t", text)
    return text


def _parsed(
    path: Path, body: str, names: list[str], layout: Layout, file: LogFile
) -> tuple[pa.Table, list[tuple[int, str]]]:
    odd: list[tuple[int, str]] = []

    def skip(row: Any) -> str:
        odd.append((row.actual_columns, row.text))
        return "skip"

    try:
        table = pa.csv.read_csv(
            io.BytesIO(body.encode()),
            parse_options=pa.csv.ParseOptions(
                delimiter="\t" if layout.delimiter == " " else layout.delimiter,
                invalid_row_handler=skip,
                newlines_in_values=False,
            ),
            read_options=pa.csv.ReadOptions(
                column_names=[str(index) for index in range(len(names))], use_threads=False
            ),
            convert_options=pa.csv.ConvertOptions(
                decimal_point=file.decimal,
                null_values=_NULLS,
                timestamp_parsers=["gripbench reads times itself"],
            ),
        )
    except (pa.ArrowInvalid, ValueError) as error:
        if "Empty CSV file" in str(error):
            raise InputError(f"{path}: the file has a header but no rows") from None
        lines = str(error).splitlines() or [""]
        raise InputError(f"{path}: not valid CSV: {lines[0][:200]}") from None
    return table, odd


def _judge_odd_rows(
    path: Path,
    text: str,
    odd: list[tuple[int, str]],
    layout: Layout,
    file: LogFile,
    content: Content,
) -> None:
    """Leave out lines without values and a last line that is cut off; refuse others."""
    last = text.rstrip("\n").rpartition("\n")[2]
    words = []
    for count, row in odd:
        cells = [cell for cell in cells_of(row, layout.delimiter) if cell]
        if not any(map(is_value, cells)):
            words.append(row)
        elif row.strip() == last.strip() and count < len(layout.names):
            content.notes.append("the last line is cut off and was left out")
        else:
            at = text.find(row)
            where = f"line {text.count(chr(10), 0, at) + 1}: " if at >= 0 else ""
            hint = "the file may be cut off"
            if count > len(layout.names):
                hint = _too_many(layout, file)
            raise InputError(
                f"{path}: {where}the row has {count} values, the header names "
                f"{len(layout.names)}: {hint}"
            )
    if words:
        content.notes.append(
            f"{len(words)} lines among the rows hold no values and were left out, "
            f"such as {words[0].strip()[:40]!r}"
        )


def _too_many(layout: Layout, file: LogFile) -> str:
    if layout.delimiter == "," and file.decimal == ".":
        return "decimal commas between commas cannot be told apart: write points or semicolons"
    return "the file may be damaged"


def _values(
    column: pa.ChunkedArray, name: str, file: LogFile, content: Content
) -> npt.NDArray[Any]:
    if not (pa.types.is_string(column.type) or pa.types.is_large_string(column.type)):
        return as_values(column.to_pandas())
    cells = pd.Series(column.to_pylist(), dtype=object).str.strip()
    cells = cells.where(~cells.str.lower().isin(MISSING | {""}), None)
    plain = cells.str.replace(",", ".", regex=False) if file.decimal == "," else cells
    plain = plain.str.replace(_FORTRAN, "e", regex=True)
    numbers = pd.to_numeric(plain, errors="coerce").to_numpy(dtype=np.float64)
    filled = cells.notna().to_numpy()
    words = filled & np.isnan(numbers)
    if not words.any():
        return numbers
    texts = [str(text) for text in cells[words].unique()[:20]]
    # Words among numbers are blanks; numbers in another notation are not.
    if words.sum() <= _FEW * filled.sum() and not any(re.match(r"[-+]?[\d.,]", t) for t in texts):
        content.notes.append(
            f"column '{name}': {int(words.sum())} cells hold words ({texts[0][:20]!r}) and "
            "count as blank"
        )
        return numbers
    return np.array([None if pd.isna(cell) else cell for cell in cells], dtype=object)
