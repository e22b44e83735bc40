"""`gripbench leaderboard`: build it, and compare it with an earlier one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gripbench.bench.commands import PUBLISH
from gripbench.writing import DEFAULT_RESULTS


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("leaderboard", rich_help_panel=PUBLISH)(leaderboard)


def leaderboard(
    results: Annotated[Path, typer.Option(help="Folder of the stored rows.")] = DEFAULT_RESULTS,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for leaderboard.md, .csv and .json; by default --results."),
    ] = None,
    suite: Annotated[
        list[str] | None,
        typer.Option(help="Only the scenarios and targets of this suite; repeat for more."),
    ] = None,
    target: Annotated[
        list[str] | None,
        typer.Option(help="Signal to rank by; repeat for more. By default the suites' targets."),
    ] = None,
    timings: Annotated[
        Path | None,
        typer.Option(help="JSON of pytest-benchmark for runtimes relative to the reference."),
    ] = None,
    answer: Annotated[
        bool,
        typer.Option(
            "--answer",
            help="Only print, in Markdown, which method to take for which road and sensors.",
        ),
    ] = False,
    compare: Annotated[
        Path | None,
        typer.Option(help="An earlier leaderboard.json, or its folder; exit 1 on a regression."),
    ] = None,
    factor: Annotated[
        float, typer.Option(help="Factor by which a relative runtime may rise.")
    ] = 1.5,
    margin: Annotated[float, typer.Option(help="Share by which an RMS may rise.")] = 0.001,
    confidence: Annotated[float, typer.Option(help="Confidence of every claim.")] = 0.95,
    report: Annotated[
        Path | None,
        typer.Option(help="Also write the comparison, as .md, .csv, .html, .tex or .txt."),
    ] = None,
) -> None:
    """Build the leaderboard of stored rows; with --compare, fail if a method became worse."""
    from gripbench.bench.bounds.stored import bounds_beside
    from gripbench.bench.catalogue.scenarios import find_scenario
    from gripbench.bench.catalogue.suites import load_suite
    from gripbench.bench.publishing.answer_table import answer_table
    from gripbench.bench.publishing.leaderboard import build, read, usual_targets, write
    from gripbench.bench.publishing.regressions import changes_table
    from gripbench.bench.publishing.regressions import compare as compare_leaderboards
    from gripbench.bench.publishing.tables import format_of, markdown, render, show
    from gripbench.bench.publishing.timings import read_timings
    from gripbench.bench.ranking.answers import answers
    from gripbench.bench.ranking.degradation import without_faults
    from gripbench.bench.running.store import read_rows
    from gripbench.envs.instruments.faults import split_faults
    from gripbench.errors import InputError, unknown
    from gripbench.writing import check_writable, write_atomically

    base = read(compare) if compare is not None else None  # before --out may replace it
    if report is not None:
        format_of(report)
        check_writable(report)
    suites = [load_suite(name) for name in suite or ()]
    names = [find_scenario(item).name for each in suites for item in each.names()]
    rows = read_rows(results)
    if suite:
        rows = rows[rows["scenario"].map(lambda name: split_faults(name)[0]).isin(names)]
    if rows.empty:
        raise InputError(f"{results}: no stored rows to rank; 'gripbench run' makes them")
    known = set(rows["target"])
    for name in target or ():
        if name not in known:
            raise unknown("target", name, known)
    named = known & set(target or (name for each in suites for name in each.targets))
    targets = named or usual_targets(rows)
    if answer:
        clean = without_faults(rows)
        print(markdown(answer_table(answers(clean, targets or sorted(known - {""})))), end="")
        return
    bounds = bounds_beside(results, rows["scenario"].unique())
    relative = read_timings(timings) if timings else None
    current, boards = build(rows, relative, confidence, targets, bounds)
    for path in write(out or results, current, boards):
        print(f"wrote {path}")
    if base is None:
        return
    changes = compare_leaderboards(base, current, factor, margin, confidence)
    table = changes_table(changes)
    show(table)
    if report is not None:
        write_atomically(report, render(table, format_of(report)))
    if base.runtimes and not current.runtimes:
        print("Runtimes were not compared: give --timings.")
    if any(change.regression for change in changes):
        raise typer.Exit(1)
