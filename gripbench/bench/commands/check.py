"""`gripbench check` and `gripbench new method`: for the author of a method."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command("check")(check)
    group = typer.Typer(no_args_is_help=True, help="Write a file to start from.")
    group.callback()(_new)
    group.command("method")(new_method)
    app.add_typer(group, name="new")


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
) -> None:
    """Check a method against everything that the benchmark expects of one."""
    from rich.table import Table

    from gripbench.bench.catalogue.check import check_estimator, failures
    from gripbench.bench.publishing.presentation import console

    results = check_estimator(method, scenario or (), checks=only or ())
    table = Table("check", "result")
    for name, text in results.items():
        table.add_row(name, text)
    console().print(table)
    failed = failures(results)
    console().print(f"{len(results) - len(failed)} of {len(results)} checks without failure")
    if failed:
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
    from gripbench.bench.publishing.presentation import console

    method, test = write_method(name, folder, compiled)
    class_name = "".join(part.capitalize() for part in name.split("_"))
    out = console()
    out.print(f"wrote {method} and {test}; next:", soft_wrap=True)
    out.print(f"  gripbench check {method}:{class_name}", soft_wrap=True)
    out.print(
        f"  gripbench run --suite longitudinal --seeds 20 --method {method}:{class_name}",
        soft_wrap=True,
    )
