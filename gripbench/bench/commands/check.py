"""`gripbench check` and `gripbench new method`: for the author of a method."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gripbench.bench.commands import RUN
from gripbench.writing import DEFAULT_RESULTS


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command("check", rich_help_panel=RUN)(check)
    group = typer.Typer(no_args_is_help=True, help="Write a file to start from.")
    group.callback()(_new)
    group.command("method")(new_method)
    app.add_typer(group, name="new", rich_help_panel=RUN)


def _new() -> None:
    """Write a file to start from."""


def check(
    method: Annotated[str, typer.Argument(help="FILE.py[:CLASS], or the NAME of a method.")],
    scenario: Annotated[
        list[str] | None, typer.Option(help="Only this scenario; repeat for more.")
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option("--check", help="Only this check; repeat for more.")
    ] = None,
    time_limit: Annotated[
        float, typer.Option(help="Seconds that one run of it over one recording may take.")
    ] = 60.0,
    sandbox: Annotated[
        str,
        typer.Option(
            envvar="GRIPBENCH_SANDBOX",
            help="bubblewrap: methods that are not built in also have no network and cannot write.",
        ),
    ] = "",
    memory_limit: Annotated[float, typer.Option(help="MiB that it may take.")] = 2048.0,
    show_output: Annotated[
        bool,
        typer.Option("--show-output", help="Show on standard error what a method of yours prints."),
    ] = False,
    results: Annotated[
        Path, typer.Option(help="Folder of the stored rows, beside which the result is kept.")
    ] = DEFAULT_RESULTS,
) -> None:
    """Check a method against everything that the benchmark expects of one."""
    from gripbench.bench.catalogue.check import check_estimator, failures, tally
    from gripbench.bench.publishing.terminal import console
    from gripbench.bench.running.api import limits_of
    from gripbench.bench.running.check_records import keep_record
    from gripbench.bench.running.isolation.processes import choose_sandbox

    choose_sandbox(sandbox)
    out = console()
    with out.status("") as status:

        def on_result(name: str, text: str | None) -> None:
            if text is None:
                status.update(name)
            else:
                out.print(f"{name:27}{text}", markup=False, highlight=False, soft_wrap=True)

        found = check_estimator(
            method,
            scenario or (),
            checks=only or (),
            limits=limits_of(time_limit, memory_limit, show_output),
            on_result=on_result,
        )
    out.print(tally(found), markup=False, highlight=False)
    if not (scenario or only):
        keep_record(results, method, found)
    if failures(found):
        raise typer.Exit(1)


def new_method(
    name: Annotated[str, typer.Argument(help="Lower case with underscores, such as my_filter.")],
    folder: Annotated[Path, typer.Option(help="Where to write.")] = Path(),
    compiled: Annotated[
        bool, typer.Option("--compiled", help="Start from a compiled step, not a plain class.")
    ] = False,
) -> None:
    """Write a small working method with its test."""
    from gripbench.bench.catalogue.templates import write_method
    from gripbench.bench.publishing.terminal import console

    method, test = write_method(name, folder, compiled)
    class_name = "".join(part.capitalize() for part in name.split("_"))
    out = console()
    out.print(f"wrote {method} and {test}; next:", soft_wrap=True)
    out.print(f"  gripbench check {method}:{class_name}", soft_wrap=True)
    out.print(
        f"  gripbench run --suite longitudinal --seeds 20 --method {method}:{class_name}",
        soft_wrap=True,
    )
