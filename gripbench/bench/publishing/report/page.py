"""Rows and time series in; content, style, script and Plotly in one HTML file out."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import pandas as pd

import gripbench
from gripbench.bench.bounds.stored import bounds_beside
from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.publishing.answer_table import answer_table
from gripbench.bench.publishing.degradation_table import degradation_tables, every_line
from gripbench.bench.publishing.figures.style import PAGE
from gripbench.bench.publishing.leaderboard import uncertainty_boards
from gripbench.bench.publishing.manifest import commit
from gripbench.bench.publishing.pages import template
from gripbench.bench.publishing.report.content import (
    boards_by_road,
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
    bounds = bounds_beside(results, rows["scenario"].unique())
    found = found_boards(rows, targets, bounds)
    whole: dict[str, Board] = {}  # the headline board of each target
    for board in found:
        if not board.sensors:
            whole.setdefault(board.target, board)
    data = {
        "targets": {name: target_words(name) for name in targets},
        "methods": list(dict.fromkeys(rows["label"])),
        "maps": {name: heat_map(rows, name, bounds) for name in targets},
        "fronts": {target: points for target, board in whole.items() if (points := front(board))},
        "profiles": {target: profile(board) for target, board in whole.items()},
        "series": series,
        "style": PAGE,
    }
    return template(Path(__file__).parent, "template.html").render(
        css=_file("report.css"),
        script=_file("report.js"),
        plotly=_plotly(),
        data=_json(data),
        answers=answer_table(answers(rows, targets)),
        facts=_facts(rows),
        targets=targets,
        boards=[
            *(_Shown(board) for board in found),
            *(_Shown(board, road) for road, board in boards_by_road(rows, targets)),
        ],
        critical=[critical_differences(board) for board in whole.values()],
        faults=degradation_tables(damage) if len(damage) else [],
        every_fault=[every_line(damage, str(name)) for name in damage["target"].unique()]
        if len(damage)
        else [],
        uncertainty=[_Stated(board) for board in _of_uncertainty(rows, targets)],
        papers=paper_results(results),
        failures=failure_table(rows),
        absent=absent,
        manifests={
            name: json.dumps(content, indent=1, sort_keys=True)
            for name, content in manifests(results).items()
        },
        footer=f"gripbench {gripbench.__version__}, commit {commit()}, {today()}",
        points=POINTS,
        curves=bool(series),
    )


class _Shown:
    """A board as the page shows it: its answer, its tables, the choices by which it is found."""

    def __init__(self, board: Board, road: str = "") -> None:
        self.title, self.target, self.road = board.title, board.target, road
        self.said, self.narrow, self.wide = shown_board(board)
        first = board.scenarios[:1]
        marks = [text for name in first for text in (plan_of(name), setting_of(name)) if text]
        sensors = ", ".join(board.sensors) or "any"
        self.choice = f"{sensors} ({', '.join(marks)})" if marks else sensors


class _Stated:
    """A board of uncertainty as the page shows it: its answer, table and diagram."""

    def __init__(self, board: Board) -> None:
        setting = setting_of(board.scenarios[0]) if board.scenarios else ""
        self.title = board.title + (f", {setting}" if setting else "")
        self.said, self.narrow, _ = shown_board(board)
        self.diagram = reliability_diagram(board)


def _of_uncertainty(rows: pd.DataFrame, targets: Sequence[str]) -> list[Board]:
    return sorted(uncertainty_boards(rows[rows["target"].isin(targets)]), key=standing_of)


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


def _facts(rows: pd.DataFrame) -> dict[str, str]:
    runs = rows.drop_duplicates(["scenario", "label", "seed"])
    status = runs["status"].value_counts()
    bad = {str(name): int(count) for name, count in status.items() if name != "ok"}
    return {
        "Scenarios": str(runs["scenario"].nunique()),
        "Methods": str(runs["label"].nunique()),
        "Seeds": str(runs["seed"].nunique()),
        "Runs": str(len(runs)),
        "Finished": str(int(status.get("ok", 0))),
        "Not finished": ", ".join(f"{count} {name}" for name, count in bad.items()) or "none",
    }
