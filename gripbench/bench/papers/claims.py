"""What a paper claims, beside what gripbench obtains, and the verdict on each claim.

A paper's file in `configs/papers` gives every claim with its source, its unit and the range in
which our figure counts as reproduced; a claim that no simulation can be held against says why.
The same file names the seeds on which methods were tuned and those on which they are tested.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator

from gripbench.configuration import CONFIGS, Configuration, parse, read_toml
from gripbench.errors import InputError, unknown

Verdict = Literal["reproduced", "not reproduced", "not comparable"]


@dataclass(frozen=True)
class Claim:
    """One claim with our figure.

    Attributes
    ----------
    paper
        Name of the paper.
    item
        Unique name of the claim within the paper.
    quantity
        What is claimed, and where in the paper.
    unit
        Unit of all figures.
    published
        The paper's figure; None where the claim is made in words or only drawn.
    ours
        Our figure; None where none can be had.
    tolerance_low, tolerance_high
        Range in which `ours` counts as reproduced; None: open.
    verdict
        `reproduced`, `not reproduced` or `not comparable`.
    reason
        Why the range is what it is, why the claim is not comparable, or what was found.
    """

    paper: str
    item: str
    quantity: str
    unit: str
    published: float | None
    ours: float | None
    tolerance_low: float | None
    tolerance_high: float | None
    verdict: Verdict
    reason: str


class PublishedClaim(Configuration):
    """A claim as the paper's file gives it; attributes as those of `Claim`.

    `verdict` is what was found when the file was written, so that a change is noticed. A claim
    that is not comparable needs a reason, the others at least one end of the tolerance.
    """

    item: str = Field(min_length=1)
    quantity: str = Field(min_length=1)
    unit: str
    published: float | None = None
    tolerance_low: float | None = None
    tolerance_high: float | None = None
    verdict: Verdict = "reproduced"
    reason: str = ""

    @model_validator(mode="after")
    def _check_range(self) -> Self:
        low, high = self.tolerance_low, self.tolerance_high
        comparable = self.verdict != "not comparable"
        if comparable and low is None and high is None:
            raise ValueError(f"claim '{self.item}' has neither tolerance_low nor tolerance_high")
        if low is not None and high is not None and low > high:
            raise ValueError(f"claim '{self.item}': tolerance_low is above tolerance_high")
        if self.verdict != "reproduced" and not self.reason:
            raise ValueError(f"claim '{self.item}' is {self.verdict} but gives no reason")
        return self


class Seeds(Configuration):
    """Seeds of a paper's runs; what tuned a method never tests it."""

    tuning_first: int = Field(ge=0)
    tuning_count: int = Field(ge=1)
    test_first: int = Field(ge=0)
    test_count: int = Field(ge=1)

    @model_validator(mode="after")
    def _check_disjoint(self) -> Self:
        shared = set(self.tuning) & set(self.test)
        if shared:
            raise ValueError(f"seed {min(shared)} is among the tuning and the test seeds")
        return self

    @property
    def tuning(self) -> range:
        """Seeds on which the methods' parameters were chosen."""
        return range(self.tuning_first, self.tuning_first + self.tuning_count)

    @property
    def test(self) -> range:
        """Seeds of the published comparison."""
        return range(self.test_first, self.test_first + self.test_count)


class Paper(Configuration):
    """A paper: what it is, its seeds and its claims."""

    name: str
    title: str
    reference: str
    seeds: Seeds
    claims: list[PublishedClaim] = Field(min_length=1)

    @model_validator(mode="after")
    def _check_unique(self) -> Self:
        items = [claim.item for claim in self.claims]
        twice = {item for item in items if items.count(item) > 1}
        if twice:
            raise ValueError(f"claim '{min(twice)}' is given twice")
        return self


def paper_files() -> dict[str, Path]:
    """Return the files of the papers that ship with gripbench, by name."""
    return {path.stem: path for path in sorted((CONFIGS / "papers").glob("*.toml"))}


def load_paper(name: str) -> Paper:
    """Return a paper by name.

    Raises
    ------
    InputError
        If there is no such paper or its file has a mistake.
    """
    files = paper_files()
    if name not in files:
        raise unknown("paper", name, files)
    return parse(Paper, read_toml(files[name]), files[name])


def judge(paper: Paper, figures: Mapping[str, float]) -> list[Claim]:
    """Set our figures beside the paper's claims.

    Parameters
    ----------
    paper
        The paper.
    figures
        Our figure by the claim's item, in the claim's unit. A claim that is not comparable may
        lack one.

    Raises
    ------
    InputError
        If a comparable claim has no figure, or a figure has no claim.
    """
    known = {claim.item for claim in paper.claims}
    for item in figures:
        if item not in known:
            raise unknown(f"claim of {paper.name}", item, known)
    claims = []
    for claim in paper.claims:
        ours = figures.get(claim.item)
        if ours is None and claim.verdict != "not comparable":
            raise InputError(f"{paper.name}: no figure for the claim '{claim.item}'")
        claims.append(
            Claim(
                paper=paper.name,
                item=claim.item,
                quantity=claim.quantity,
                unit=claim.unit,
                published=claim.published,
                ours=None if ours is None else float(ours),
                tolerance_low=claim.tolerance_low,
                tolerance_high=claim.tolerance_high,
                verdict=_verdict(claim, ours),
                reason=claim.reason,
            )
        )
    return claims


def _verdict(claim: PublishedClaim, ours: float | None) -> Verdict:
    if claim.verdict == "not comparable" or ours is None:
        return "not comparable"
    low = -float("inf") if claim.tolerance_low is None else claim.tolerance_low
    high = float("inf") if claim.tolerance_high is None else claim.tolerance_high
    return "reproduced" if isfinite(ours) and low <= ours <= high else "not reproduced"


def changed_verdicts(paper: Paper, claims: Sequence[Claim]) -> list[str]:
    """Return one line for each claim whose verdict is no longer the one in the paper's file."""
    found = {claim.item: claim.verdict for claim in claims}
    return [
        f"{paper.name}, {claim.item}: was {claim.verdict}, is {found[claim.item]}"
        for claim in paper.claims
        if claim.item in found and found[claim.item] != claim.verdict
    ]
