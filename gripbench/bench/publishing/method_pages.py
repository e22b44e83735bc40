"""The catalogue of methods as a page: what each is, needs and estimates, and where it fails."""

from __future__ import annotations

import inspect
import math
import sys
from collections.abc import Mapping
from pathlib import Path

from gripbench.bench.catalogue.registry import built_in_methods
from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.publishing.leaderboard import Leaderboard, read
from gripbench.bench.publishing.presentation import significant
from gripbench.bench.publishing.tables import markdown
from gripbench.bench.ranking.marks import FOOTNOTE, MARK
from gripbench.bench.scoring.metric import pooled_rms
from gripbench.envs.signals import signal
from gripbench.methods.contract import CompiledMethod, Parameter

FAILS = 3.0
"""A method fails in a scenario where its RMS is this many times that of the scenario's best."""

SHOWN = 6
"""Number of scenarios that the page names for a method, the worst."""


def catalogue_page(results: Path) -> str:
    """Return the catalogue as Markdown.

    Parameters
    ----------
    results
        Folder with the published `leaderboard.json`, from which it is told where a method fails;
        without one the page says so.
    """
    published = read(results) if (results / "leaderboard.json").is_file() else None
    methods = built_in_methods()
    parts = [
        "# Methods\n",
        "Every method that ships with gripbench, from its own declaration. "
        f"{MARK} marks a channel that is idealised: no sensor in a vehicle gives it.\n",
        markdown(_overview(methods)),
    ]
    if published is None:
        parts.append("Where methods fail is not shown: no results are published.\n")
    for method in methods.values():
        parts.append(_entry(method, published))
    return "\n".join(parts)


def failures_of(name: str, published: Leaderboard) -> list[str]:
    """Return a sentence for each target and scenario in which a method fails, the worst first.

    It fails where some runs gave no result, or where its RMS is `FAILS` times the lowest that a
    method without idealised channels has there. At most `SHOWN` of the latter are named.
    """
    idealised = {
        line["label"]
        for board in published.boards
        for line in board["methods"]
        if line["idealised"]
    }
    best: dict[tuple[str, str], float] = {}
    for run in published.runs:
        value = pooled_rms(run.sums_of_squares, run.counts)
        if run.label not in idealised and math.isfinite(value):
            key = (run.target, run.scenario)
            best[key] = min(value, best.get(key, math.inf))
    broken, worse = [], []
    for run in published.runs:
        if run.label != name:
            continue
        where = f"`{run.target}` in {run.scenario}"
        failed = [text for text in run.failed.values() if not text.startswith("skipped")]
        if failed:
            total = len(run.seeds) + len(failed)
            broken.append(f"{where}: {len(failed)} of {total} runs failed ({failed[0]})")
            continue
        value = pooled_rms(run.sums_of_squares, run.counts)
        lowest = best.get((run.target, run.scenario), math.nan)
        if lowest > 0.0 and value >= FAILS * lowest:
            ratio = value / lowest
            text = f"RMS {significant(value)}, {significant(ratio, 2)} times the best"
            worse.append((ratio, f"{where}: {text}"))
    worse.sort(reverse=True)
    return broken + [text for _, text in worse[:SHOWN]]


def _overview(methods: Mapping[str, type[CompiledMethod]]) -> Table:
    rows = []
    for name, method in methods.items():
        rows.append(
            {
                "method": name,
                "title": method.title,
                "estimates": ", ".join(method.estimates[:3])
                + (f" and {len(method.estimates) - 3} more" if len(method.estimates) > 3 else ""),
                "sensors": str(len(method().sensors)),
            }
        )
    columns = (
        Column("method", "Method"),
        Column("title", "Title"),
        Column("estimates", "Estimates"),
        Column("sensors", "Channels"),
    )
    return Table(columns, tuple(rows))


def _stated(method: type[CompiledMethod], name: str) -> str:
    """Return with what a method states the error of an estimate."""
    if name in method.variances:
        return ", with variance"
    return ", with quantiles" if name in method.quantiles else ""


def _entry(method: type[CompiledMethod], published: Leaderboard | None) -> str:
    """Return the section of one method."""
    made = method()
    parts = [f"## {method.title}\n", f"`{method.name}`. {method.reference}.\n".replace("..", ".")]
    words = inspect.getdoc(sys.modules[method.__module__])
    if words:
        parts += ['??? note "Equations and corrections"\n', _indented(words) + "\n"]
    rows = []
    for role, names in (("reads", made.sensors), ("estimates", method.estimates)):
        for name in names:
            item = signal(name)
            mark = MARK if item.idealised else ""
            rows.append(
                {
                    "role": role,
                    "signal": name + mark,
                    "unit": item.unit,
                    "description": item.description
                    + (_stated(method, name) if role == "estimates" else ""),
                }
            )
    columns = (
        Column("role", "Role"), Column("signal", "Signal"), Column("unit", "Unit"),
        Column("description", "Description"),
    )  # fmt: skip
    parts.append(markdown(Table(columns, tuple(rows))))
    if any(signal(name).idealised for name in made.sensors):
        parts.append(FOOTNOTE + ".\n")
    if method.vehicle_parameters:
        on_paper = ", ".join(f"`{name}`" for name in method.vehicle_parameters)
        parts.append(f"Knows of the vehicle: {on_paper}.\n")
    if method.parameters:
        parts.append(markdown(_parameters(method)))
    if method.variants:
        variants = ", ".join(f"`{method.name}:{name}`" for name in method.variants)
        parts.append(f"Variants: {variants}.\n")
    if published is not None:
        lines = failures_of(method.name, published)
        if lines:
            parts.append(
                "Where it is worst, against the best method without idealised channels there:\n"
            )
            parts.append("\n".join(f"- {line}" for line in lines) + "\n")
        elif any(run.label == method.name for run in published.runs):
            parts.append(f"Nowhere in the published suites {FAILS:g} times worse than the best.\n")
    return "\n".join(parts)


def _parameters(method: type[CompiledMethod]) -> Table:
    columns = (
        Column("name", "Parameter"), Column("default", "Default"),
        Column("unit", "Unit"), Column("description", "Description"),
    )  # fmt: skip
    return Table(
        columns, tuple(vars(item) | {"default": _shown(item)} for item in method.parameters)
    )


def _shown(parameter: Parameter) -> str:
    """Return a default as it is read: a switch as yes or no."""
    if parameter.is_switch:
        return "yes" if parameter.default else "no"
    return parameter.default if isinstance(parameter.default, str) else f"{parameter.default:.6g}"


def _indented(text: str) -> str:
    """Return a docstring as the body of a block, its lines as they are written."""
    return "\n".join(
        ["    ```text", *(f"    {line}".rstrip() for line in text.splitlines()), "    ```"]
    )
