"""Read a CarMaker result (.erg), whose columns the text file `.erg.info` beside it describes."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from gripbench.errors import InputError
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers.log import Content, LogColumn
from gripbench.logs.readers.text_tables import text_of

_TYPES = {
    "double": "f8", "float": "f4", "longlong": "i8", "ulonglong": "u8", "int": "i4", "uint": "u4",
    "long": "i4", "ulong": "u4", "short": "i2", "ushort": "u2", "char": "i1", "uchar": "u1",
}  # fmt: skip
_HEADER = 16  # bytes before the first record


def read(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Read the quantities of a CarMaker result.

    Raises
    ------
    InputError
        If the description is missing or names an unknown type, or the file ends in a record.
    """
    about = path.with_name(path.name + ".info")
    if not about.is_file():
        raise InputError(f"{path}: {about.name}, which describes its columns, is not beside it")
    text = text_of(about)
    keys = dict(re.findall(r"(?m)^\s*([\w.]+)\s*=\s*(.*?)\s*$", text))
    order = ">" if keys.get("File.ByteOrder", "").lower().startswith("big") else "<"
    fields, units = [], {}
    for index in sorted(int(i) for i in re.findall(r"(?m)^\s*File\.At\.(\d+)\.Name", text)):
        name = keys[f"File.At.{index}.Name"]
        form = keys.get(f"File.At.{index}.Type", "").lower()
        padding = re.fullmatch(r"(\d+) bytes?", form)
        if padding:
            fields.append((f"padding {index}", f"V{padding.group(1)}"))
            continue
        if form not in _TYPES:
            raise InputError(f"{about}: key 'File.At.{index}.Type': unknown type '{form}'")
        fields.append((name, order + _TYPES[form]))
        units[name] = keys.get(f"Quantity.{name}.Unit", "")
    if not units:
        raise InputError(f"{about}: describes no column")
    record = np.dtype(fields)
    data = path.read_bytes()
    if not data.startswith(b"CM-ERG"):
        raise InputError(f"{path}: is not a CarMaker result")
    if (len(data) - _HEADER) % record.itemsize or len(data) <= _HEADER:
        raise InputError(f"{path}: ends within a record: the file is truncated")
    table = np.frombuffer(data, record, offset=_HEADER)
    content = Content(names=list(units))
    for name, unit in units.items():
        if wanted is None or name in wanted:
            content.columns[name] = LogColumn(table[name].astype(np.float64), unit=unit)
    return content
