"""A paper run again: in, its file and our figures; out, tables, closing lines and what changed.

Every paper is a folder of this package whose module `reproduction` has `load()`, which reads and
checks the paper's file, and `reproduce(progress)`, which returns a `Reproduction`: that is printed
and written the same way for each. A package adds such a module through the group
`gripbench.papers`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from gripbench.bench.papers.claims import (
    Claim,
    OwnFigure,
    Paper,
    changed_verdicts,
    counts,
    judge,
    paper_files,
)
from gripbench.bench.publishing.columns import Column, Table
from gripbench.configuration import Configuration
from gripbench.errors import unknown
from gripbench.extensions import entry_points, load

Progress = Callable[[int, int], None]
"""Called with the parts done and their number."""


@dataclass(frozen=True)
class Reproduction:
    """What running a paper again gave.

    Attributes
    ----------
    tables
        Tables by the name of their file.
    lines
        Closing lines, plain text.
    changed
        One line for each figure that has left what the paper's file expects.
    configuration, seeds
        What the manifest holds: what it was made from, and the seeds of each scenario.
    claims, figures
        The claims with their verdicts and the figures of our own, of a paper of claims.
    """

    tables: dict[str, Table]
    lines: list[str]
    changed: list[str]
    configuration: dict[str, Any]
    seeds: dict[str, list[int]] = field(default_factory=dict)
    claims: tuple[Claim, ...] = ()
    figures: tuple[OwnFigure, ...] = ()


class Runnable(Protocol):
    """The module `reproduction` of a paper."""

    def load(self) -> Configuration:
        """Return the paper's file; a mistake in it is an InputError."""
        ...

    def reproduce(self, progress: Progress | None = None) -> Reproduction:
        """Run the paper again."""
        ...


def reproduction_of(paper: str) -> Runnable:
    """Return the module that runs a paper again.

    Raises
    ------
    InputError
        If there is no such paper.
    """
    files, points = paper_files(), entry_points("gripbench.papers")
    if paper in points and paper not in files:
        plugged: Runnable = load(points[paper])
        return plugged
    if paper not in files:
        raise unknown("paper", paper, (*files, *points))
    module: Runnable = importlib.import_module(f"gripbench.bench.papers.{paper}.reproduction")
    return module


def of_claims(paper: Paper, figures: Mapping[str, float]) -> Reproduction:
    """Return a paper of claims with our figures, see `claims.judge`."""
    claims, own = judge(paper, figures)
    tables = {"claims": _claims_table(paper, claims)}
    lines = counts(claims)
    if own:
        tables["figures_of_our_own"] = _figures_table(paper, own)
        lines.append(f"{len(own)} figures of our own, which no claim of the paper stands behind.")
    return Reproduction(
        tables,
        lines,
        changed_verdicts(paper, claims),
        {"paper": paper.model_dump(mode="json")},
        claims=tuple(claims),
        figures=tuple(own),
    )


def _claims_table(paper: Paper, claims: list[Claim]) -> Table:
    rows = tuple(
        {
            "quantity": claim.quantity,
            "behind": claim.behind,
            "unit": claim.unit,
            "published": claim.published,
            "ours": claim.ours,
            "tolerance": _range(claim),
            "verdict": claim.verdict,
            "reason": "; ".join(filter(None, (_quoted(claim.sentence), claim.reason))),
        }
        for claim in claims
    )
    return Table(
        columns=(
            Column("quantity", "Claim"),
            Column("behind", "Behind it"),
            Column("unit", "Unit"),
            Column("published", "Published", "", ".4g"),
            Column("ours", "Ours", "", ".4g"),
            Column("tolerance", "Accepted"),
            Column("verdict", "Verdict"),
            Column("reason", "Words and reason"),
        ),
        rows=rows,
        caption=f"Claims of {paper.name} beside our figures",
    )


def _figures_table(paper: Paper, figures: list[OwnFigure]) -> Table:
    return Table(
        columns=(
            Column("quantity", "Figure"),
            Column("unit", "Unit"),
            Column("value", "Ours", "", ".4g"),
            Column("note", "Note"),
        ),
        rows=tuple(
            {"quantity": f.quantity, "unit": f.unit, "value": f.value, "note": f.note}
            for f in figures
        ),
        caption=f"Figures of our own beside {paper.name}: no verdict, tests hold them",
    )


def _quoted(words: str) -> str:
    return f"'{words}'" if words else ""


def _range(claim: Claim) -> str:
    low, high = claim.tolerance_low, claim.tolerance_high
    if low is None and high is None:
        return ""
    if low is None:
        return f"up to {high:g}"
    if high is None:
        return f"from {low:g}"
    return f"{low:g} to {high:g}"
