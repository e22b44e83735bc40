"""`gripbench run`: methods x scenarios x seeds, with a table of what came of it."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from gripbench.bench.commands import RUN
from gripbench.writing import DEFAULT_RESULTS

MOST_LINES = 40
"""Lines of methods and faults up to which `--faults` prints each of them."""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("run", cls=_WithFaults, rich_help_panel=RUN)(run)


class _WithFaults(TyperCommand):
    """A command whose option `--faults` may stand without a value."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Give `--faults` the value `all` where none follows it."""
        filled: list[str] = []
        for word, following in pairwise([*args, "-"]):
            filled.append(word)
            if word == "--faults" and following.startswith("-"):
                filled.append("all")
        return super().parse_args(ctx, filled)


def run(
    suite: Annotated[str, typer.Option(help="A suite's name or TOML file.")] = "",
    scenario: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="A scenario's name or TOML file; repeat for more."),
    ] = None,
    recording: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="A published recording's name, or the folder of an imported one; its windows are "
            "the seeds. Repeat for more.",
        ),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ONE",
            help=r"NAME[:VARIANT]\[@PARAMETER=NUMBER,...] or FILE.py:CLASS with the same settings; "
            "repeat for more. With a suite they come on top of its methods; without a suite and "
            "methods, all built-in ones run that fit.",
        ),
    ] = None,
    level: Annotated[
        int | None,
        typer.Option(
            help="Spread of cars, roads, drives and instruments: 0 none, 1 production, 2 wide; by "
            "default the suite's."
        ),
    ] = None,
    faults: Annotated[
        str,
        typer.Option(
            help="Also run with faults of the instruments: NAME:SEVERITY[:CHANNEL],..., a NAME for "
            "all five severities; without a value every fault at severities 1, 3 and 5."
        ),
    ] = "",
    seeds: Annotated[
        str,
        typer.Option(
            help="N for seeds 0 to N-1, or A:B for A to B-1; by default the suite's, else 1, and "
            "all windows of a recording."
        ),
    ] = "",
    workers: Annotated[int, typer.Option(min=0, help="Processes; 0: one a core.")] = 0,
    backend: Annotated[str, typer.Option(help="loky, dask or ray.")] = "loky",
    scheduler: Annotated[str, typer.Option(help="Address of a cluster's scheduler.")] = "",
    fresh: Annotated[bool, typer.Option("--fresh", help="Run again what is stored.")] = False,
    time_limit: Annotated[
        float, typer.Option(help="Seconds that one cell of a method of yours may take.")
    ] = 60.0,
    sandbox: Annotated[
        str,
        typer.Option(
            envvar="GRIPBENCH_SANDBOX",
            help="bubblewrap: methods that are not built in also have no network and cannot write.",
        ),
    ] = "",
    memory_limit: Annotated[
        float, typer.Option(help="MiB that a method of yours may take.")
    ] = 2048.0,
    show_output: Annotated[
        bool,
        typer.Option("--show-output", help="Show on standard error what a method of yours prints."),
    ] = False,
    results: Annotated[Path, typer.Option(help="Folder of the stored rows.")] = DEFAULT_RESULTS,
    export: Annotated[
        Path | None, typer.Option(help="Also write the scores, without runtimes, as CSV.")
    ] = None,
) -> None:
    """Run methods on scenarios and print their RMS errors; what is stored is not run again."""
    from gripbench.bench.catalogue.suites import load_suite
    from gripbench.bench.publishing.degradation_table import degradation_tables, every_line
    from gripbench.bench.publishing.presentation import print_failures, print_summary
    from gripbench.bench.publishing.tables import show
    from gripbench.bench.publishing.terminal import console, progress
    from gripbench.bench.ranking.degradation import degradation, without_faults
    from gripbench.bench.ranking.log_windows import scored_windows
    from gripbench.bench.ranking.summary import scores_csv, summary
    from gripbench.bench.running.api import limits_of, order_in, plan_of
    from gripbench.bench.running.backends import Backend
    from gripbench.bench.running.fault_plans import with_fault_scenarios
    from gripbench.bench.running.isolation.processes import choose_sandbox
    from gripbench.bench.running.recorded_scenarios import PREFIX
    from gripbench.bench.running.rows import Row, frame_of, untracked
    from gripbench.bench.running.runner import InterruptedRun, run_plan
    from gripbench.bench.running.store import Store
    from gripbench.errors import InterruptionError
    from gripbench.writing import check_writable, write_atomically

    choose_sandbox(sandbox)
    if export is not None:
        check_writable(export)
    chosen = [*(scenario or []), *(f"{PREFIX}{place}" for place in recording or [])]
    plan = plan_of(suite, chosen, method or [], seeds or None, level)
    if faults:
        plan = with_fault_scenarios(plan, faults)
    targets = load_suite(suite).targets if suite else ()
    rows: list[Row] = []
    with progress("running", plan.size) as bar:
        task = bar.task_ids[0]

        def on_row(row: Row) -> None:
            rows.append(row)
            bar.advance(task)

        try:
            report = run_plan(
                plan,
                Store(results),
                Backend(backend, workers, scheduler),
                limits_of(time_limit, memory_limit, show_output),
                fresh,
                on_row,
            )
        except InterruptedRun as error:
            raise InterruptionError(str(error)) from None
    frame = frame_of(sorted(rows, key=order_in(plan)))
    shown = frame[frame["target"].isin([*targets, ""])] if targets else frame
    print_summary(summary(without_faults(shown)))
    for log, text in scored_windows(frame).items():
        console().print(f"scored of {log}: {text}", soft_wrap=True)
    if faults:
        damage = degradation(shown)
        for table in degradation_tables(damage):
            show(table)
        for name, part in damage.groupby("target", sort=False):
            if len(part) <= MOST_LINES:
                show(every_line(damage, str(name)))
    print_failures(frame)
    for label, words in untracked(rows).items():
        console().print(
            f"{label} reads what cannot be followed ({', '.join(words)}): its rows run again "
            "each time",
            markup=False,
        )
    if export is not None:
        write_atomically(export, scores_csv(frame))
    counts = ", ".join(f"{count} {status}" for status, count in sorted(report.statuses.items()))
    console().print(
        f"{plan.size} cells ({counts}); {report.computed} run, {report.stored} stored already; "
        f"{report.seconds:.1f} s"
    )
