"""Papers' claims: what a file may say, how a figure is judged, what shipped files promise."""

import math

import pytest
from pydantic import ValidationError

from gripbench.bench.papers.claims import (
    Paper,
    PublishedClaim,
    Seeds,
    changed_verdicts,
    judge,
    load_paper,
)
from gripbench.errors import InputError

SEEDS = {"tuning_first": 100, "tuning_count": 5, "test_first": 0, "test_count": 100}


def claim(**given):
    return {"item": "a", "quantity": "Figure 1", "unit": "deg", "tolerance_high": 1.0} | given


def paper(*claims):
    return Paper.model_validate(
        {"name": "p", "title": "t", "reference": "r", "seeds": SEEDS, "claims": list(claims)}
    )


@pytest.mark.parametrize(
    ("low", "high", "ours", "verdict"),
    [
        (None, 1.0, 1.0, "reproduced"),
        (None, 1.0, 1.001, "not reproduced"),
        (0.5, None, 0.4, "not reproduced"),
        (0.5, 1.0, 0.7, "reproduced"),
        (None, 1.0, math.nan, "not reproduced"),
        (0.5, None, math.inf, "not reproduced"),
    ],
)
def test_a_figure_is_judged_by_its_range(low, high, ours, verdict):
    (judged,) = judge(paper(claim(tolerance_low=low, tolerance_high=high)), {"a": ours})
    assert judged.verdict == verdict


def test_a_claim_that_is_not_comparable_needs_no_figure():
    given = claim(verdict="not comparable", reason="only drawn", tolerance_high=None)
    (judged,) = judge(paper(given), {})
    assert (judged.verdict, judged.ours) == ("not comparable", None)
    (judged,) = judge(paper(given), {"a": 3.0})
    assert (judged.verdict, judged.ours) == ("not comparable", 3.0)


def test_figures_and_claims_must_match():
    with pytest.raises(InputError, match="no figure for the claim 'a'"):
        judge(paper(claim()), {})
    with pytest.raises(InputError, match="did you mean 'item_one'"):
        judge(paper(claim(item="item_one")), {"item_on": 1.0})


def test_a_changed_verdict_is_noticed():
    given = paper(claim())
    assert changed_verdicts(given, judge(given, {"a": 0.5})) == []
    (line,) = changed_verdicts(given, judge(given, {"a": 2.0}))
    assert line == "p, a: was reproduced, is not reproduced"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"tolerance_high": None}, "neither tolerance_low nor tolerance_high"),
        ({"tolerance_low": 2.0}, "above tolerance_high"),
        ({"verdict": "not reproduced"}, "gives no reason"),
        ({"tolerence_high": 2.0}, "tolerence_high"),
        ({"published": math.nan}, "finite"),
    ],
)
def test_mistakes_in_a_claim_are_refused(given, message):
    with pytest.raises(ValidationError, match=message):
        PublishedClaim.model_validate(claim(**given))


def test_a_tuning_seed_cannot_test():
    with pytest.raises(ValidationError, match="seed 99 is among the tuning and the test seeds"):
        Seeds.model_validate(SEEDS | {"tuning_first": 99})


def test_a_claim_is_given_once():
    with pytest.raises(ValidationError, match="'a' is given twice"):
        paper(claim(), claim())


@pytest.mark.parametrize("name", ["anderson2004", "dakhlallah2008"])
def test_shipped_papers_load(name):
    shipped = load_paper(name)
    assert shipped.name == name
    assert set(shipped.seeds.tuning).isdisjoint(shipped.seeds.test)
    with pytest.raises(InputError, match="did you mean"):
        load_paper(name[:-1])
