"""Text from outside stays its letters on a terminal: no markup, no control characters, one line."""

import pytest
from rich.table import Table

from gripbench.bench.publishing import tables
from gripbench.bench.publishing.terminal import console

WORDS = [
    "[rad]",
    "[/a/b]",
    "[@PARAMETER=NUMBER,...]",
    "a[bold]b",
    ":smile:",
    "two\nlines",
    "\x1b[2J",
]


@pytest.mark.parametrize("words", WORDS)
def test_a_word_is_printed_as_it_is(words, capsys):
    out = console()
    table = Table("name", title=words, caption=words)
    table.add_column(words)
    table.add_row("x", words)
    out.print(table)
    out.print(words)
    shown = capsys.readouterr().out
    escaped = words.replace("\n", "\\n").replace("\x1b", "\\x1b")
    assert shown.count(escaped) == 5
    assert "\x1b" not in shown


@pytest.mark.parametrize("words", WORDS)
def test_a_published_table_prints_as_it_is(words, capsys):
    table = tables.Table(
        (tables.Column("a", words),), ({"a": words},), caption=words, notes=(words,)
    )
    escaped = words.replace("\n", "\\n").replace("\x1b", "\\x1b")
    tables.show(table)
    assert capsys.readouterr().out.count(escaped) == 4
    console().print(tables.terminal(table))
    assert capsys.readouterr().out.count(escaped) == 2
