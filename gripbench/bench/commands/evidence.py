"""`gripbench evidence PAPER`: what each erratum and each setting of a reproduction is worth."""

from __future__ import annotations

from typing import Annotated

import typer

from gripbench.bench.commands import REPRODUCE

PAPERS = ("li2014",)


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("evidence", rich_help_panel=REPRODUCE)(evidence)


def evidence(
    paper: Annotated[str, typer.Argument(help="li2014")],
    table_format: Annotated[
        str, typer.Option("--format", help="terminal, text, markdown, csv, latex or html")
    ] = "terminal",
) -> None:
    """Run a reproduction again with one thing done otherwise at a time, and print what changes."""
    from gripbench.bench.papers.li2014 import evidence as li2014
    from gripbench.bench.papers.li2014.tables import load_paper_tables
    from gripbench.bench.publishing import tables
    from gripbench.bench.publishing.terminal import progress
    from gripbench.errors import unknown

    if paper not in PAPERS:
        raise unknown("paper with evidence", paper, PAPERS)
    if table_format not in ("terminal", *tables.FORMATS):
        raise unknown("table format", table_format, ("terminal", *tables.FORMATS))
    published = load_paper_tables(paper)
    with progress(f"{paper}: evidence", len(li2014.changes(1))) as bar:
        found = li2014.evidence(published, lambda: bar.advance(bar.task_ids[0]))
    tables.show(found, table_format)
