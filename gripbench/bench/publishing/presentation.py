"""A summary of rows in; its tables on a terminal out, with intervals and what failed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.publishing.tables import show, width_of
from gripbench.bench.publishing.terminal import console
from gripbench.bench.ranking.marks import (
    FOOTNOTE,
    MARKED_BY,
    OUTSIDE_FOOTNOTE,
    PREFIX_FOOTNOTE,
    marked,
    training_note,
)
from gripbench.bench.ranking.summary import failures
from gripbench.envs.signals import signal

if TYPE_CHECKING:
    import pandas as pd


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


def rms_tables(summary: pd.DataFrame, width: int) -> list[Table]:
    """Return the tables of each target.

    Methods down and scenarios across where that fits the width; else, and for a friction with a
    response to excitation, one line a method in a block for each scenario.
    """
    found = []
    for key, part in summary.groupby("target", sort=False):
        target = str(key)
        if not target:
            continue
        factor, unit = signal(target).display_factor, signal(target).display_unit
        runs = int(part["runs"].max())
        caption = f"{target} [{unit}]: RMS error"
        caption += f", pooled over {runs} runs, 95 % interval" if runs > 1 else ", one run"
        responds = bool((part["excited"].fillna(0) > 0).any())
        table = _across(part, factor, caption)
        if responds:
            table = _down(part, factor, f"{caption}; delay until it stays within 20 %", _response)
        elif width_of(table) > width:
            table = _down(part, factor, caption)
        found.append(table)
        if (part["jumps"].fillna(0) > 0).any():
            found.append(_jumps(part, target))
    return found


def _across(part: pd.DataFrame, factor: float, caption: str) -> Table:
    """Return a table with methods down and scenarios across."""
    scenarios = list(dict.fromkeys(part["scenario"]))
    rows = [
        {"method": _name(lines.iloc[0]), **dict.fromkeys(scenarios, "")}
        | {line["scenario"]: cell(line, factor) for _, line in lines.iterrows()}
        for _, lines in part.groupby("label", sort=False)
    ]
    columns = [Column("method", "method"), *(Column(name, name, right=True) for name in scenarios)]
    return Table(tuple(columns), tuple(rows), caption)


def _down(
    part: pd.DataFrame,
    factor: float,
    caption: str,
    more: Callable[[pd.Series, float], dict[str, str]] = lambda line, factor: {},
) -> Table:
    """Return a table with a block for each scenario; what was skipped altogether is left out."""
    rows = [
        {"scenario": scenario, "method": _name(line), "RMS": cell(line, factor)}
        | more(line, factor)
        for scenario, lines in part.groupby("scenario", sort=False)
        for _, line in lines.iterrows()
        if not _skipped(line)
    ]
    return _blocks(rows, caption)


def _blocks(rows: Sequence[Mapping[str, Any]], caption: str) -> Table:
    titles = {"method": "scenario, method"}
    columns = tuple(
        Column(key, titles.get(key, key), right=key not in ("scenario", "method"))
        for key in (rows[0] if rows else ("scenario", "method"))
    )
    return Table(columns, tuple(rows), caption, group_by="scenario", headed=True)


def _name(line: pd.Series) -> str:
    return marked(str(line["label"]), *line[[*MARKED_BY]])


def _skipped(line: pd.Series) -> bool:
    return bool(not line["ok"] and line["status"] == f"{line['runs']} skipped")


def _response(line: pd.Series, factor: float) -> dict[str, str]:
    """Return RMS from the first excitation on, delay, and how many of the excited runs settle."""
    if not line["excited"] > 0:
        return {"from excitation": "not excited", "delay [s]": "", "settled": ""}
    excited = line["excited_rms"], line["excited_low"], line["excited_high"]
    return {
        "from excitation": bounded(*excited, factor),
        "delay [s]": seconds(line["delay"], line["delay_low"], line["delay_high"]),
        "settled": f"{line['settled']:.0f}/{line['excited']:.0f}",
    }


def _jumps(part: pd.DataFrame, target: str) -> Table:
    rows = [
        {
            "scenario": scenario,
            "method": _name(line),
            "delay [s]": seconds(line["jump_delay"], line["jump_low"], line["jump_high"]),
            "settled": f"{line['jump_settled']:.0f}/{line['jumps']:.0f}",
        }
        for scenario, lines in part[part["jumps"].fillna(0) > 0].groupby("scenario", sort=False)
        for _, line in lines.iterrows()
    ]
    return _blocks(rows, f"{target}: delay [s] from the jump of the friction, 95 % interval")


def print_summary(summary: pd.DataFrame) -> None:
    """Print the tables of a summary, and what the mark means where it occurs."""
    out = console()
    for table in rms_tables(summary, out.width):
        show(table)
        print()
    if (summary["idealised"] != "").any():
        out.print(FOOTNOTE)
    if summary["computed_outside"].any():
        out.print(OUTSIDE_FOOTNOTE)
    if summary["over_prefixes"].any():
        out.print(PREFIX_FOOTNOTE)
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
