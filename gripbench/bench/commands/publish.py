"""`gripbench publish`: everything that `results/` holds, made by one command."""

from __future__ import annotations

import contextlib
import io
import time
from pathlib import Path
from typing import Annotated

import typer

from gripbench.bench.commands import PUBLISH
from gripbench.writing import DEFAULT_RESULTS

SEEDS = 20
"""Seeds of a published suite."""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("publish", rich_help_panel=PUBLISH)(publish)


def publish(
    results: Annotated[Path, typer.Option(help="Folder to publish into.")] = DEFAULT_RESULTS,
    seeds: Annotated[int, typer.Option(min=2, help="Seeds of each scenario.")] = SEEDS,
    suite: Annotated[
        list[str] | None, typer.Option(help="Only this suite; repeat for more.")
    ] = None,
    paper: Annotated[
        list[str] | None, typer.Option(help="Only this paper; repeat for more.")
    ] = None,
    with_papers: Annotated[
        bool, typer.Option("--papers/--no-papers", help="Whether to reproduce papers.")
    ] = True,
    timings: Annotated[
        Path | None,
        typer.Option(
            help="JSON of pytest-benchmark: the leaderboard then carries runtimes relative to the "
            "reference kernel, which CI compares with."
        ),
    ] = None,
    workers: Annotated[int, typer.Option(min=0, help="Processes; 0: one a core.")] = 0,
) -> None:
    """Run the suites, reproduce the papers; write tables, figures, leaderboard, report, manifest.

    Rows that are stored are not run again. Exit code 1 when a published figure has changed.
    """
    import joblib

    from gripbench.bench.bounds.stored import bounds_beside
    from gripbench.bench.catalogue.suites import load_suite, suite_files
    from gripbench.bench.papers.claims import paper_files
    from gripbench.bench.publishing.dataset import write_dataset
    from gripbench.bench.publishing.leaderboard import build, write
    from gripbench.bench.publishing.manifest import manifest, write_manifest
    from gripbench.bench.publishing.report.content import chosen_targets, rows_of_suites
    from gripbench.bench.publishing.report.page import write_report
    from gripbench.bench.publishing.timings import read_timings
    from gripbench.bench.ranking.statistics import CONFIDENCE
    from gripbench.bench.running.api import limits_of, plan_of
    from gripbench.bench.running.backends import Backend
    from gripbench.bench.running.runner import run_plan
    from gripbench.bench.running.store import Store, read_rows
    from gripbench.errors import unknown

    suites = suite or list(suite_files())
    papers = (paper or list(paper_files())) if with_papers else []
    for name in papers:
        if name not in paper_files():
            raise unknown("paper", name, paper_files())
    runtimes = read_timings(timings) if timings else None
    backend = Backend(workers=workers)
    began = time.perf_counter()

    def say(text: str) -> None:
        typer.echo(f"{time.perf_counter() - began:6.1f} s  {text}", err=True)

    for name in suites:
        run = run_plan(
            plan_of(name, (), (), seeds), Store(results), backend, limits_of(60.0, 2048.0)
        )
        say(f"suite {name}: {run.computed} cells run, {run.stored} stored already")
    jobs = (joblib.delayed(publish_paper)(name, results) for name in papers)
    changed: list[str] = []
    for name, lines in joblib.Parallel(n_jobs=backend.processes, return_as="generator")(jobs):
        changed += [f"{name}: {line}" for line in lines]
        say(f"paper {name}")
    rows = rows_of_suites(read_rows(results), suites)
    rows = rows[rows["seed"] < seeds]
    targets = chosen_targets(rows, suites)
    bounds = bounds_beside(results, rows["scenario"].unique())
    files = write(results, *build(rows, runtimes, CONFIDENCE, targets, bounds))
    files += write_dataset(results, rows)
    say("leaderboard" if runtimes else "leaderboard, without runtimes: give --timings")
    configuration = {name: load_suite(name).model_dump(mode="json") for name in suites}
    write_manifest(results, manifest(configuration, dict.fromkeys(suites, seeds)), files)
    write_report(results, results / "report.html", suites, workers=backend.processes)
    say("report")
    for line in changed:
        typer.echo(f"changed: {line}", err=True)
    if changed:
        raise typer.Exit(1)


def publish_paper(name: str, results: Path, figures: bool = True) -> tuple[str, list[str]]:
    """Reproduce a paper and draw its figures.

    Parameters
    ----------
    name
        The paper.
    results
        Folder in which the paper has its own.
    figures
        Whether to draw them.

    Returns
    -------
    The paper's name, and a line for each figure that has left the tolerance stored beside it.
    """
    from gripbench.bench.commands.reproduce import reproduce
    from gripbench.bench.papers.figures import write_figures

    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            reproduce(name, results)
        except typer.Exit as left:
            if not left.exit_code:
                raise
    if figures:
        write_figures(name, results / name / "figures")
    lines = said.getvalue().splitlines()
    return name, [line.removeprefix("changed: ") for line in lines if line.startswith("changed: ")]
