"""What a paper claims, beside what gripbench obtains, and the verdict on each claim.

In: a paper's file in `configs/papers` and our figures by item. Out: claims with verdicts, and the
figures of our own that no claim stands behind.

A claim says what stands behind it: a number that the paper prints, a number read off one of its
figures (with the error of the reading), or a sentence that says something by itself (more, less,
observable). The range in which our figure counts comes from the paper or from the reading, never
from our result. What is only ours is a figure without a verdict; tests hold it.
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

Behind = Literal["printed", "figure", "sentence"]
Verdict = Literal[
    "reproduced", "no worse", "not reproduced", "holds", "does not hold", "not comparable"
]
"""A number is reproduced, no worse (an error at most the published one) or not; a sentence holds or
does not."""


@dataclass(frozen=True)
class Claim:
    """One claim with our figure.

    Attributes
    ----------
    paper
        Name of the paper.
    item
        Unique name of the claim within the paper.
    behind
        What stands behind it: a printed number, a figure's reading, or a sentence.
    quantity
        What is claimed, and where in the paper.
    unit
        Unit of all figures.
    published
        The paper's figure; None where the claim is made in words.
    sentence
        The paper's words, where they are the claim.
    ours
        Our figure; None where none can be had.
    tolerance_low, tolerance_high
        Range of `ours` that the paper or the reading gives; None: open.
    verdict
        See `Verdict`.
    reason
        Why the range is what it is, why the claim is not comparable, or what was found.
    """

    paper: str
    item: str
    behind: Behind
    quantity: str
    unit: str
    published: float | None
    sentence: str
    ours: float | None
    tolerance_low: float | None
    tolerance_high: float | None
    verdict: Verdict
    reason: str


@dataclass(frozen=True)
class OwnFigure:
    """A figure of ours that no claim of the paper stands behind."""

    item: str
    quantity: str
    unit: str
    value: float
    note: str


class PublishedClaim(Configuration):
    """A claim as the paper's file gives it; attributes as those of `Claim`.

    `verdict` is what was found when the file was written, so that a change is noticed; without it
    the claim is met. A number needs `published`, a reading also `reading_error`, a sentence its
    words. A claim that is not comparable or not met needs a reason, a comparable one at least one
    end of the tolerance.
    """

    item: str = Field(min_length=1)
    behind: Behind
    quantity: str = Field(min_length=1)
    unit: str
    published: float | None = None
    reading_error: float | None = Field(default=None, gt=0.0)
    sentence: str = ""
    tolerance_low: float | None = None
    tolerance_high: float | None = None
    verdict: Verdict | None = None
    reason: str = ""

    @property
    def met(self) -> Verdict:
        """The verdict when our figure lies in the range."""
        if self.behind == "sentence":
            return "holds"
        return "no worse" if self.tolerance_low is None else "reproduced"

    @property
    def missed(self) -> Verdict:
        """The verdict when it does not."""
        return "does not hold" if self.behind == "sentence" else "not reproduced"

    @property
    def expected(self) -> Verdict:
        """The verdict that the file expects."""
        return self.verdict or self.met

    @model_validator(mode="after")
    def _check_range(self) -> Self:
        low, high = self.tolerance_low, self.tolerance_high
        name = f"claim '{self.item}'"
        comparable = self.verdict != "not comparable"
        if self.behind == "sentence" and not self.sentence:
            raise ValueError(f"{name} rests on a sentence but does not quote it")
        if self.behind != "sentence" and self.published is None:
            raise ValueError(f"{name} rests on a {self.behind} number but gives none")
        if self.behind == "figure" and self.reading_error is None:
            raise ValueError(f"{name} is read off a figure but gives no reading_error")
        if comparable and low is None and high is None:
            raise ValueError(f"{name} has neither tolerance_low nor tolerance_high")
        if low is not None and high is not None and low > high:
            raise ValueError(f"{name}: tolerance_low is above tolerance_high")
        if self.expected not in (self.met, self.missed, "not comparable"):
            raise ValueError(f"{name}: verdict must be '{self.met}' or '{self.missed}'")
        if self.expected != self.met and not self.reason:
            raise ValueError(f"{name} is {self.verdict} but gives no reason")
        return self


class PublishedFigure(Configuration):
    """A figure of our own as the paper's file names it."""

    item: str = Field(min_length=1)
    quantity: str = Field(min_length=1)
    unit: str
    note: str = ""


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
    """A paper: what it is, its seeds, its claims and the figures of ours beside them."""

    name: str
    title: str
    reference: str
    seeds: Seeds
    claims: list[PublishedClaim] = Field(min_length=1)
    figures: list[PublishedFigure] = []

    @model_validator(mode="after")
    def _check_unique(self) -> Self:
        items = [claim.item for claim in self.claims] + [figure.item for figure in self.figures]
        twice = {item for item in items if items.count(item) > 1}
        if twice:
            raise ValueError(f"'{min(twice)}' is given twice")
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


def judge(paper: Paper, figures: Mapping[str, float]) -> tuple[list[Claim], list[OwnFigure]]:
    """Set our figures beside the paper's claims.

    Parameters
    ----------
    paper
        The paper.
    figures
        Our figure by item, in the item's unit. A claim that is not comparable may lack one.

    Returns
    -------
    The claims with their verdicts, and the figures of our own.

    Raises
    ------
    InputError
        If an item has no figure, or a figure has no item.
    """
    needed = {claim.item: claim.expected != "not comparable" for claim in paper.claims}
    needed |= dict.fromkeys((figure.item for figure in paper.figures), True)
    for item in figures:
        if item not in needed:
            raise unknown(f"item of {paper.name}", item, needed)
    for item, wanted in needed.items():
        if wanted and item not in figures:
            raise InputError(f"{paper.name}: no figure for '{item}'")
    claims = [_judged(paper.name, claim, figures.get(claim.item)) for claim in paper.claims]
    own = [
        OwnFigure(entry.item, entry.quantity, entry.unit, float(figures[entry.item]), entry.note)
        for entry in paper.figures
    ]
    return claims, own


def _judged(paper: str, claim: PublishedClaim, ours: float | None) -> Claim:
    return Claim(
        paper=paper,
        item=claim.item,
        behind=claim.behind,
        quantity=claim.quantity,
        unit=claim.unit,
        published=claim.published,
        sentence=claim.sentence,
        ours=None if ours is None else float(ours),
        tolerance_low=claim.tolerance_low,
        tolerance_high=claim.tolerance_high,
        verdict=_verdict(claim, ours),
        reason=claim.reason,
    )


def _verdict(claim: PublishedClaim, ours: float | None) -> Verdict:
    if claim.verdict == "not comparable" or ours is None:
        return "not comparable"
    low = -float("inf") if claim.tolerance_low is None else claim.tolerance_low
    high = float("inf") if claim.tolerance_high is None else claim.tolerance_high
    return claim.met if isfinite(ours) and low <= ours <= high else claim.missed


def changed_verdicts(paper: Paper, claims: Sequence[Claim]) -> list[str]:
    """Return one line for each claim whose verdict is no longer the one in the paper's file."""
    found = {claim.item: claim.verdict for claim in claims}
    return [
        f"{paper.name}, {claim.item}: was {claim.expected}, is {found[claim.item]}"
        for claim in paper.claims
        if claim.item in found and found[claim.item] != claim.expected
    ]


_KINDS: dict[Behind, str] = {
    "printed": "printed number(s)",
    "figure": "number(s) read off figures",
    "sentence": "sentence(s)",
}


def counts(claims: Sequence[Claim]) -> list[str]:
    """Return one line for each kind of claim: how many, and how many of each verdict."""
    lines = []
    for behind, kind in _KINDS.items():
        verdicts = [claim.verdict for claim in claims if claim.behind == behind]
        if verdicts:
            parts = [f"{verdicts.count(name)} {name}" for name in dict.fromkeys(verdicts)]
            named = kind.replace("(s)", "" if len(verdicts) == 1 else "s")
            lines.append(f"{len(verdicts)} {named}: {', '.join(parts)}.")
    return lines
