import csv
import io
import math
import shutil
import subprocess
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from gripbench.bench.papers.comparison import portable
from gripbench.bench.publishing import latex, tables
from gripbench.bench.publishing.columns import MISSING, Column, Table
from gripbench.errors import InputError

COLUMNS = (
    Column("scenario", "Scenario"),
    Column("method", "Method"),
    Column("rms", "RMS of \\force", "m/s^2", ".3g", best="lowest"),
    Column("share", "Share", "%", ".1f", best="highest"),
    Column("count", "Runs", format="d"),
)


def row(scenario, method, rms, share, count=3, **more):
    return dict(scenario=scenario, method=method, rms=rms, share=share, count=count, **more)


@pytest.fixture
def table():
    return Table(
        COLUMNS,
        (
            row("a_b & c", "one|two", 1.2341, 50.0),
            row("a_b & c", "<b>x</b>", 1.2344, None),
            row("a_b & c", "[three]", math.nan, 49.0),
            row("μ ± 1", "four", 1.2e-7, -3.25),
            row("μ ± 1", 'five "q" ~^{}$#%\\', 2e9, 0.0),
        ),
        caption="Scores of 100 % & more_",
        notes=("First note.", "Second note: a < b."),
        group_by="scenario",
    )


def test_best_is_sought_within_groups_and_shared_by_values_that_read_the_same(table):
    assert table.groups == (range(0, 3), range(3, 5))
    assert table.best() == {(0, "rms"), (1, "rms"), (3, "rms"), (0, "share"), (4, "share")}


def test_flagged_ties_share_the_mark_and_only_they():
    column = Column("rms", "RMS", format=".1f", best="lowest", tied="tied")
    rows = [{"rms": 1.01, "tied": False}, {"rms": 1.02, "tied": False}, {"rms": 9.0, "tied": True}]
    assert Table((column,), rows).best() == {(0, "rms"), (2, "rms")}


def test_column_without_a_number_has_no_best():
    column = Column("rms", "RMS", best="lowest")
    assert Table((column,), ({"rms": None}, {"rms": math.nan})).best() == frozenset()
    assert Table((column,), ()).best() == frozenset()


def test_missing_key_and_repeated_column_are_errors():
    with pytest.raises(InputError, match="row 0 has no 'rms': did you mean 'rmss'"):
        Table((Column("rms", "RMS"),), ({"rmss": 1.0},))
    with pytest.raises(InputError, match="a column occurs twice"):
        Table((Column("a", "A"), Column("a", "B")), ())


def test_csv_keeps_full_precision(table):
    lines = list(csv.reader(io.StringIO(tables.csv(table))))
    assert lines[0] == ["Scenario", "Method", "RMS of \\force [m/s^2]", "Share [%]", "Runs"]
    for line, source in zip(lines[1:], table.rows, strict=True):
        assert line[:2] == [source["scenario"], source["method"]]
        for text, value in zip(line[2:], [source["rms"], source["share"], source["count"]]):  # noqa: B905
            assert (text == "") if tables.is_missing(value) else (float(text) == value)


def test_markdown_reads_back(table):
    lines = [line for line in tables.markdown(table).splitlines() if line.startswith("|")]
    cells = [
        [cell.strip() for cell in line.replace(r"\|", "\0").strip("|").split("|")] for line in lines
    ]
    assert {len(line) for line in cells} == {5}
    assert cells[1] == ["---", "---", "---:", "---:", "---:"]
    plain = [
        [cell.strip("*").replace("\0", "|").replace("\\", "") for cell in line]
        for line in cells[2:]
    ]
    assert plain[0] == ["a_b & c", "one|two", "1.23", "50.0", "3"]
    assert plain[1][2:4] == ["1.23", MISSING]
    bold = {(i, j) for i, line in enumerate(cells[2:]) for j, c in enumerate(line) if "**" in c}
    assert bold == {(0, 2), (1, 2), (3, 2), (0, 3), (4, 3)}


def test_html_reads_back_with_values_to_sort_by(table):
    page = ElementTree.fromstring(tables.html(table))
    assert page.find("caption").text == table.caption
    assert ["".join(th.itertext()) for th in page.iter("th")] == [c.heading for c in COLUMNS]
    assert len(list(page.iter("tbody"))) == 2
    rows = [list(tr) for body in page.iter("tbody") for tr in body.iter("tr")]
    for index, (cells, source) in enumerate(zip(rows, table.rows, strict=True)):
        assert ["".join(c.itertext()) for c in cells] == [table.text(index, c) for c in COLUMNS]
        value = cells[2].get("data-value")
        assert (value is None) if math.isnan(source["rms"]) else (float(value) == source["rms"])
        assert ("best" in cells[2].get("class").split()) == ((index, "rms") in table.best())


def test_plain_text_is_aligned_and_marks_the_best(table):
    lines = tables.plain(table).splitlines()
    assert lines[0] == table.caption
    assert lines[-3] == "* best of its group"
    assert lines[-1] == "Second note: a < b."
    assert lines[4].split()[-3:] == ["1.23*", "50.0*", "3"]
    right_edges = {line.index(text) + len(text) for line, text in zip(
        lines[4:7], ["1.23*", "1.23*", "–"], strict=True)}  # fmt: skip
    assert len(right_edges) == 1


def test_rich_takes_text_literally(table, capsys, monkeypatch):
    from rich.console import Console

    console = Console(width=200, file=io.StringIO())
    console.print(tables.terminal(table))
    assert "[three]" in console.file.getvalue()
    tables.show(table)
    assert "[three]" in capsys.readouterr().out


def test_latex_of_numbers_and_special_letters(table):
    text = tables.latex(table)
    assert r"\begin{tabular}{@{}llrrr@{}}" in text
    assert (
        r"a\_b \& c & one$|$two & \textbf{\boldmath 1.23} & \textbf{\boldmath 50.0} & 3 \\" in text
    )
    assert r"\textbf{\boldmath $1.2\times10^{-7}$} & $-3.2$" in text
    assert r"[m/s$^{2}$]" in text
    assert text.count(r"\midrule") == 2


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no LaTeX engine (pdflatex) installed")
def test_latex_compiles_with_plain_article_class(table, tmp_path):
    letters = "".join(latex._LETTERS) + "†é10 m/s^2 a^-3"
    brackets = Table((Column("a", "[A]"),), ({"a": "[1, 2]"}, {"a": "*3"}), letters, (letters,))
    document = tables.latex(table, standalone=True).replace(
        r"\end{document}", tables.latex(brackets) + r"\end{document}"
    )
    (tmp_path / "table.tex").write_text(document, encoding="utf-8")
    done = subprocess.run(
        ["pdflatex", "-halt-on-error", "-interaction=nonstopmode", "table.tex"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=120,
    )
    assert done.returncode == 0, done.stdout[-2000:]
    assert (tmp_path / "table.pdf").stat().st_size > 1000


def test_frame_values_of_numpy_become_cells():
    frame = pd.DataFrame({"n": np.array([1, 2]), "x": [1.5, np.nan], "flag": [True, False]})
    columns = (Column("n", "N", format="d"), Column("x", "X", format=".2f"), Column("flag", "F"))
    table = Table.from_frame(frame, columns)
    assert tables.csv(table) == "N,X,F\n1,1.5,true\n2,,false\n"
    assert [table.text(1, column) for column in columns] == ["2", MISSING, "no"]


def test_unknown_format_names_the_nearest(table, tmp_path):
    with pytest.raises(InputError, match="did you mean 'markdown'"):
        tables.render(table, "markdwn")
    with pytest.raises(InputError, match="unknown table format"):
        tables.format_of(tmp_path / "x.docx")
    assert tables.render(table, tables.format_of(tmp_path / "x.tex")) == tables.latex(table)


def test_a_number_of_thousands_has_no_exponent():
    column = Column("step", "Step", "ns", ".3g")
    rows = tuple({"step": value} for value in (1163.0, 12.3, 2.5e9, 0.5))
    table = Table((column,), rows)
    assert [table.text(row, column) for row in range(4)] == ["1160", "12.3", "2.5e+09", "0.5"]


def test_a_published_table_has_the_digits_that_every_machine_agrees_on():
    column = (tables.Column("x", "X"), tables.Column("n", "N"), tables.Column("ok", "OK"))
    here, there = (
        tables.csv(portable(tables.Table(columns=column, rows=({"x": x, "n": 3, "ok": True},))))
        for x in (39.704046023530594, 39.704046023530602)
    )
    assert here == there == "X,N,OK\n39.704,3,true\n"
