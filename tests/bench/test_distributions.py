"""Stated distributions against their definitions: integrals, simulation, laws that are known."""

import numpy as np
import pytest
from scipy import integrate, stats

from gripbench.bench.scoring.distributions import Innovations, Normal, Quantiles

LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)


def normal(error, deviation):
    error = np.atleast_1d(np.asarray(error, float))
    deviation = np.full(error.shape, float(deviation))
    return Normal(error, deviation, deviation**2)


def quantiles(truth, values, levels=LEVELS):
    truth = np.atleast_1d(np.asarray(truth, float))
    return Quantiles(truth, levels, np.repeat(np.asarray(values, float)[:, None], len(truth), 1))


@pytest.mark.parametrize("error", [0.0, 0.3, -2.0, 7.0])
def test_crps_of_a_normal_is_the_integral_that_defines_it(error):
    law = stats.norm(scale=1.7)
    below = integrate.quad(lambda x: law.cdf(x) ** 2, -40.0, -error)[0]
    above = integrate.quad(lambda x: law.sf(x) ** 2, -error, 40.0)[0]
    assert normal(error, 1.7).crps()[0] == pytest.approx(below + above, rel=1e-6)


def test_crps_of_a_normal_has_its_known_values():
    at_zero = 2.0 / np.sqrt(2.0 * np.pi) - 1.0 / np.sqrt(np.pi)
    assert normal(0.0, 3.0).crps()[0] == pytest.approx(3.0 * at_zero)
    errors = np.random.default_rng(0).normal(size=200_000)
    assert normal(errors, 1.0).crps().mean() == pytest.approx(1.0 / np.sqrt(np.pi), rel=5e-3)
    assert normal(5.0, 1e-9).crps()[0] == pytest.approx(5.0)  # of a point it is the distance


@pytest.mark.parametrize("truth", [-4.0, -1.0, -0.2, 0.0, 0.4, 2.0, 9.0])
def test_crps_of_quantiles_is_the_integral_over_their_straight_lines(truth):
    values = np.array([-2.0, -0.5, 0.0, 1.0, 3.0])

    def distribution(x):
        inside = np.interp(x, values, LEVELS)
        return np.where(x < values[0], 0.0, np.where(x >= values[-1], 1.0, inside))

    x = np.linspace(-5.0, 10.0, 1_500_001)
    expected = integrate.trapezoid((distribution(x) - (x >= truth)) ** 2, x)
    assert quantiles(truth, values).crps()[0] == pytest.approx(expected, abs=2e-5)


def test_a_single_quantile_is_a_point():
    assert quantiles(3.0, [1.0], (0.5,)).crps() == pytest.approx([2.0])
    assert quantiles(3.0, [1.0], (0.5,)).normalised() is None


def test_many_quantiles_of_a_normal_score_as_the_normal_and_few_no_better():
    truth = np.random.default_rng(1).normal(size=20_000)
    exact = normal(-truth, 1.0).crps().mean()
    scores = []
    for number in (3, 9, 99, 999):
        levels = tuple(np.arange(1, number + 1) / (number + 1.0))
        scores.append(quantiles(truth, stats.norm.ppf(levels), levels).crps().mean())
    assert scores[-1] == pytest.approx(exact, rel=2e-3)
    assert min(scores) > exact * (1.0 - 1e-3)  # who says less cannot score better
    assert scores == sorted(scores, reverse=True)


def test_a_right_spread_scores_best():
    errors = np.random.default_rng(2).normal(size=20_000)
    scores = [normal(errors, spread).crps().mean() for spread in (0.3, 0.7, 1.0, 1.5, 3.0)]
    assert int(np.argmin(scores)) == 2


def test_intervals_are_told_where_their_ends_are_stated():
    found = quantiles([-3.0, 0.0, 2.9], [-2.0, -0.5, 0.0, 1.0, 3.0])
    np.testing.assert_array_equal(found.inside(0.9), [0.0, 1.0, 1.0])
    np.testing.assert_array_equal(found.width(0.9), [5.0] * 3)
    np.testing.assert_array_equal(found.inside(0.5), [0.0, 1.0, 0.0])
    assert found.inside(0.95) is None
    assert found.width(0.95) is None
    np.testing.assert_array_equal(found.below(0.25), [1.0, 0.0, 0.0])
    assert found.below(0.1) is None


def test_quantiles_of_a_normal_have_its_normalised_errors():
    truth = np.random.default_rng(3).normal(0.5, 2.0, 1000)
    for levels in (LEVELS, (0.1, 0.9), (0.2, 0.6, 0.9)):
        values = 0.5 + 2.0 * stats.norm.ppf(levels)
        found = quantiles(truth, values, levels).normalised()
        if 0.5 in levels:
            np.testing.assert_allclose(found, (0.5 - truth) / 2.0, atol=1e-12)
        else:
            assert np.mean(found**2) == pytest.approx(1.0, rel=0.15)
    assert quantiles(truth, [0.0, 1.0], (0.6, 0.9)).normalised() is None
    assert quantiles(truth, [0.0, 0.0, 0.0], (0.1, 0.5, 0.9)).normalised() is None


def test_innovations_that_are_held_or_not_taken_do_not_count():
    residual = np.array([0.0, 1.0, 1.0, 2.0, 2.0, 3.0])
    variance = np.array([0.0, 4.0, 4.0, 4.0, 1.0, 0.0])
    found = Innovations({"a": residual}, {"a": variance}).normalised["a"]
    np.testing.assert_array_equal(found, [0.5, 1.0, 2.0])


def test_white_innovations_pass_and_drifting_ones_do_not():
    rng = np.random.default_rng(4)
    white = rng.normal(size=500)
    found = Innovations(
        {"a": white, "b": np.cumsum(white), "few": white[:5], "none": np.zeros(500)},
        {name: np.ones(5 if name == "few" else 500) for name in ("a", "b", "few", "none")},
    )
    assert [test.white for test in found.whiteness] == [True, False]
