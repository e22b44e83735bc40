"""The page: content, style, script and Plotly in one HTML file."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Callable, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import pandas as pd

import gripbench
from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.publishing import tables
from gripbench.bench.publishing.board_tables import answer_table
from gripbench.bench.publishing.columns import Table
from gripbench.bench.publishing.degradation_table import degradation_tables, every_line
from gripbench.bench.publishing.figures.style import SERIES
from gripbench.bench.publishing.leaderboard import uncertainty_boards
from gripbench.bench.publishing.manifest import commit
from gripbench.bench.publishing.report.content import (
    PaperResult,
    chosen_targets,
    failure_table,
    found_boards,
    front,
    heat_map,
    manifests,
    paper_results,
    profile,
    rows_of_suites,
    shown_board,
    target_words,
    today,
)
from gripbench.bench.publishing.report.critical import critical_differences
from gripbench.bench.publishing.report.reliability import reliability_diagram
from gripbench.bench.publishing.report.series import POINTS, SeriesPlan, all_series
from gripbench.bench.ranking.answers import answers
from gripbench.bench.ranking.degradation import degradation, without_faults
from gripbench.bench.ranking.plans import plan_of, setting_of, standing_of
from gripbench.bench.ranking.ranking import Board
from gripbench.bench.ranking.summary import not_run
from gripbench.bench.running.recorded_scenarios import PREFIX, at_hand, recorded_scenario
from gripbench.bench.running.store import read_rows
from gripbench.errors import InputError
from gripbench.writing import write_atomically

_DARK = ("#56B4E9", "#FF8A4C", "#2FCB9A", "#E79BC8", "#F2C04D", "#B7A4FF")
_DASHES = ("dash", "dot", "dashdot", "longdash", "solid", "longdashdot")
_SYMBOLS = ("circle", "square", "triangle-up", "diamond", "triangle-down", "cross")


def write_report(
    results: Path,
    output: Path,
    suites: Sequence[str] = (),
    targets: Sequence[str] = (),
    shown_seeds: int = 3,
    band_seeds: int = 20,
    workers: int = 1,
    advance: Callable[[int, int], None] = lambda done, total: None,
    methods: Sequence[str] = (),
    recordings: Sequence[str] = (),
) -> Path:
    """Write the report of what is stored in a results folder.

    Parameters
    ----------
    results
        Folder with the rows, and with what `gripbench reproduce` wrote.
    output
        The HTML file.
    suites
        Only what belongs to these suites; none: everything.
    targets
        Only these targets; none: those of the suites.
    shown_seeds
        Number of seeds of which the page holds time series.
    band_seeds
        Number of seeds over which error bands are taken.
    workers
        Number of processes that make time series.
    advance
        Called with scenarios done and their number.
    methods
        Methods from files of one's own, `file.py:Class` as they were run, so that they have curves.
    recordings
        Folders or maps of recordings that are not found by name, likewise.

    Raises
    ------
    InputError
        If there is nothing to report.
    """
    rows = read_rows(results)
    if rows.empty:
        raise InputError(
            f"no rows under {results}: run something first, as in "
            "'gripbench run --suite longitudinal'"
        )
    rows = rows_of_suites(rows, suites)
    chosen = tuple(targets) or chosen_targets(rows, suites)
    own = {choose_method(method).label: method for method in methods}
    places = {recorded_scenario(place).name: PREFIX + place for place in recordings}
    plans = series_plans(without_faults(rows), chosen, shown_seeds, band_seeds, own, places)
    done = 0

    def count() -> None:
        nonlocal done
        done += 1
        advance(done, len(plans))

    series = all_series(plans, workers, count)
    write_atomically(output, page(rows, chosen, series, results))
    return output


def series_plans(
    rows: pd.DataFrame,
    targets: Sequence[str],
    shown: int,
    band: int,
    own: Mapping[str, str] | None = None,
    places: Mapping[str, str] | None = None,
) -> list[SeriesPlan]:
    """Return what to draw of each scenario: methods that ran there, on seeds that were run.

    Recordings of real vehicles that are no longer at hand have no curves.
    """
    plans = []
    good = rows[(rows["status"] == "ok") & rows["target"].isin(targets)]
    for scenario, part in good.groupby("scenario", sort=False):
        place = (places or {}).get(str(scenario), str(scenario))
        if not at_hand(place):
            continue
        seeds = tuple(int(seed) for seed in sorted(part["seed"].unique()))
        estimates = {
            target: tuple(dict.fromkeys(part.loc[part["target"] == target, "label"]))
            for target in targets
            if (part["target"] == target).any()
        }
        plans.append(
            SeriesPlan(str(scenario), estimates, seeds[:shown], seeds[:band], own or {}, place)
        )
    return plans


def page(
    rows: pd.DataFrame, targets: Sequence[str], series: Mapping[str, Any], results: Path
) -> str:
    """Return the page as text.

    Parameters
    ----------
    rows
        Rows to report.
    targets
        Targets to report.
    series
        Time series by scenario, as `all_series` returns them.
    results
        Folder in which reproductions and manifests are looked for.
    """
    damage = degradation(rows[rows["target"].isin(targets)])
    rows = without_faults(rows)
    absent = not_run(rows)
    if len(absent) < rows["scenario"].nunique():
        rows = rows[~rows["scenario"].isin(absent)]
    found = found_boards(rows, targets)
    whole: dict[str, Board] = {}  # the headline board of each target
    for board in found:
        if not board.sensors:
            whole.setdefault(board.target, board)
    data = {
        "targets": {name: target_words(name) for name in targets},
        "methods": list(dict.fromkeys(rows["label"])),
        "maps": {name: heat_map(rows, name) for name in targets},
        "fronts": {target: points for target, board in whole.items() if (points := front(board))},
        "profiles": {target: profile(board) for target, board in whole.items()},
        "series": series,
        "style": {
            "light": [look.color for look in SERIES],
            "dark": list(_DARK),
            "dashes": list(_DASHES),
            "symbols": list(_SYMBOLS),
        },
    }
    parts = {
        "css": _file("report.css"),
        "answers": _answers(rows, targets),
        "summary": _summary(rows, targets),
        "boards": "\n".join(_board(board) for board in found),
        "critical": "\n".join(critical_differences(board) for board in whole.values()),
        "faults": _faults(damage),
        "uncertainty": _uncertainty(rows, targets),
        "papers": _papers(paper_results(results)),
        "failures": _failures(rows) + _notes(absent),
        "manifest": _manifest(manifests(results)),
        "footer": html.escape(f"gripbench {gripbench.__version__}, commit {commit()}, {today()}"),
        "points": str(POINTS),
        "data": _json(data),
        "script": _file("report.js"),
        "plotly": _plotly(),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], _file("template.html"))


def _file(name: str) -> str:
    return resources.files(__package__ or "").joinpath(name).read_text(encoding="utf-8")


def _plotly() -> str:
    try:
        from plotly.offline import get_plotlyjs  # type: ignore[import-untyped, unused-ignore]
    except ImportError:
        raise InputError("the report needs: pip install 'gripbench[report]'") from None
    script: str = get_plotlyjs()
    return script.replace("</script", "<\\/script")


def _json(value: Any) -> str:
    """Return JSON that may stand within a script element."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def _summary(rows: pd.DataFrame, targets: Sequence[str]) -> str:
    runs = rows.drop_duplicates(["scenario", "label", "seed"])
    status = runs["status"].value_counts()
    bad = {str(name): int(count) for name, count in status.items() if name != "ok"}
    facts = {
        "Scenarios": str(runs["scenario"].nunique()),
        "Methods": str(runs["label"].nunique()),
        "Seeds": str(runs["seed"].nunique()),
        "Runs": str(len(runs)),
        "Finished": str(int(status.get("ok", 0))),
        "Not finished": ", ".join(f"{count} {name}" for name, count in bad.items()) or "none",
    }
    items = "".join(
        f"<div><dt>{html.escape(name)}</dt><dd>{html.escape(value)}</dd></div>"
        for name, value in facts.items()
    )
    names = ", ".join(html.escape(name) for name in targets)
    return (
        f'<dl class="facts">{items}</dl>\n'
        "<p>Every method ran over the same recordings of the same seeds, and was given the "
        f"sensors that it declares and nothing else. Targets: {names}.</p>"
    )


def _board(board: Any) -> str:
    sensors = ", ".join(board.sensors) or "any"
    plan = plan_of(board.scenarios[0]) if board.scenarios else ""
    setting = setting_of(board.scenarios[0]) if board.scenarios else ""
    marks = ", ".join(text for text in (plan, setting) if text)
    choice = f"{sensors} ({marks})" if marks else sensors
    said, narrow, wide = shown_board(board)
    title = html.escape(board.title)
    return (
        f'<div class="board" data-target="{html.escape(board.target)}" '
        f'data-sensors="{html.escape(choice)}">\n<p class="answer">{html.escape(said)}</p>\n'
        f'<div class="narrow scroll" tabindex="0" role="region" aria-label="{title}">\n'
        f"{tables.html(narrow)}</div>\n<details><summary>Every column</summary>"
        f'<div class="scroll" tabindex="0" role="region" aria-label="{title}, every column">\n'
        f"{tables.html(wide)}</div></details></div>"
    )


def _uncertainty(rows: pd.DataFrame, targets: Sequence[str]) -> str:
    """Return the boards of uncertainty with their reliability diagrams."""
    found = uncertainty_boards(rows[rows["target"].isin(targets)])
    found.sort(key=standing_of)
    if not found:
        return "<p>No method here states how large its errors are.</p>"
    parts = []
    for board in found:
        setting = setting_of(board.scenarios[0]) if board.scenarios else ""
        title = html.escape(board.title + (f", {setting}" if setting else ""))
        said, narrow, _ = shown_board(board)
        parts.append(
            f"<details><summary>{title}</summary>"
            f'<p class="answer">{html.escape(said)}</p>'
            f'<div class="scroll" tabindex="0" role="region" aria-label="{title}">'
            f"{tables.html(narrow)}</div>{reliability_diagram(board)}</details>"
        )
    return "\n".join(parts)


def _answers(rows: pd.DataFrame, targets: Sequence[str]) -> str:
    found = tables.html(answer_table(answers(rows, targets)))
    return (
        '<div class="scroll" tabindex="0" role="region" '
        f'aria-label="Which method for which road and sensors">\n{found}</div>'
    )


def _faults(damage: pd.DataFrame) -> str:
    if damage.empty:
        return (
            "<p>No run with a fault lies in this results folder: "
            "<code>gripbench run --suite lateral_population --faults</code> makes them.</p>"
        )
    parts = [_scrolled(table) for table in degradation_tables(damage)]
    for target in damage["target"].unique():
        table = every_line(damage, str(target))
        summary = html.escape(table.caption)
        parts.append(f"<details><summary>{summary}</summary>{_scrolled(table)}</details>")
    return "\n".join(parts)


def _scrolled(table: Table) -> str:
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{html.escape(table.caption)}">'
        f"\n{tables.html(table)}</div>"
    )


def _papers(found: Sequence[PaperResult]) -> str:
    if not found:
        return (
            "<p>No reproduction of a paper lies in this results folder: "
            "<code>gripbench reproduce li2014</code> makes one.</p>"
        )
    parts = [
        '<p class="caption">Figures that a paper prints, beside what gripbench obtains. Green: '
        "within the tolerance stated with the paper's file; orange: not.</p>"
    ]
    for paper in found:
        parts.append(f"<h3>{html.escape(paper.name)}</h3>")
        if paper.remarks:
            lines = "".join(f"<li>{html.escape(line)}</li>" for line in paper.remarks)
            parts.append(f"<ul>{lines}</ul>")
        for item in paper.tables:
            parts.append(
                f"<details><summary>{html.escape(item.title)}</summary>"
                f'<div class="papers scroll" tabindex="0" role="region" '
                f'aria-label="{html.escape(f"{paper.name} {item.title}")}">'
                f"{tables.html(item.table)}</div></details>"
            )
    return "\n".join(parts)


def _failures(rows: pd.DataFrame) -> str:
    table = failure_table(rows)
    if not table.rows:
        return "<p>Every run finished.</p>"
    return (
        '<p class="caption">What did not end well and why. A failure ranks last; a skipped run '
        "lacks a sensor or a vehicle parameter that the method needs.</p>"
        '<div class="scroll" tabindex="0" role="region" aria-label="Failures">'
        f"{tables.html(table)}</div>"
    )


def _notes(absent: Mapping[str, str]) -> str:
    """Return what was not run at all, say for want of a recording's files: no method failed."""
    return "".join(
        f'<p class="note">Note: {html.escape(scenario)} was not run: {html.escape(reason)}.</p>'
        for scenario, reason in absent.items()
    )


def _manifest(found: Mapping[str, Any]) -> str:
    if not found:
        return "<p>No manifest lies in this results folder.</p>"
    return "\n".join(
        f"<details><summary>{html.escape(name)}</summary>"
        f'<pre tabindex="0">{html.escape(json.dumps(content, indent=1, sort_keys=True))}</pre>'
        "</details>"
        for name, content in found.items()
    )
