"""A table in, its text for the terminal, Markdown, CSV, LaTeX and HTML out.

What a table is stands in `gripbench.bench.publishing.columns`. CSV keeps full precision, all
others show the column's format; the best values are bold.
"""

from __future__ import annotations

import csv as csv_format
import html as html_format
import io
import numbers
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rich.box
import rich.table
import rich.text
from rich.console import Console

from gripbench.bench.publishing.columns import (
    Column,
    Table,
    is_missing,
    is_number,
    is_right,
)
from gripbench.bench.publishing.latex import latex_line, latex_number, latex_text
from gripbench.bench.publishing.terminal import console, has_width
from gripbench.errors import one_line, unknown


def terminal(table: Table) -> rich.table.Table:
    """Return the columns and rows of a table as rich prints them."""
    shown = rich.table.Table(
        box=rich.box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False
    )
    columns = _on_terminal(table)
    for column in columns:
        right = is_right(table, column)
        shown.add_column(
            rich.text.Text(one_line(column.heading)),
            justify="right" if right else "left",
            no_wrap=right or column is columns[0],  # a name is whole, whatever the width
            overflow="fold",
        )
    best = table.best()
    for group in table.groups:
        if table.headed:
            shown.add_row(rich.text.Text(_heading(table, group), "bold"))
        for row in group:
            cells = [
                rich.text.Text(text, "bold" if (row, column.key) in best else "")
                for text, column in zip(_cells(table, row, columns), columns, strict=True)
            ]
            shown.add_row(*cells, end_section=row == group[-1])
    return shown


def plain(table: Table) -> str:
    """Return what the terminal shows as plain text at its natural width, `*` behind the best."""
    best = table.best()
    columns = _on_terminal(table)
    lines = [[one_line(column.heading) for column in columns]]
    for group in table.groups:
        if table.headed:
            lines.append([_heading(table, group)])
        for row in group:
            texts = zip(_cells(table, row, columns), columns, strict=True)
            lines.append([text + ("*" if (row, c.key) in best else "") for text, c in texts])
    whole = [line for line in lines if len(line) == len(columns)]
    widths = [max(len(line[j]) for line in whole) for j in range(len(columns))]
    right = [is_right(table, column) for column in columns]
    shown = [
        "  ".join(
            text.rjust(width) if stands else text.ljust(width)
            for text, width, stands in zip(line, widths, right, strict=False)
        ).rstrip()
        for line in lines
    ]
    shown.insert(1, "  ".join("-" * width for width in widths))
    head = [one_line(table.caption), ""] if table.caption else []
    within = "group" if len(table.groups) > 1 else "column"
    notes = [*([f"* best of its {within}"] if best else []), *map(one_line, table.notes)]
    tail = ["", *notes] if notes else []
    return "\n".join([*head, *shown, *tail]) + "\n"


def width_of(table: Table) -> int:
    """Return the number of columns of a terminal that a table takes."""
    return Console(width=10_000).measure(terminal(table)).maximum


def _on_terminal(table: Table) -> tuple[Column, ...]:
    return tuple(c for c in table.columns if not (table.headed and c.key == table.group_by))


def _heading(table: Table, group: range) -> str:
    return one_line(str(table.rows[group[0]][table.group_by]))


def _cells(table: Table, row: int, columns: tuple[Column, ...]) -> list[str]:
    texts = [table.text(row, column) for column in columns]
    return [f"  {texts[0]}", *texts[1:]] if table.headed else texts


def markdown(table: Table) -> str:
    """Return the table as a Markdown pipe table, best in bold."""
    best = table.best()
    lines = [
        "| " + " | ".join(_markdown(column.heading) for column in table.columns) + " |",
        "|"
        + "|".join("---:" if is_right(table, column) else "---" for column in table.columns)
        + "|",
    ]
    for row in range(len(table.rows)):
        cells = []
        for column in table.columns:
            text = _markdown(table.text(row, column))
            cells.append(f"**{text}**" if (row, column.key) in best else text)
        lines.append("| " + " | ".join(cells) + " |")
    head = [table.caption, ""] if table.caption else []
    tail = [line for note in table.notes for line in ("", note)]
    return "\n".join([*head, *lines, *tail]) + "\n"


def csv(table: Table) -> str:
    """Return the table as CSV at full precision: headings, then a line a row."""
    file = io.StringIO()
    writer = csv_format.writer(file, lineterminator="\n")
    writer.writerow([column.heading for column in table.columns])
    for row in table.rows:
        writer.writerow([_csv(row[column.key]) for column in table.columns])
    return file.getvalue()


def latex(table: Table, standalone: bool = False) -> str:
    r"""Return the table as LaTeX with booktabs, best in bold.

    Parameters
    ----------
    table
        The table.
    standalone
        A whole document of class article; otherwise a `table` environment that needs
        `\usepackage{booktabs}` where it is included.
    """
    best = table.best()
    alignment = "".join("r" if is_right(table, column) else "l" for column in table.columns)
    lines = [r"\begin{table}[htbp]", r"\centering"]
    if table.caption:
        lines.append(rf"\caption{{{latex_text(table.caption)}}}")
    lines += [rf"\begin{{tabular}}{{@{{}}{alignment}@{{}}}}", r"\toprule"]
    lines.append(latex_line([latex_text(column.heading) for column in table.columns]))
    lines.append(r"\midrule")
    for number, group in enumerate(table.groups):
        if number:
            lines.append(r"\midrule")
        for row in group:
            cells = []
            for column in table.columns:
                text = table.text(row, column)
                number_shown = is_number(table.rows[row][column.key])
                text = latex_number(text) if number_shown else latex_text(text)
                if (row, column.key) in best:
                    text = rf"\textbf{{\boldmath {text}}}"
                cells.append(text)
            lines.append(latex_line(cells))
    lines += [r"\bottomrule", r"\end{tabular}"]
    if table.notes:
        lines.append(r"\par\smallskip\footnotesize " + " ".join(map(latex_text, table.notes)))
    lines.append(r"\end{table}")
    body = "\n".join(lines) + "\n"
    if not standalone:
        return body
    return (
        "\\documentclass{article}\n\\usepackage{booktabs}\n"
        f"\\begin{{document}}\n{body}\\end{{document}}\n"
    )


def html(table: Table) -> str:
    """Return the table as an HTML `table` element.

    Numbers carry their full value in `data-value`, so that a page can sort them; the best cells
    have the class `best`; groups are `tbody` elements.
    """
    best = table.best()
    lines = ['<table class="gripbench">']
    if table.caption:
        lines.append(f"<caption>{html_format.escape(table.caption)}</caption>")
    lines.append("<thead><tr>")
    for column in table.columns:
        name = "number" if is_right(table, column) else "text"
        heading = html_format.escape(column.heading)
        lines.append(f'<th scope="col" class="{name}" data-key="{column.key}">{heading}</th>')
    lines.append("</tr></thead>")
    for group in table.groups or (range(0),):
        lines.append("<tbody>")
        for row in group:
            cells = "".join(
                _html_cell(table, row, column, (row, column.key) in best)
                for column in table.columns
            )
            lines.append(f"<tr>{cells}</tr>")
        lines.append("</tbody>")
    if table.notes:
        notes = "<br/>".join(html_format.escape(note) for note in table.notes)
        span = len(table.columns)
        lines.append(f'<tfoot><tr><td colspan="{span}">{notes}</td></tr></tfoot>')
    lines.append("</table>")
    return "\n".join(lines) + "\n"


FORMATS: dict[str, Callable[[Table], str]] = {
    "text": plain,
    "markdown": markdown,
    "csv": csv,
    "latex": latex,
    "html": html,
}
"""Renderer by the name of the format."""

_SUFFIXES = {".txt": "text", ".md": "markdown", ".csv": "csv", ".tex": "latex", ".html": "html"}


def render(table: Table, format_name: str) -> str:
    """Return a table in one of `FORMATS`.

    Raises
    ------
    InputError
        If there is no such format.
    """
    if format_name not in FORMATS:
        raise unknown("table format", format_name, FORMATS)
    return FORMATS[format_name](table)


def show(table: Table, format_name: str = "terminal", stderr: bool = False) -> None:
    """Print a table: as a grid that fits a terminal, or in one of `FORMATS`; plainly into a pipe.

    Raises
    ------
    InputError
        If there is no such format.
    """
    if format_name not in ("terminal", *FORMATS):
        raise unknown("table format", format_name, ("terminal", *FORMATS))
    if format_name != "terminal":
        print(render(table, format_name), end="")
        return
    out = console(stderr)
    if not out.is_terminal and not has_width():
        print(plain(table), end="", file=sys.stderr if stderr else sys.stdout)
        return
    if table.caption:
        out.print(table.caption, soft_wrap=True)
    out.print(terminal(table))
    for note in table.notes:
        out.print(note)


def format_of(path: Path) -> str:
    """Return the format that a file's suffix stands for.

    Raises
    ------
    InputError
        If none does.
    """
    if path.suffix not in _SUFFIXES:
        raise unknown(f"table format of {path}", path.suffix, _SUFFIXES)
    return _SUFFIXES[path.suffix]


def _csv(value: Any) -> str:
    if is_missing(value):
        return ""
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, numbers.Integral):
        return str(int(value))
    return repr(float(value)) if isinstance(value, numbers.Real) else str(value)


def _markdown(text: str) -> str:
    text = re.sub(r"([\\`*|<]|(?<!\w)_|_(?!\w))", r"\\\1", text)  # mu_front reads as it is
    return text.replace("\n", " ")


def _html_cell(table: Table, row: int, column: Column, best: bool) -> str:
    value = table.rows[row][column.key]
    text = html_format.escape(table.text(row, column))
    attributes = f' data-key="{html_format.escape(column.key)}"'
    if is_right(table, column):
        names = "number best" if best else "number"
        attributes += f' class="{names}"'
    if is_number(value):
        attributes += f' data-value="{float(value)!r}"'
    return f"<td{attributes}>{f'<strong>{text}</strong>' if best else text}</td>"
