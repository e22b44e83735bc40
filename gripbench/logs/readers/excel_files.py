"""Read a spreadsheet (.xlsx, .xls, .ods) through calamine; runs in a process of its own."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

from gripbench.errors import InputError
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers.log import Content, optional
from gripbench.logs.readers.text_tables import parse_table

LIBRARIES = ("python_calamine", "pyarrow.csv", "pandas")


def read(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Read the sheets that hold numbers; with several, a column is called `sheet.column`.

    Raises
    ------
    InputError
        If no sheet holds numbers or python-calamine is missing.
    """
    calamine = optional("python_calamine", "a spreadsheet")
    plain = file.model_copy(update={"delimiter": ",", "decimal": "."})
    found: dict[str, Content] = {}
    book = calamine.CalamineWorkbook.from_path(str(path))
    reason = "no sheet holds numbers"
    for sheet in book.sheet_names:
        rows = book.get_sheet_by_name(sheet).to_python(skip_empty_area=False)
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([_cell(v) for v in row] for row in rows)
        try:
            prefix = f"{sheet}."
            names = None if wanted is None else wanted | {n.removeprefix(prefix) for n in wanted}
            found[sheet] = parse_table(path, text.getvalue(), plain, names)
        except InputError as error:
            reason = str(error).removeprefix(f"{path}: ")
    if not found:
        raise InputError(f"{path}: {reason}")
    if len(found) == 1:
        return next(iter(found.values()))
    whole = Content()
    for sheet, part in found.items():
        whole.names += [f"{sheet}.{name}" for name in part.names]
        whole.columns |= {f"{sheet}.{name}": column for name, column in part.columns.items()}
        whole.notes += [f"sheet '{sheet}': {note}" for note in part.notes]
        whole.twins |= {
            f"{sheet}.{name}": tuple(f"{sheet}.{one}" for one in several)
            for name, several in part.twins.items()
        }
    return whole


def _cell(value: Any) -> str:
    if hasattr(value, "isoformat"):
        return str(value.isoformat())
    if hasattr(value, "total_seconds"):
        return repr(value.total_seconds())
    return repr(value) if isinstance(value, float) else str(value)
