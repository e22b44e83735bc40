"""Tell apart what comes as .csv or .txt: a CAN trace as CSV, or a table of text."""

from __future__ import annotations

from pathlib import Path

from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers.log import Content
from gripbench.logs.readers.text_tables import parse_table, text_of


def read(path: Path, file: LogFile, wanted: frozenset[str] | None) -> Content:
    """Read a text of either kind.

    Raises
    ------
    InputError
        If it is neither.
    """
    text = text_of(path)
    from gripbench.logs.readers import can_text

    if can_text.is_table_of_frames(text):
        from gripbench.logs.readers.can_decoding import decode

        return decode(path, can_text.frames_of_table(path, text), file, wanted)
    return parse_table(path, text, file, wanted)
