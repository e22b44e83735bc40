"""`gripbench sensitivity`: one cause at a time, and the error at which a baseline overtakes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from gripbench.bench.commands import RANK
from gripbench.writing import DEFAULT_RESULTS


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("sensitivity", rich_help_panel=RANK)(sensitivity)


def sensitivity(
    method: Annotated[
        list[str] | None,
        typer.Argument(help="NAME[:VARIANT] or FILE.py:CLASS; none: all of the suite."),
    ] = None,
    target: Annotated[
        str, typer.Option(help="Signal, such as mu_front; by default the method's.")
    ] = "",
    scenario: Annotated[
        list[str] | None, typer.Option(help="A scenario's name or TOML file; repeat for more.")
    ] = None,
    suite: Annotated[
        str, typer.Option(help="A suite; by default the one that fits the target.")
    ] = "",
    cause: Annotated[
        list[str] | None,
        typer.Option(help="Only this cause, such as paper.wheel_radius; repeat for more."),
    ] = None,
    seeds: Annotated[str, typer.Option(help="N for seeds 0 to N-1, or A:B for A to B-1.")] = "1",
    workers: Annotated[int, typer.Option(min=0, help="Processes; 0: one a core.")] = 0,
    format_: Annotated[
        str, typer.Option("--format", help="terminal, text, markdown, csv, latex or html.")
    ] = "terminal",
    export: Annotated[Path | None, typer.Option(help="Also write all figures as CSV.")] = None,
    results: Annotated[Path, typer.Option(help="Folder of results.")] = DEFAULT_RESULTS,
) -> None:
    """Let one cause at a time leave its value on paper: RMS at its ends, and breaking points."""
    from gripbench.bench.catalogue.registry import choose_method
    from gripbench.bench.catalogue.scenarios import find_scenario
    from gripbench.bench.catalogue.suites import load_suite
    from gripbench.bench.publishing import sensitivity_tables as tables
    from gripbench.bench.publishing.figures.breaking import breaking_map
    from gripbench.bench.publishing.figures.style import save, style
    from gripbench.bench.publishing.figures.tornado import tornado
    from gripbench.bench.publishing.tables import show
    from gripbench.bench.publishing.terminal import console
    from gripbench.bench.ranking import sensitivity as study
    from gripbench.bench.running.api import seeds_of
    from gripbench.bench.running.fitting import fitted
    from gripbench.bench.running.isolation.limits import Limits
    from gripbench.errors import InputError
    from gripbench.writing import check_writable, write_atomically

    specs = [choose_method(name) for name in method or []]
    target = target or _target_of(specs)
    chosen = load_suite(suite or _suite_of(target)) if suite or not scenario else None
    names = scenario or list(chosen.scenarios if chosen else ())
    scenarios = [find_scenario(name) for name in names]
    if not specs:
        specs = study.usual_methods(scenarios, suite or _suite_of(target), target)
    for spec in specs:
        if target not in spec.declaration.estimates:
            raise InputError(f"{spec.label} does not estimate '{target}'")
    if not specs:
        raise InputError(f"no method of the suite estimates '{target}'")
    if export is not None:
        check_writable(export)
    ranges = study.ranges_of(scenarios, specs, cause or ())
    specs = [fitted(spec, results, Limits()) for spec in specs]
    frame = study.sensitivity(scenarios, specs, target, ranges, seeds_of(seeds), workers)
    out = console()

    def written(figure: Any, name: str) -> None:
        stem = f"sensitivity_{name}".replace(":", "_")
        paths = save(figure, results / "plots", stem)
        out.print("Written: " + ", ".join(map(str, paths)), markup=False)

    ran = []
    for spec in specs:
        table = study.summary_of(frame, spec.label)
        if table["nominal"].isna().all():
            out.print(f"{spec.label}: cannot run in these scenarios", markup=False)
            continue
        if not spec.declaration.baseline:
            ran.append(spec.label)
        if method:
            show(tables.tornado_table(table, spec.label, target), format_)
            with style():
                written(tornado(table, spec.label, target), f"{spec.label}_{target}")
    radius = tables.radius_table(frame, ran, target)
    if radius.rows:
        show(radius, format_)
    if len(ran) > 1:
        shares = study.breaking_table(frame).loc[ran]
        show(tables.cause_table(shares, target), format_)
        show(tables.worst_table(frame, ran, target), format_)
        if (shares > 0.0).any(axis=None):
            with style():
                written(breaking_map(shares, target), target)
    if export is not None:
        write_atomically(export, frame.to_csv(index=False, float_format="%.6g"))


def _target_of(specs: list[Any]) -> str:
    preferred = ("mu_front", "mu", "sideslip", "force_x_front")
    if not specs:
        return preferred[0]
    given = specs[0].declaration.estimates
    return next((name for name in preferred if name in given), given[0])


def _suite_of(target: str) -> str:
    straight = target.endswith(("_front", "_rear")) and target.startswith(("mu_", "force_x_"))
    return "longitudinal" if straight else "lateral"
