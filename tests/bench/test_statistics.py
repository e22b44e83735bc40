import math

import interval_coverage
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from gripbench.bench.ranking import statistics
from gripbench.bench.ranking.pareto import pareto_front
from gripbench.bench.scoring.metric import pooled_rms
from gripbench.errors import InputError


def sums(rms, samples=100):
    """Sums of squares of runs with these RMS values, one scenario: (1, runs, methods)."""
    squares = np.square(np.asarray(rms, float))[None] * samples
    return squares, np.full(squares.shape, float(samples))


def test_pooled_rms_is_the_root_of_the_mean_square_not_the_mean_of_rms():
    scores = statistics.mean_log_rms(*sums([[3.0], [4.0]]))
    assert math.exp(scores.estimate[0]) == pytest.approx(math.sqrt(12.5), rel=1e-14)
    assert pooled_rms([900.0, 1600.0], [100, 100]) == pytest.approx(math.sqrt(12.5), rel=1e-14)


def test_mean_log_rms_does_not_weigh_units_or_difficulty():
    rng = np.random.default_rng(1)
    rms = rng.uniform(1.0, 2.0, (3, 8, 4))
    counts = np.full(rms.shape, 50.0)
    scale = np.array([1.0, 1e3, 1e-6])[:, None, None]
    plain = statistics.mean_log_rms(rms**2 * 50.0, counts)
    scaled = statistics.mean_log_rms((scale * rms) ** 2 * 50.0, counts)
    shift = np.log(scale).mean()
    np.testing.assert_allclose(scaled.estimate, plain.estimate + shift, rtol=1e-12)
    np.testing.assert_allclose(
        statistics.p_better(scaled), statistics.p_better(plain), rtol=1e-9, atol=1e-12
    )


def test_single_run_scenarios_enter_the_mean_but_not_the_error():
    rng = np.random.default_rng(2)
    squares, counts = sums(rng.uniform(1.0, 2.0, (10, 2)))
    alone = statistics.mean_log_rms(squares, counts)
    fixed = statistics.mean_log_rms(squares, counts, np.array([[1.0, math.e]]))
    np.testing.assert_allclose(
        fixed.estimate, (alone.estimate + np.array([0.0, 1.0])) / 2.0, rtol=1e-12
    )
    np.testing.assert_allclose(fixed.standard_errors(), alone.standard_errors() / 2.0, rtol=1e-9)
    with pytest.raises(InputError, match="no scenario"):
        statistics.mean_log_rms(np.empty((0, 1, 2)), np.empty((0, 1, 2)))


def test_bootstrap_error_agrees_with_the_delta_method():
    rng = np.random.default_rng(3)
    squares, counts = sums(np.sqrt(rng.chisquare(50, (200, 1))))
    found = statistics.mean_log_rms(squares, counts, resamples=20000).standard_errors()[0]
    values = squares[0, :, 0]
    expected = values.std(ddof=1) / math.sqrt(200) / values.mean() / 2.0
    assert found == pytest.approx(expected, rel=0.03)


def test_another_method_on_the_board_changes_nothing_between_two_others():
    rms = np.random.default_rng(4).uniform(1.0, 1.2, (12, 3))
    three = statistics.p_better(statistics.mean_log_rms(*sums(rms)))
    two = statistics.p_better(statistics.mean_log_rms(*sums(rms[:, :2])))
    np.testing.assert_allclose(three[:2, :2], two, rtol=1e-9)


def test_pairing_separates_what_unpaired_runs_would_hide():
    rng = np.random.default_rng(5)
    difficulty = rng.uniform(1.0, 10.0, 15)
    rms = np.column_stack([difficulty, difficulty * 1.02 * rng.uniform(0.99, 1.01, 15)])
    p = statistics.p_better(statistics.mean_log_rms(*sums(rms)))
    assert p[0, 1] < 1e-4
    assert p[1, 0] > 0.999
    assert stats.ttest_ind(rms[:, 0], rms[:, 1]).pvalue > 0.5


def test_identical_up_to_rounding_is_a_tie_and_one_run_says_nothing():
    rms = np.random.default_rng(6).uniform(1.0, 2.0, (10, 1))
    p = statistics.p_better(statistics.mean_log_rms(*sums(np.hstack([rms, rms * (1 + 1e-14)]))))
    assert (p == 1.0).all()
    p = statistics.p_better(statistics.mean_log_rms(*sums([[1.0, 9.0]])))
    assert (p == 1.0).all()


def test_difference_without_any_noise_is_certain():
    p = statistics.p_better(statistics.mean_log_rms(*sums([[1.0, 2.0]] * 5)))
    assert p[0, 1] == 0.0
    assert p[1, 0] == 1.0


def test_perfect_estimate_beats_without_infinities():
    scores = statistics.mean_log_rms(*sums([[0.0, 1.0]] * 5))
    assert np.isfinite(scores.estimate).all()
    assert statistics.p_better(scores)[0, 1] == 0.0


def test_holm_agrees_with_its_closed_form():
    # m = 4: 4 p1, max(., 3 p2), max(., 2 p3), max(., p4)
    p = np.array([0.02, 0.005, 0.9, 0.018])
    np.testing.assert_allclose(statistics.holm(p), [0.054, 0.02, 0.9, 0.054], rtol=1e-12)
    assert statistics.holm(np.array([0.6, 0.7])).tolist() == [1.0, 1.0]


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=8))
def test_holm_lies_between_raw_and_bonferroni_and_keeps_the_order(p):
    raw = np.array(p)
    adjusted = statistics.holm(raw)
    assert (adjusted >= raw).all()
    assert (adjusted <= np.minimum(raw * len(raw), 1.0) + 1e-15).all()
    order = np.argsort(raw, kind="stable")
    assert (np.diff(adjusted[order]) >= 0.0).all()
    # the definition: hypothesis k is rejected at a level iff all with smaller p are, one by one
    for level in (0.01, 0.05, 0.5):
        rejected = set()
        for step, index in enumerate(order):
            if raw[index] * (len(raw) - step) > level:
                break
            rejected.add(index)
        assert rejected == set(np.flatnonzero(adjusted <= level))


def test_holm_over_two_methods_is_the_two_sided_test():
    rms = np.random.default_rng(7).uniform(1.0, 1.3, (8, 2))
    scores = statistics.mean_log_rms(*sums(rms))
    one_sided = statistics.p_better(scores).min()
    assert statistics.adjusted_p_better(scores).min() == pytest.approx(2.0 * one_sided)


def test_rank_intervals_of_known_claims():
    # 0 beats 2 and 3, 1 beats 3
    better = np.zeros((4, 4), bool)
    better[0, [2, 3]] = better[1, 3] = True
    low, high = statistics.rank_intervals(better)
    assert low.tolist() == [1, 1, 2, 3]
    assert high.tolist() == [2, 3, 4, 4]


def test_letters_of_known_claims():
    better = np.zeros((4, 4), bool)
    better[0, [2, 3]] = better[1, 3] = True
    assert statistics.tied_groups(better, np.arange(4)) == ["a", "ab", "bc", "c"]


@given(st.integers(1, 6).flatmap(
    lambda n: st.tuples(st.permutations(range(n)), st.sets(st.tuples(
        st.integers(0, n - 1), st.integers(0, n - 1)).filter(lambda pair: pair[0] != pair[1]))))
)  # fmt: skip
def test_letters_are_shared_exactly_by_those_that_tie(case):
    order, pairs = case
    place = {method: position for position, method in enumerate(order)}
    better = np.zeros((len(order), len(order)), bool)
    for i, j in pairs:
        if place[i] < place[j]:
            better[i, j] = True
    letters = statistics.tied_groups(better, np.array(order))
    for i in range(len(order)):
        assert letters[i]
        for j in range(i):
            assert bool(set(letters[i]) & set(letters[j])) != (better[i, j] or better[j, i])
    assert "a" in letters[order[0]]


def test_wins_count_failures_as_losses():
    nan = math.nan
    won = statistics.wins(np.array([[1.0, 2.0, nan], [2.0, 2.0, nan], [nan, 1.0, nan]]))
    assert won[0, 1] == 1.5
    assert won[1, 0] == 1.5
    assert won[0, 2] == 2.5
    assert won[2, 0] == 0.5
    assert won[1, 2] == 3.0
    assert np.isnan(np.diag(won)).all()


@pytest.mark.parametrize("runs", [6, 20])
def test_claims_keep_their_error_rate_and_rank_intervals_cover(runs):
    """Four methods, two of them equal: how often is any claim or any rank interval wrong?"""
    rng = np.random.default_rng(runs)
    factor = np.array([1.0, 1.0, 1.05, 1.2])
    wrong, uncovered, found, trials = 0, 0, 0, 300
    for _ in range(trials):
        common = rng.uniform(1.0, 3.0, (2, runs, 1))
        own = rng.chisquare(20, (2, runs, 4)) / 20
        squares = (factor * common) ** 2 * own * 50.0
        scores = statistics.mean_log_rms(squares, np.full(squares.shape, 50.0), resamples=300)
        better = statistics.adjusted_p_better(scores) < 0.05
        truly = factor[:, None] < factor[None, :]
        wrong += bool((better & ~truly).any())
        low, high = statistics.rank_intervals(better)
        found += better[0, 3]
        uncovered += bool(((low > [1, 1, 3, 4]) | (high < [2, 2, 3, 4])).any())
    limit = stats.binom.ppf(0.999, trials, 0.05)  # a true rate of 5 % stays below it
    assert wrong <= limit
    assert uncovered <= limit
    assert found > 0.1 * trials  # not by never claiming anything


def test_pooled_rms_interval_covers_and_narrows():
    rng = np.random.default_rng(11)
    covered, trials = 0, 300
    for _ in range(trials):
        squares = 100.0 * 4.0 * rng.chisquare(10, 20) / 10
        low, high = statistics.pooled_rms_interval(squares, np.full(20, 100.0), resamples=400)
        covered += low <= 2.0 <= high
    assert covered >= stats.binom.ppf(0.001, trials, 0.93)
    squares = 400.0 * rng.chisquare(10, 2000) / 10
    low, high = statistics.pooled_rms_interval(squares, np.full(2000, 100.0), resamples=400)
    assert 1.9 < low < 2.0 < high < 2.1


@pytest.mark.parametrize(
    ("name", "runs"),
    [
        ("noise alone: chi-square, 30 degrees of freedom", 10),
        ("one cause: chi-square, 1", 10),
        ("one cause: chi-square, 1", 20),
        ("RMS lognormal, factor e^0.5", 10),
        ("RMS lognormal, factor e^0.5", 20),
    ],
)
def test_the_interval_of_the_pooled_rms_covers_it(name, runs):
    """With 300 intervals a coverage of 93 % is seen as at least 89 % in 99.9 of 100 tries."""
    draw, mean = interval_coverage.LAWS[name]
    share, _ = interval_coverage.coverage(draw, mean, runs, 300)
    assert share >= 0.89


def test_the_interval_of_the_pooled_rms_is_that_of_normal_theory_with_many_runs():
    squares = np.random.default_rng(2).chisquare(30, 4000)
    low, high = statistics.pooled_rms_interval(squares, np.ones(4000))
    width = stats.norm.isf(0.05 / 3.0) * math.sqrt(2.0 / 30.0 / 4000)
    assert math.log(high / low) == pytest.approx(width, rel=0.05)


def test_where_one_run_outweighs_all_there_is_no_interval():
    squares = np.ones(100)
    squares[7] = 1e12
    low, high = statistics.pooled_rms_interval(squares, np.full(100, 10.0))
    assert math.isnan(low) == math.isnan(high)
    assert not high < math.sqrt(1e12 / 1000.0)


def test_the_interval_of_few_or_equal_runs():
    assert all(map(math.isnan, statistics.pooled_rms_interval(np.ones(9), np.ones(9))))
    assert statistics.pooled_rms_interval(4.0 * np.ones(10), np.ones(10)) == (2.0, 2.0)


def test_few_runs_widen_every_interval_by_the_factor_of_an_unbiased_variance():
    """The bootstrap divides by n: at five runs its standard error is 11 % too small."""
    logs = np.log([1.0, 1.1, 0.9, 1.2, 0.95])
    squares = np.exp(2.0 * logs)[None, :, None] * np.ones((1, 5, 2))
    squares[..., 1] = 1.0
    scores = statistics.mean_log_rms(squares, np.ones((1, 5, 2)), resamples=200_000)
    mean_square = squares[0, :, 0]
    exact = mean_square.std(ddof=1) / math.sqrt(5.0) / mean_square.mean() / 2.0
    assert scores.standard_errors()[0] == pytest.approx(exact, rel=0.02)


def test_a_performance_profile_counts_runs_within_a_factor_of_the_best():
    rms = np.array([[1.0, 2.0], [3.0, 1.0], [1.0, np.nan], [0.0, 1.0]])
    found = statistics.performance_profile(rms, np.array([1.0, 2.0, 3.0]))
    assert found.tolist() == [[0.75, 0.25], [0.75, 0.5], [1.0, 0.5]]


def test_pareto_front_of_known_points():
    rms = [1.0, 2.0, 2.0, 3.0, 1.0, math.nan, 0.5]
    time = [9.0, 5.0, 6.0, 1.0, 9.0, 0.1, math.nan]
    assert pareto_front(rms, time).tolist() == [True, True, False, True, True, False, False]
    assert pareto_front([], []).tolist() == []
