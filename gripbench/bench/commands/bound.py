"""`gripbench bound`: what anybody could reach with the car on paper."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gripbench.bench.commands import RANK
from gripbench.writing import DEFAULT_RESULTS

if TYPE_CHECKING:
    from gripbench.bench.bounds.bound import Bound


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("bound", rich_help_panel=RANK)(bound)


def bound(
    scenario: Annotated[
        list[str] | None,
        typer.Argument(help="A scenario's name or TOML file, such as slalom_snow@1; or several."),
    ] = None,
    suite: Annotated[str, typer.Option(help="All scenarios and targets of a suite.")] = "",
    sensors: Annotated[
        list[str] | None,
        typer.Option(
            help="Instruments or channels that may be read, with commas between; repeat for "
            "another set. By default all that the car has."
        ),
    ] = None,
    target: Annotated[
        list[str] | None, typer.Option(help="Signal, such as mu_front; repeat for more.")
    ] = None,
    seeds: Annotated[
        str, typer.Option(help="N for seeds 0 to N-1, or A:B for A to B-1; 1, with --boards 4.")
    ] = "",
    step: Annotated[
        float, typer.Option(min=0.001, max=0.1, help="Time between samples of the recursion [s].")
    ] = 0.01,
    workers: Annotated[int, typer.Option(min=0, help="Processes; 0: one a core.")] = 0,
    export: Annotated[
        Path | None,
        typer.Option(help="Also draw the first run over time (.png, .pdf) or write all (.csv)."),
    ] = None,
    boards: Annotated[
        bool,
        typer.Option(
            "--boards",
            help="Compute what the boards of the stored rows need, in their first seeds, and keep "
            "it beside the rows.",
        ),
    ] = False,
    results: Annotated[Path, typer.Option(help="Folder of the stored rows.")] = DEFAULT_RESULTS,
    format_: Annotated[
        str, typer.Option("--format", help="terminal, text, markdown, csv, latex or html.")
    ] = "terminal",
) -> None:
    """Print the posterior Cramer-Rao bound: the least RMS error that these sensors allow."""
    from gripbench.bench.bounds.runs import bounds_of
    from gripbench.bench.catalogue.scenarios import find_scenario
    from gripbench.bench.catalogue.suites import load_suite
    from gripbench.bench.publishing.bound_table import bound_table
    from gripbench.bench.publishing.tables import FORMATS, show
    from gripbench.bench.running.api import seeds_of
    from gripbench.errors import InputError, unknown
    from gripbench.writing import check_writable

    if format_ not in ("terminal", *FORMATS):
        raise unknown("table format", format_, ("terminal", *FORMATS))
    if boards:
        _store(results, seeds or "4", workers)
        return
    chosen = load_suite(suite) if suite else None
    names = [*(scenario or ()), *(chosen.names() if chosen else ())]
    if not names:
        raise InputError("no scenario: give one, such as friction_step@1, or --suite")
    if export is not None:
        if export.suffix not in (".png", ".pdf", ".csv"):
            raise InputError(f"{export}: a bound is written as .png, .pdf or .csv")
        check_writable(export)
    targets = target or list(chosen.targets if chosen else ())
    found, missing = bounds_of(
        [find_scenario(name) for name in names], seeds_of(seeds or "1"), sensors or [""], targets,
        step, workers,
    )  # fmt: skip
    if not found and len(names) == 1:
        raise InputError(f"{names[0]}: no bound: {missing[names[0]]}")
    show(bound_table(found, missing), format_)
    if export is not None:
        _export(export, found)


def _store(results: Path, seeds: str, workers: int) -> None:
    """Compute and store the bounds of the boards of stored rows."""
    from gripbench.bench.bounds.stored import store_bounds
    from gripbench.bench.catalogue.scenarios import find_scenario
    from gripbench.bench.commands.rank import stored_rows
    from gripbench.bench.publishing.leaderboard import usual_targets
    from gripbench.bench.ranking.against_bound import wanted_bounds
    from gripbench.bench.running.api import seeds_of

    rows = stored_rows(results)
    chosen = wanted_bounds(rows, usual_targets(rows), seeds_of(seeds))
    wanted = {name: (find_scenario(name), *each) for name, each in chosen.items()}
    began = time.perf_counter()
    done = store_bounds(results, wanted, workers, typer.echo)
    typer.echo(
        f"{results / 'bounds'}: bounds of {done} runs computed in "
        f"{time.perf_counter() - began:.0f} s"
    )


def _export(path: Path, found: dict[str, list[Bound]]) -> None:
    from gripbench.bench.publishing.bound_table import bound_frame
    from gripbench.bench.publishing.figures.bound_plot import bound_plot
    from gripbench.bench.publishing.figures.style import style
    from gripbench.writing import being_written, write_atomically

    if path.suffix == ".csv":
        write_atomically(path, bound_frame(found).to_csv(index=False, float_format="%.6g"))
        return
    first = next(iter(found.values()))[0]
    same = {
        name: one
        for name, several in found.items()
        for one in several
        if (one.scenario, one.seed, one.target) == (first.scenario, first.seed, first.target)
    }
    with style(), being_written(path) as temporary:
        bound_plot(list(same.values()), list(same)).savefig(temporary)
