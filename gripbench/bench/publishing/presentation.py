"""How results look on a terminal: tables with intervals, and progress that can be silent."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from gripbench.bench.ranking.summary import (
    FOOTNOTE,
    MARKED_BY,
    OUTSIDE_FOOTNOTE,
    failures,
    marked,
    training_note,
)
from gripbench.envs.signals import signal
from gripbench.errors import one_line

if TYPE_CHECKING:
    import pandas as pd


class _LiteralConsole(Console):
    """A console on which a text is its letters: no markup, no emoji, no control characters."""

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a text, whatever it holds, on one line."""
        return super().render_str(one_line(text), **options)


def console(stderr: bool = False) -> Console:
    """Return the console for texts and tables; wide where no terminal sets a width.

    Names, reasons and notes come from outside: here alone they become letters on a line.
    """
    stream = sys.stderr if stderr else sys.stdout
    return _LiteralConsole(
        stderr=stderr,
        width=None if stream.isatty() else 200,
        highlight=False,
        markup=False,
        emoji=False,
    )


def progress(description: str, total: int) -> Progress:
    """Return a progress bar on standard error, silent where that is no terminal."""
    bar = Progress(
        TextColumn("{task.description}", markup=False),
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


def bounded(value: float, low: float, high: float, factor: float = 1.0) -> str:
    """Return a figure with its interval where it has one.

    Examples
    --------
    >>> bounded(1.0, 0.9, 1.1), bounded(1.0, float("nan"), float("nan"), 2.0)
    ('1.00 [0.900, 1.10]', '2.00')
    """
    text = significant(factor * value)
    if not math.isfinite(low):
        return text
    ends = significant(factor * low), significant(factor * high)
    if ends[0] == ends[1] and low != high:
        ends = significant(factor * low, 5), significant(factor * high, 5)
    return text if ends[0] == ends[1] else f"{text} [{ends[0]}, {ends[1]}]"


def seconds(value: float, low: float, high: float) -> str:
    """Return a time [s] with its interval where it has one, to a hundredth.

    Examples
    --------
    >>> seconds(0.0195, 0.0098, 0.031), seconds(float("nan"), float("nan"), float("nan"))
    ('0.02 [0.01, 0.03]', '-')
    """
    if not math.isfinite(value):
        return "-"
    return f"{value:.2f}" + (f" [{low:.2f}, {high:.2f}]" if math.isfinite(low) else "")


def cell(line: pd.Series, factor: float = 1.0) -> str:
    """Return the text of one line of a summary: RMS times a factor, interval, what failed."""
    parts = []
    if line["ok"]:
        parts.append(bounded(line["rms"], line["low"], line["high"], factor))
    if line["status"]:
        all_one = not line["ok"] and "," not in line["status"]
        parts.append(line["status"].split()[-1] if all_one else f"({line['status']})")
    return " ".join(parts)


def rms_tables(summary: pd.DataFrame, width: int) -> list[tuple[str, Table]]:
    """Return headings and tables of each target.

    Methods down and scenarios across where that fits the width; else, and for a friction with a
    response to excitation, one line a method in a block for each scenario.
    """
    tables = []
    for key, part in summary.groupby("target", sort=False):
        target = str(key)
        if not target:
            continue
        factor, unit = signal(target).display_factor, signal(target).display_unit
        runs = int(part["runs"].max())
        heading = f"{target} [{unit}]: RMS error"
        heading += f", pooled over {runs} runs, 95 % interval" if runs > 1 else ", one run"
        responds = bool((part["excited"].fillna(0) > 0).any())
        table = _across(part, factor)
        if responds or Console(width=10_000).measure(table).maximum > width:
            table = _down(part, factor, responds)
        if responds:
            heading += "; delay until it stays within 20 %"
        tables.append((heading, table))
        if (part["jumps"].fillna(0) > 0).any():
            tables.append(
                (f"{target}: delay [s] from the jump of the friction, 95 % interval", _jumps(part))
            )
    return tables


def _across(part: pd.DataFrame, factor: float) -> Table:
    """Return a table with methods down and scenarios across."""
    scenarios = list(dict.fromkeys(part["scenario"]))
    table = Table()
    table.add_column("method", no_wrap=True)
    for scenario in scenarios:
        table.add_column(scenario, justify="right", no_wrap=True)
    for label, lines in part.groupby("label", sort=False):
        texts = {line["scenario"]: cell(line, factor) for _, line in lines.iterrows()}
        name = marked(str(label), *lines[[*MARKED_BY]].iloc[0])
        table.add_row(name, *(texts.get(scenario, "") for scenario in scenarios))
    return table


def _down(part: pd.DataFrame, factor: float, responds: bool) -> Table:
    """Return a table with a block for each scenario; what was skipped altogether is left out."""
    table = _blocks()
    table.add_column("scenario, method", no_wrap=True)
    headings = ("RMS", *(("from excitation", "delay [s]", "settled") if responds else ()))
    for heading in headings:
        table.add_column(heading, justify="right")
    for scenario, lines in part.groupby("scenario", sort=False):
        shown = [line for _, line in lines.iterrows() if not _skipped(line)]
        if not shown:
            continue
        table.add_section()
        table.add_row(Text(one_line(str(scenario)), "bold"))
        for line in shown:
            name = marked(line["label"], *line[[*MARKED_BY]])
            more = _response(line, factor) if responds else ()
            table.add_row(f"  {name}", cell(line, factor), *more)
    return table


def _blocks() -> Table:
    """Return an empty table without vertical lines: five columns stay within 120 characters."""
    return Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)


def _skipped(line: pd.Series) -> bool:
    return bool(not line["ok"] and line["status"] == f"{line['runs']} skipped")


def _response(line: pd.Series, factor: float) -> tuple[str, str, str]:
    """Return RMS from the first excitation on, delay, and how many of the excited runs settle."""
    if not line["excited"] > 0:
        return "not excited", "", ""
    return (
        bounded(line["excited_rms"], line["excited_low"], line["excited_high"], factor),
        seconds(line["delay"], line["delay_low"], line["delay_high"]),
        f"{line['settled']:.0f}/{line['excited']:.0f}",
    )


def _jumps(part: pd.DataFrame) -> Table:
    table = _blocks()
    table.add_column("scenario, method", no_wrap=True)
    table.add_column("delay [s]", justify="right")
    table.add_column("settled", justify="right")
    for scenario, lines in part[part["jumps"].fillna(0) > 0].groupby("scenario", sort=False):
        table.add_section()
        table.add_row(Text(one_line(str(scenario)), "bold"))
        for _, line in lines.iterrows():
            table.add_row(
                f"  {marked(line['label'], *line[[*MARKED_BY]])}",
                seconds(line["jump_delay"], line["jump_low"], line["jump_high"]),
                f"{line['jump_settled']:.0f}/{line['jumps']:.0f}",
            )
    return table


def print_summary(summary: pd.DataFrame) -> None:
    """Print the tables of a summary, and what the mark means where it occurs."""
    out = console()
    for heading, table in rms_tables(summary, out.width):
        out.print(heading, markup=False, soft_wrap=True)
        out.print(table)
    if (summary["idealised"] != "").any():
        out.print(FOOTNOTE)
    if summary["computed_outside"].any():
        out.print(OUTSIDE_FOOTNOTE)
    for label, group in summary[summary["training"] != ""].groupby("label", sort=False):
        note = training_note(str(label), *group[["training", "training_time"]].iloc[0])
        out.print(note, markup=False, highlight=False, soft_wrap=True)


def print_failures(rows: pd.DataFrame, stderr: bool = False) -> None:
    """Print what is not ok with its reason: failures one by one, then methods that were skipped."""
    bad = failures(rows)
    skipped = bad["status"] == "skipped"
    out = console(stderr)
    for _, line in bad[~skipped].iterrows():
        runs = f"{line['runs']} runs" if line["runs"] > 1 else f"seed {line['first_seed']}"
        out.print(
            f"{line['status']}: {line['label']} on {line['scenario']} ({runs}): {line['reason']}",
            markup=False,
            soft_wrap=True,
        )
    for (label, reason), lines in bad[skipped].groupby(["label", "reason"], sort=False):
        scenarios = ", ".join(dict.fromkeys(lines["scenario"]))
        out.print(f"skipped: {label}: {reason}: {scenarios}", markup=False, soft_wrap=True)
