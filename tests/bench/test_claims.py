"""Papers' claims: what a file may say, how a figure is judged, what shipped files promise."""

import math

import pytest
from pydantic import ValidationError

from gripbench.bench.papers.claims import (
    Paper,
    PublishedClaim,
    Seeds,
    changed_verdicts,
    counts,
    judge,
    load_paper,
)
from gripbench.errors import InputError

SEEDS = {"tuning_first": 100, "tuning_count": 5, "test_first": 0, "test_count": 100}


def claim(**given):
    usual = {
        "item": "a",
        "behind": "printed",
        "quantity": "Table 1",
        "unit": "deg",
        "published": 1.0,
        "tolerance_high": 1.0,
    }
    return usual | given


def paper(*claims):
    return Paper.model_validate(
        {"name": "p", "title": "t", "reference": "r", "seeds": SEEDS, "claims": list(claims)}
    )


@pytest.mark.parametrize(
    ("low", "high", "ours", "verdict"),
    [
        (None, 1.0, 1.0, "no worse"),
        (None, 1.0, 1.001, "not reproduced"),
        (0.5, None, 0.4, "not reproduced"),
        (0.5, 1.0, 0.7, "reproduced"),
        (None, 1.0, math.nan, "not reproduced"),
        (0.5, None, math.inf, "not reproduced"),
        (0.5, 1.0, 1.0, "reproduced"),
    ],
)
def test_a_figure_is_judged_by_its_range(low, high, ours, verdict):
    (judged,), _ = judge(paper(claim(tolerance_low=low, tolerance_high=high)), {"a": ours})
    assert judged.verdict == verdict


def test_a_claim_that_is_not_comparable_needs_no_figure():
    given = claim(verdict="not comparable", reason="only drawn", tolerance_high=None)
    (judged,), _ = judge(paper(given), {})
    assert (judged.verdict, judged.ours) == ("not comparable", None)
    (judged,), _ = judge(paper(given), {"a": 3.0})
    assert (judged.verdict, judged.ours) == ("not comparable", 3.0)


def test_figures_and_claims_must_match():
    with pytest.raises(InputError, match="no figure for 'a'"):
        judge(paper(claim()), {})
    with pytest.raises(InputError, match="did you mean 'item_one'"):
        judge(paper(claim(item="item_one")), {"item_on": 1.0})


def test_a_changed_verdict_is_noticed():
    given = paper(claim())
    assert changed_verdicts(given, judge(given, {"a": 0.5})[0]) == []
    (line,) = changed_verdicts(given, judge(given, {"a": 2.0})[0])
    assert line == "p, a: was no worse, is not reproduced"


def test_a_sentence_holds_or_does_not_and_kinds_are_counted_apart():
    given = paper(
        claim(),
        claim(item="b", behind="sentence", published=None, sentence="it is less"),
        claim(item="c", verdict="not comparable", reason="an input"),
    )
    claims, _ = judge(given, {"a": 0.5, "b": 2.0})
    assert [entry.verdict for entry in claims] == ["no worse", "does not hold", "not comparable"]
    assert counts(claims) == [
        "2 printed numbers: 1 no worse, 1 not comparable.",
        "1 sentence: 1 does not hold.",
    ]


def test_a_figure_of_our_own_has_no_verdict():
    content = {"name": "p", "title": "t", "reference": "r", "seeds": SEEDS, "claims": [claim()]}
    own = {"item": "f", "quantity": "ours", "unit": "deg", "note": "why"}
    given = Paper.model_validate(content | {"figures": [own]})
    _, (figure,) = judge(given, {"a": 1.0, "f": 3.0})
    assert (figure.item, figure.value, figure.note) == ("f", 3.0, "why")
    with pytest.raises(InputError, match="no figure for 'f'"):
        judge(given, {"a": 1.0})


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"tolerance_high": None}, "neither tolerance_low nor tolerance_high"),
        ({"tolerance_low": 2.0}, "above tolerance_high"),
        ({"verdict": "not reproduced"}, "gives no reason"),
        ({"verdict": "holds"}, "verdict must be 'no worse' or 'not reproduced'"),
        ({"behind": "sentence"}, "does not quote it"),
        ({"behind": "figure"}, "gives no reading_error"),
        ({"published": None}, "gives none"),
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


@pytest.mark.parametrize("name", ["anderson2004", "dakhlallah2008", "yoon2015"])
def test_shipped_papers_load(name):
    shipped = load_paper(name)
    assert shipped.name == name
    assert set(shipped.seeds.tuning).isdisjoint(shipped.seeds.test)
    with pytest.raises(InputError, match="did you mean"):
        load_paper(name[:-1])
