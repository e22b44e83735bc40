"""Consistency tests against sequences whose law is known."""

import numpy as np
import pytest
from nees_coverage import LAWS, held
from scipy import stats

from gripbench.bench.scoring.consistency import (
    CONSISTENT,
    chi_square_test,
    normalised_squares,
    runs_test,
    whiteness_test,
)
from gripbench.errors import InputError


def test_chi_square_band_holds_the_stated_share_of_consistent_filters():
    rng = np.random.default_rng(0)
    inside = sum(
        chi_square_test(rng.chisquare(3, 40), degrees=3, confidence=0.9).consistent
        for _ in range(1000)
    )
    assert stats.binomtest(inside, 1000, 0.9).pvalue > 1e-3


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_wrong_covariance_is_found(factor):
    errors = np.random.default_rng(1).standard_normal(200)
    test = chi_square_test(normalised_squares(errors, np.full(200, factor)))
    assert not test.consistent
    assert test.mean == pytest.approx(1.0 / factor, rel=0.3)


def test_band_is_that_of_the_chi_square_law():
    test = chi_square_test(np.ones((5, 2)), degrees=2, confidence=0.95)
    low, high = stats.chi2.interval(0.95, 20)
    assert (test.low, test.high) == pytest.approx((low / 20.0, high / 20.0))
    assert (test.mean, test.count) == (0.5, 10)


def test_white_sequences_pass_at_the_stated_level():
    rng = np.random.default_rng(2)
    white = sum(whiteness_test(rng.standard_normal(400)).white for _ in range(500))
    assert stats.binomtest(white, 500, 0.95).pvalue > 1e-3


def test_autocorrelation_of_a_first_order_process():
    rng = np.random.default_rng(3)
    x = np.zeros(20000)
    for k, w in enumerate(rng.standard_normal(len(x) - 1)):
        x[k + 1] = 0.6 * x[k] + w
    test = whiteness_test(x, lags=3)
    np.testing.assert_allclose(test.autocorrelation, [0.6, 0.36, 0.216], atol=0.03)
    assert not test.white


def test_a_mean_that_stays_is_not_white():
    assert not whiteness_test(np.random.default_rng(4).standard_normal(400) + 1.0).white


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: chi_square_test([]), "at least one value"),
        (lambda: chi_square_test([np.nan]), "finite"),
        (lambda: normalised_squares([1.0], [0.0]), "positive"),
        (lambda: whiteness_test(np.ones(5)), "more than 10"),
        (lambda: whiteness_test(np.zeros(50)), "not all zero"),
    ],
)
def test_bad_input_is_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()


@pytest.mark.parametrize("name", ["three causes: chi-square, 3", "memory of 2000 samples in 200"])
@pytest.mark.parametrize("runs", [3, 10])
def test_a_consistent_filter_lies_within_the_band_of_its_runs(name, runs):
    assert held(LAWS[name], runs, 1500) > 0.94


@pytest.mark.parametrize(
    ("factor", "verdict"), [(9.0, "overconfident by a factor 3"), (0.1, "cautious by a factor 3")]
)
def test_a_filter_whose_variance_is_off_is_told_by_how_much(factor, verdict):
    squares = factor * LAWS["three causes: chi-square, 3"](np.random.default_rng(5), 60)
    test = runs_test(100.0 * squares, np.full(60, 100))
    assert test.verdict.startswith(verdict[:-1])
    low, high = test.factor_interval
    assert low < np.sqrt(factor) < high
    assert test.factor == pytest.approx(np.sqrt(factor), rel=0.2)


def test_samples_of_a_run_are_no_runs():
    # One bias for a whole run: a thousand samples say no more than one.
    bias = np.random.default_rng(6).normal(size=2)
    test = runs_test(1000.0 * bias**2, [1000, 1000])
    assert test.degrees == 2.0
    assert test.verdict == CONSISTENT
    same = runs_test([3.0, 3.0, 3.0, 3.0], [3] * 4)
    assert (same.mean, same.degrees) == (1.0, 4.0)


def test_runs_without_a_value_give_no_test():
    assert runs_test([], []) is None
    assert runs_test([1.0, np.nan], [1, 1]) is None
    assert runs_test([0.0, 0.0], [5, 5]).verdict.startswith("cautious")
