"""How results look on a terminal: tables with intervals, and progress that can be silent."""

from __future__ import annotations

import math
import sys

import pandas as pd
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from gripbench.bench.summary import FOOTNOTE, failures, marked
from gripbench.envs.signals import signal


def console() -> Console:
    """Return the console for tables; wide where no terminal sets a width."""
    return Console(width=None if sys.stdout.isatty() else 200, highlight=False)


def progress(description: str, total: int) -> Progress:
    """Return a progress bar on standard error, silent where that is no terminal."""
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        disable=not sys.stderr.isatty(),
        transient=True,
    )
    bar.add_task(description, total=total)
    return bar


def significant(value: float, digits: int = 3) -> str:
    """Return a number with this many significant digits and no exponent where it is readable.

    Examples
    --------
    >>> significant(1234.5), significant(0.012345), significant(float("nan"))
    ('1234', '0.0123', '-')
    """
    if not math.isfinite(value):
        return "-"
    if value == 0.0:
        return "0"
    places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{places}f}" if places <= 6 else f"{value:.{digits - 1}e}"


def cell(line: pd.Series) -> str:
    """Return the text of one line of a summary: RMS, interval, what failed."""
    parts = []
    if line["ok"]:
        parts.append(significant(line["rms"]))
        if math.isfinite(line["low"]):
            parts.append(f"[{significant(line['low'])}, {significant(line['high'])}]")
    if line["status"]:
        all_one = not line["ok"] and "," not in line["status"]
        parts.append(line["status"].split()[-1] if all_one else f"({line['status']})")
    return " ".join(parts)


def rms_tables(summary: pd.DataFrame) -> list[tuple[str, Table]]:
    """Return a heading and a table for each target: methods down, scenarios across."""
    tables = []
    for key, part in summary.groupby("target", sort=False):
        target = str(key)
        if not target:
            continue
        scenarios = list(dict.fromkeys(part["scenario"]))
        unit = signal(target).unit
        runs = int(part["runs"].max())
        heading = f"{target} [{unit}]: RMS error, pooled over {runs} runs, 95 % interval"
        table = Table()
        table.add_column("method")
        for scenario in scenarios:
            table.add_column(scenario, justify="right")
        for label, lines in part.groupby("label", sort=False):
            texts = {line["scenario"]: cell(line) for _, line in lines.iterrows()}
            name = marked(str(label), lines["idealised"].iloc[0])
            table.add_row(name, *(texts.get(scenario, "") for scenario in scenarios))
        tables.append((heading, table))
    return tables


def print_summary(summary: pd.DataFrame) -> None:
    """Print the tables of a summary, and what the mark means where it occurs."""
    out = console()
    for heading, table in rms_tables(summary):
        out.print(heading, markup=False, soft_wrap=True)
        out.print(table)
    if (summary["idealised"] != "").any():
        out.print(FOOTNOTE)


def print_failures(rows: pd.DataFrame) -> None:
    """Print what is not ok with its reason, skipped cells last."""
    bad = failures(rows)
    out = console()
    for _, line in bad.sort_values("status", key=lambda column: column == "skipped").iterrows():
        runs = f"{line['runs']} runs" if line["runs"] > 1 else f"seed {line['first_seed']}"
        out.print(
            f"{line['status']}: {line['label']} on {line['scenario']} ({runs}): {line['reason']}",
            markup=False,
            soft_wrap=True,
        )
