"""Scores against their definitions in NumPy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from gripbench.bench.scoring.metrics import metrics
from gripbench.bench.scoring.metrics.convergence import BAND, HOLD
from gripbench.bench.scoring.metrics.excitation import EXCITED
from gripbench.bench.scoring.metrics.utilisation import UTILISATION_BANDS
from gripbench.bench.scoring.scoring import DivergedError, EstimateError, score
from gripbench.envs.recordings import Recording
from gripbench.envs.signals import record_type


def a_recording(truth, used=None, **changes):
    records = np.zeros(len(truth), record_type(("time", "mu_front", "utilisation")))
    records["time"] = 0.01 * np.arange(len(truth))
    records["mu_front"] = truth
    records["utilisation"] = 0.0 if used is None else used
    content = {"scenario": "s", "seed": 0, "vehicle": {}, "observations": records}
    return Recording(**{**content, "truth": records, **changes})


def estimates_of(values, variance=None):
    names = ("mu_front",) if variance is None else ("mu_front", "mu_front_variance")
    records = np.zeros(len(values), record_type(names))
    records["mu_front"] = values
    if variance is not None:
        records["mu_front_variance"] = variance
    return records, names


@given(st.integers(0, 10**6), st.integers(2, 400), st.floats(0.0, 1.0))
def test_scores_are_those_of_numpy(seed, length, score_from):
    generator = np.random.default_rng(seed)
    truth = generator.normal(size=length)
    used = generator.uniform(0.0, 1.2, length)
    values, names = estimates_of(generator.normal(size=length), np.full(length, 0.25))
    recording = a_recording(truth, used, score_from=min(score_from, 0.01 * (length - 1)))
    found = score(values, names, ("mu_front",), recording)["mu_front"]
    kept = recording.truth["time"] >= recording.score_from
    error = (values["mu_front"] - truth)[kept]
    assert found["rms"].count == kept.sum()
    assert found["rms"].value == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-12)
    assert found["peak"].value == np.abs(error).max()
    assert found["bias"].value == pytest.approx(error.mean(), abs=1e-12)
    assert found["mean_nees"].value == pytest.approx(np.mean(error**2) / 0.25, rel=1e-12)
    high = (used[kept] >= 0.5) & (used[kept] < 0.8)
    if high.any():
        assert found["rms_high"].count == high.sum()
        assert found["rms_high"].total == pytest.approx((error[high] ** 2).sum())
    bands = [found[f"rms_{name}"].count for name, *_ in UTILISATION_BANDS if f"rms_{name}" in found]
    assert sum(bands) == found["rms"].count
    excited = found.get("rms_excited")
    assert (excited.count if excited else 0) == np.sum(used[kept] > EXCITED)


def test_convergence_is_the_start_of_the_first_long_stay_in_the_band():
    times = 0.01 * np.arange(500)
    error = np.where(times < 2.0, 1.0, 0.5 * BAND)
    error[100 : 100 + int(HOLD / 0.01) - 5] = 0.0  # a stay that is too short
    found = score(*estimates_of(1.0 + error), ("mu_front",), a_recording(np.ones(500)))
    assert found["mu_front"]["convergence_time"].value == pytest.approx(2.0)


def test_convergence_counts_from_the_friction_step():
    times = 0.01 * np.arange(800)
    error = np.where((times >= 3.0) & (times < 4.25), 1.0, 0.0)
    recording = a_recording(np.ones(800), notes={"friction_step": 3.0})
    found = score(*estimates_of(1.0 + error), ("mu_front",), recording)
    assert found["mu_front"]["convergence_time"].value == pytest.approx(1.25)


def test_what_never_converges_has_no_convergence_time():
    found = score(*estimates_of(np.full(300, 2.0)), ("mu_front",), a_recording(np.ones(300)))
    assert found["mu_front"]["convergence_time"].value is None


def test_samples_without_truth_do_not_count():
    truth = np.ones(100)
    truth[40:] = np.nan
    found = score(*estimates_of(np.full(100, 1.5)), ("mu_front",), a_recording(truth))
    assert found["mu_front"]["rms"].count == 40
    assert found["mu_front"]["rms"].value == pytest.approx(0.5)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_an_estimate_that_is_not_finite_diverges_even_where_it_does_not_count(value):
    values, names = estimates_of(np.ones(100))
    values["mu_front"][3] = value
    with pytest.raises(DivergedError, match=r"mu_front is -?(nan|inf) from t = 0.03 s"):
        score(values, names, ("mu_front",), a_recording(np.ones(100), score_from=0.5))


def test_a_variance_that_is_zero_gives_no_consistency():
    values, names = estimates_of(np.ones(100), np.linspace(0.0, 1.0, 100))
    found = score(values, names, ("mu_front",), a_recording(np.zeros(100)))
    assert not {"mean_nees", "crps", "sharpness", "coverage_90"} & set(found["mu_front"])


def test_a_negative_variance_is_refused_even_where_it_does_not_count():
    values, names = estimates_of(np.ones(100), np.where(np.arange(100) == 3, -0.5, 1.0))
    with pytest.raises(EstimateError, match=r"mu_front_variance is -0.5 at t = 0.03 s; a variance"):
        score(values, names, ("mu_front",), a_recording(np.zeros(100), score_from=0.5))


def quantiles_of(*values, signal="mu_front"):
    names = (signal, f"{signal}_q05", f"{signal}_q50", f"{signal}_q95")
    made = np.zeros(100, record_type(names))
    for name, value in zip(names, values, strict=True):
        made[name] = value
    return made, names


def test_quantiles_are_scored_as_what_they_say():
    truth = np.where(np.arange(100) < 80, 0.1, 3.0)
    found = score(*quantiles_of(0.0, -1.0, 0.0, 1.0), ("mu_front",), a_recording(truth))["mu_front"]
    assert found["coverage_90"].value == pytest.approx(0.8)
    assert found["sharpness"].value == pytest.approx(2.0)
    assert "coverage_95" not in found
    deviation = 1.0 / stats.norm.ppf(0.95)
    expected = np.mean(truth**2) / deviation**2
    assert found["mean_nees"].value == pytest.approx(expected)


def test_quantiles_that_cross_are_refused():
    values, names = quantiles_of(0.0, -1.0, 0.0, np.where(np.arange(100) == 7, -0.1, 1.0))
    with pytest.raises(EstimateError, match=r"mu_front_q50 is above mu_front_q95 at t = 0.07 s"):
        score(values, names, ("mu_front",), a_recording(np.zeros(100)))


def test_quantiles_of_an_angle_go_the_shorter_way_round():
    records = np.zeros(100, record_type(("time", "yaw")))
    records["time"], records["yaw"] = 0.01 * np.arange(100), -3.1
    made, names = quantiles_of(3.1, 3.0, 3.1, -3.0, signal="yaw")  # -3 is 3.28 there
    found = score(made, names, ("yaw",), Recording("r", 0, {}, records, records))["yaw"]
    assert found["coverage_90"].value == 1.0
    assert found["sharpness"].value == pytest.approx(2.0 * np.pi - 6.0)


def test_innovations_count_from_the_first_scored_sample():
    names = ("mu_front", "accel_x_innovation", "accel_x_innovation_variance")
    made = np.zeros(100, record_type(names))
    made["accel_x_innovation"] = np.random.default_rng(0).normal(0.0, 2.0, 100)
    made["accel_x_innovation_variance"] = 4.0
    found = score(made, names, ("mu_front",), a_recording(np.zeros(100), score_from=0.5))
    assert found["mu_front"]["mean_nis"].count == 50
    residual = made["accel_x_innovation"][50:]
    assert found["mu_front"]["mean_nis"].value == pytest.approx(np.mean(residual**2) / 4.0)


@pytest.mark.parametrize("name", ["mean_nees", "crps", "coverage_90", "sharpness"])
def test_a_method_cannot_choose_the_runs_in_which_its_variance_counts(name):
    metric = metrics()[name]
    assert metric.pooled([0.5, 0.7], [5.0, 7.0], [10, 10]) == pytest.approx(0.6)
    assert np.isnan(metric.pooled([0.5, np.nan], [5.0, np.nan], [10, np.nan]))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.zeros(100), "not a structured array"),
        (np.zeros(99, record_type(("mu_front",))), "have shape"),
        (np.zeros(100, record_type(("mu_rear",))), "'mu_front' is declared but not given"),
        (np.zeros(100, record_type(("mu_front", "mu_rear"))), "'mu_rear' is given but not"),
        (np.zeros(100, [("mu_front", np.float32)]), "not of type float64"),
    ],
)
def test_estimates_of_another_form_are_refused(values, message):
    with pytest.raises(EstimateError, match=message):
        score(values, ("mu_front",), ("mu_front",), a_recording(np.ones(100)))


def an_angle(truth, estimate):
    records = np.zeros(len(truth), record_type(("time", "yaw")))
    records["time"], records["yaw"] = 0.01 * np.arange(len(truth)), truth
    made = np.zeros(len(truth), record_type(("yaw",)))
    made["yaw"] = estimate
    recording = Recording("s", 0, {}, records, records)
    return score(made, ("yaw",), ("yaw",), recording)["yaw"]


@given(st.integers(0, 10**6), st.integers(-3, 3))
def test_the_error_of_an_angle_is_that_on_the_circle(seed, turns):
    generator = np.random.default_rng(seed)
    truth = generator.uniform(-np.pi, np.pi, 50)
    estimate = truth + generator.normal(0.0, 2.0, 50) + 2.0 * np.pi * turns
    difference = np.angle(np.exp(1j * (estimate - truth)))
    found = an_angle(truth, estimate)
    assert found["rms"].value == pytest.approx(np.sqrt(np.mean(difference**2)), abs=1e-9)
    assert found["peak"].value == pytest.approx(np.abs(difference).max(), abs=1e-9)
    assert found["bias"].value == pytest.approx(difference.mean(), abs=1e-9)


def test_an_angle_turned_by_whole_turns_is_the_angle():
    truth = np.linspace(-np.pi, np.pi, 100)
    assert an_angle(truth, truth + 2.0 * np.pi)["peak"].value < 1e-14
    assert an_angle(truth, truth - 4.0 * np.pi)["convergence_time"].value == 0.0


def test_what_is_no_angle_is_not_wrapped():
    found = score(*estimates_of(np.full(9, 1.0 + 2.0 * np.pi)), ("mu_front",),
                  a_recording(np.ones(9)))  # fmt: skip
    assert found["mu_front"]["rms"].value == pytest.approx(2.0 * np.pi)


def test_an_estimate_that_cannot_be_squared_diverges():
    with pytest.raises(DivergedError, match="mu_front is too large to be squared"):
        score(*estimates_of(np.full(9, 1e155)), ("mu_front",), a_recording(np.ones(9)))


@pytest.mark.slow
@given(st.integers(0, 10**6), st.floats(0.1, 10.0))
def test_calibration_against_quadrature_and_counting(seed, deviation):
    """CRPS is the integral of (F(x) - 1[x >= truth])^2; coverage is counted."""
    generator = np.random.default_rng(seed)
    truth, values = generator.normal(size=(2, 20))
    made, names = estimates_of(values, np.full(20, deviation**2))
    found = score(made, names, ("mu_front",), a_recording(truth))["mu_front"]
    grid = np.linspace(-100.0, 100.0, 100_001)
    below = stats.norm(values[:, None], deviation).cdf(grid)
    crps = np.trapezoid((below - (grid >= truth[:, None])) ** 2, grid, axis=1).mean()
    assert found["crps"].value == pytest.approx(crps, abs=2e-3)
    for level in (50, 90, 95):
        low, high = stats.norm(values, deviation).interval(level / 100)
        assert found[f"coverage_{level}"].value == np.mean((low <= truth) & (truth <= high))
    low, high = stats.norm(values, deviation).interval(0.9)
    assert found["sharpness"].value == pytest.approx((high - low).mean())
