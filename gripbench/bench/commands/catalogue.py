"""`gripbench list`, `gripbench show` and `gripbench methods table`: what there is."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from enum import StrEnum
from typing import Annotated

import typer

from gripbench.bench.commands import RUN


class Kind(StrEnum):
    """What can be listed."""

    SCENARIOS = "scenarios"
    METHODS = "methods"
    VEHICLES = "vehicles"
    SIGNALS = "signals"
    SUITES = "suites"
    ENVIRONMENTS = "environments"
    POPULATIONS = "populations"
    CAUSES = "causes"
    INSTRUMENTS = "instruments"
    EQUATIONS = "equations"


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command("list", rich_help_panel=RUN)(list_kind)
    app.command("show", rich_help_panel=RUN)(show)
    group = typer.Typer(no_args_is_help=True, help="Compare methods.")
    group.command("table")(methods_table)
    group.callback()(_methods)
    app.add_typer(group, name="methods", rich_help_panel=RUN)


def _methods() -> None:
    """Compare methods."""


def list_kind(kind: Annotated[Kind, typer.Argument(help="What to list.")]) -> None:
    """List scenarios, methods, vehicles, populations, causes, instruments..."""
    if kind is Kind.EQUATIONS:
        from gripbench.bench.publishing.equation_pages import equation_lines

        _print(*equation_lines())
        return
    from gripbench.bench.catalogue.listing import listing

    _print(*listing(kind.value))


def show(
    name: Annotated[str, typer.Argument(help="A scenario, method, vehicle, suite...")],
) -> None:
    """Show the full settings of whatever has this name, as JSON."""
    from gripbench.bench.catalogue.showing import settings
    from gripbench.bench.publishing.terminal import console

    console().print_json(json.dumps(settings(name)))


def methods_table(
    target: Annotated[str, typer.Option(help="Only methods that estimate this signal.")] = "",
    everything: Annotated[
        bool, typer.Option("--all", help="All methods, not only those of Li, Du & Li (2014).")
    ] = False,
) -> None:
    """Print which sensors each method needs: Table I of Li, Du & Li (2014), from the code."""
    from gripbench.bench.catalogue.listing import sensor_needs

    _print(*sensor_needs(target, everything))


def _print(header: Sequence[str], lines: Iterable[Sequence[str]]) -> None:
    """Print a table, and below it what its mark means where it has one."""
    from gripbench.bench.publishing.columns import Table
    from gripbench.bench.publishing.tables import show
    from gripbench.bench.publishing.terminal import console
    from gripbench.bench.ranking.marks import FOOTNOTE, MARK

    found = list(lines)
    show(Table.of_texts(header, found))
    if any(MARK in text for line in found for text in line):
        console().print(FOOTNOTE)
