"""`gripbench sensitivity`: one cause at a time, and the error at which a baseline overtakes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gripbench.bench.running.store import DEFAULT_RESULTS

if TYPE_CHECKING:
    import pandas as pd


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("sensitivity")(sensitivity)


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
    export: Annotated[Path | None, typer.Option(help="Also write all figures as CSV.")] = None,
    results: Annotated[Path, typer.Option(help="Folder of results.")] = DEFAULT_RESULTS,
) -> None:
    """Let one cause at a time leave its value on paper: RMS at its ends, and breaking points."""
    from gripbench.bench.catalogue.registry import choose_method
    from gripbench.bench.catalogue.scenarios import find_scenario
    from gripbench.bench.catalogue.suites import load_suite
    from gripbench.bench.publishing.figures.style import save, style
    from gripbench.bench.publishing.figures.tornado import tornado
    from gripbench.bench.publishing.presentation import console
    from gripbench.bench.ranking import sensitivity as study
    from gripbench.bench.running.api import seeds_of
    from gripbench.errors import InputError
    from gripbench.writing import check_writable, write_atomically

    specs = [choose_method(name) for name in method or []]
    target = target or _target_of(specs)
    chosen = load_suite(suite or _suite_of(target)) if suite or not scenario else None
    names = scenario or list(chosen.scenarios if chosen else ())
    if not specs:
        suite_specs = load_suite(suite or _suite_of(target)).specs()
        specs = [spec for spec in suite_specs if target in spec.declaration.estimates]
    for spec in specs:
        if target not in spec.declaration.estimates:
            raise InputError(f"{spec.label} does not estimate '{target}'")
    if not specs:
        raise InputError(f"no method of the suite estimates '{target}'")
    if export is not None:
        check_writable(export)
    scenarios = [find_scenario(name) for name in names]
    ranges = study.ranges_of(scenarios, specs, cause or ())
    frame = study.sensitivity(scenarios, specs, target, ranges, seeds_of(seeds), workers)
    out = console()
    for spec in specs:
        table = study.summary_of(frame, spec.label)
        if table["nominal"].isna().all():
            out.print(f"{spec.label}: cannot run in these scenarios", markup=False)
            continue
        if method:
            out.print(_tornado_table(table, spec.label, target))
            with style():
                name = f"sensitivity_{spec.label}_{target}".replace(":", "_")
                paths = save(tornado(table, spec.label, target), results / "plots", name)
            out.print("Written: " + ", ".join(map(str, paths)), markup=False)
        _print_radius(out, frame, spec.label, target)
    if len(specs) > 1:
        out.print(_breaking(study.breaking_table(frame), target))
        out.print(_worst(study, frame, [spec.label for spec in specs], target))
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


def _tornado_table(table: pd.DataFrame, label: str, target: str):  # type: ignore[no-untyped-def]
    from rich.markup import escape
    from rich.table import Table

    from gripbench.bench.publishing.presentation import significant
    from gripbench.envs.signals import signal

    factor, unit = signal(target).display_factor, signal(target).display_unit
    first = table.iloc[0]
    shown = Table(
        "cause", "low", "RMS", "high", "RMS", "breaks at",
        title=escape(
            f"{label}, {target} [{unit}]: RMS {significant(factor * first['nominal'])} without "
            f"error, best baseline {first['baseline'] or 'none'} "
            f"{significant(factor * first['rms_baseline'])}"
        ),
    )  # fmt: skip
    for _, line in table.iterrows():
        broken = [
            line[side] for side in ("breaking_low", "breaking_high") if line[side] == line[side]
        ]
        shown.add_row(
            line["cause"],
            amount(line["low"], line["unit"]),
            significant(factor * line["rms_low"]),
            amount(line["high"], line["unit"]),
            significant(factor * line["rms_high"]),
            ", ".join(amount(one, line["unit"]) for one in dict.fromkeys(broken)) or "-",
        )
    return shown


def amount(value: float, unit: str) -> str:
    """Return a deviation with its unit; a relative one in percent.

    Examples
    --------
    >>> amount(-0.002, "relative"), amount(1.5, "mm")
    ('-0.2 %', '+1.5 mm')
    """
    if unit == "relative":
        return f"{100.0 * value:+.3g} %"
    return f"{value:+.3g} {'' if unit == '-' else unit}".strip()


def _print_radius(out, frame: pd.DataFrame, label: str, target: str) -> None:  # type: ignore[no-untyped-def]
    """Print what the wheel radius costs that is wrong on paper by a fifth of a percent."""
    from gripbench.bench.publishing.presentation import significant
    from gripbench.bench.ranking.sensitivity import PAPER, RADIUS_CASE, summary_of
    from gripbench.envs.signals import signal

    part = frame[(frame["label"] == label) & (frame["cause"] == PAPER + "wheel_radius")]
    if part.empty or part["rms"].isna().all():
        return
    factor = signal(target).display_factor
    rms = {
        size: factor * float(part.loc[(part["deviation"] - size).abs() < 1e-9, "rms"].iloc[0])
        for size in (-RADIUS_CASE, 0.0, RADIUS_CASE)
    }
    table = summary_of(frame, label).set_index("cause")
    line = table.loc[PAPER + "wheel_radius"]
    out.print(
        f"{label}: wheel radius on paper -0.2, 0, +0.2 % off: RMS "
        f"{', '.join(significant(one) for one in rms.values())}; best baseline "
        f"{significant(factor * float(str(line['rms_baseline'])))} ({line['baseline'] or 'none'})",
        markup=False,
    )


def _breaking(table: pd.DataFrame, target: str):  # type: ignore[no-untyped-def]
    """Return the table method x cause: the six causes that break most methods first."""
    from rich.markup import escape
    from rich.table import Table

    ahead = table[(table > 0.0).any(axis=1)]
    worst = ahead.clip(upper=10.0).mean().sort_values(kind="stable").index[:6]
    shown = Table(
        "method", *worst,
        title=escape(f"{target}: breaking point over the range of the cause; -: beyond 4"),
    )  # fmt: skip
    for label, line in table[worst].iterrows():
        behind = not (table.loc[str(label)] > 0.0).any()
        cells = ["-" if not one < 1e9 else f"{one:.2f}" for one in line]
        shown.add_row(str(label), *(["behind"] * len(worst) if behind else cells))
    return shown


def _worst(study: Any, frame: pd.DataFrame, labels: list[str], target: str):  # type: ignore[no-untyped-def]
    """Return the table of each method's three causes that break it first."""
    from rich.table import Table

    shown = Table("method", "first", "second", "third", title=f"{target}: what breaks each first")
    shares = study.breaking_table(frame)
    for label in labels:
        table = study.summary_of(frame, label).set_index("cause")
        if table["nominal"].isna().all():
            continue
        order = shares.loc[label].sort_values(kind="stable")
        if not (order > 0.0).any():
            shown.add_row(label, "behind the best baseline without any error", "", "")
            continue
        cells = []
        for cause in order[order < math.inf].index[:3]:
            line = table.loc[cause]
            ends = [line[side] for side in ("breaking_low", "breaking_high")]
            nearest = min((one for one in ends if one == one), key=abs)
            cells.append(f"{cause} {amount(nearest, line['unit'])}")
        shown.add_row(label, *(cells + ["-"] * 3)[:3])
    return shown
