"""Read Parquet and Feather through pyarrow; runs in a process of its own."""

from __future__ import annotations

from pathlib import Path

import pyarrow.feather
import pyarrow.parquet

from gripbench.errors import InputError
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers.log import Content, LogColumn, as_values, distinct

LIBRARIES = ("pandas", "pyarrow.parquet", "pyarrow.feather")


def read(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Read the columns of a table.

    Raises
    ------
    InputError
        If it has no rows.
    """
    if path.suffix.lower() == ".feather":
        table = pyarrow.feather.read_table(path, memory_map=False)
    else:
        with pyarrow.parquet.ParquetFile(path) as source:
            given = list(source.schema_arrow.names)
            columns = None
            if wanted is not None and len(set(given)) == len(given):
                columns = [name for name in given if name in wanted]
            content = _content(source.read(columns=columns), wanted)
            content.names, content.twins = distinct(given)
            if source.metadata.num_rows == 0:
                raise InputError(f"{path}: the file has no rows")
            return content
    if table.num_rows == 0:
        raise InputError(f"{path}: the file has no rows")
    return _content(table, wanted)


def _content(table: pyarrow.Table, wanted: frozenset[str] | None) -> Content:
    table.validate(full=True)
    names, twins = distinct(table.column_names)
    content = Content(names=names, twins=twins)
    for index, name in enumerate(names):
        if wanted is None or name in wanted:
            content.columns[name] = LogColumn(as_values(table.column(index).to_pandas()))
    return content
