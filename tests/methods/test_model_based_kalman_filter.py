"""The model-based filter: its filterpy twin, steady states, consistency, late GPS, the errata."""

import lateral_twins
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import expm
from single_track_drive import BLAZER, STEP, drive, turn

from gripbench.bench.papers.anderson2004.riccati import poles
from gripbench.bench.scoring.consistency import chi_square_test, normalised_squares, whiteness_test
from gripbench.methods.blocks.discretisation import exponential
from gripbench.methods.model_based_kalman_filter import ModelBasedKalmanFilter
from gripbench.methods.stiffness_update import StiffnessUpdate

STEER = turn()
NOISE = (5.236e-3, 0.05, 1.745e-3)


# scipy's own exponential loses an element beside a diagonal of 1e-290: such examples are left out
_ELEMENTS = st.floats(-5.0, 5.0).map(lambda x: x if abs(x) > 1e-100 else 0.0)


@given(arrays(np.float64, (4, 4), elements=_ELEMENTS))
def test_exponential_is_scipys(matrix):
    result = np.zeros((4, 4))
    exponential(matrix.copy(), result, np.zeros((4, 4)))
    expected = expm(matrix)
    np.testing.assert_allclose(result, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_agrees_with_filterpy():
    obs, _ = drive(STEER[:2500], seed=1, bias=0.005, noise=NOISE)
    method = ModelBasedKalmanFilter()
    ours = method.run(BLAZER, obs)
    states, covariance = lateral_twins.single_track(method, obs, BLAZER, 30.0)
    for name, column in (("sideslip", 0), ("yaw_rate", 1), ("gyro_bias", 3)):
        np.testing.assert_allclose(ours[name], states[:, column], atol=1e-9)
    for i, name in enumerate(("sideslip", "yaw_rate", "yaw", "gyro_bias")):
        assert ours[name + "_variance"][-1] == pytest.approx(covariance[i, i], rel=1e-8)


@pytest.mark.parametrize("speed", [10.0, 30.0])
def test_steady_turn_has_the_sideslip_and_yaw_rate_of_equation_7(speed):
    m, _, a, b, front, rear = BLAZER.values()
    understeer = m / (a + b) * (b / front - a / rear)
    rate = speed / (a + b + understeer * speed**2) * 0.02
    beta = b * rate / speed - m * a / (a + b) * speed * rate / rear
    obs, _ = drive(turn(angle=0.02, straight=2.0, arc=15.0), speed=speed)
    at = int(17.0 / STEP)
    estimates = ModelBasedKalmanFilter().run(BLAZER, obs)
    assert estimates["yaw_rate"][at] == pytest.approx(rate, rel=1e-3)
    assert estimates["sideslip"][at] == pytest.approx(beta, abs=1e-5)
    forces = estimates["force_y_front"][at] + estimates["force_y_rear"][at]
    assert forces == pytest.approx(m * speed * rate, rel=1e-3)


def test_exact_without_noise_whatever_the_bias():
    obs, x = drive(STEER, bias=0.01)
    estimates = ModelBasedKalmanFilter().run(BLAZER, obs)
    late = obs["time"] > 10.0
    assert np.degrees(np.abs(estimates["sideslip"] - x[:, 0])[late]).max() < 2e-3
    assert estimates["gyro_bias"][-1] == pytest.approx(0.01, abs=2e-5)


def test_innovations_and_errors_are_consistent_when_the_model_is_right():
    squares, errors = [], []
    method = ModelBasedKalmanFilter()
    for seed in range(12):
        obs, x = drive(STEER, seed=seed, bias=0.005, noise=NOISE)
        estimates = method.run(BLAZER, obs)
        for channel, taken in (
            ("course", (obs["course_new"] > 0.0) & (obs["time"] > 2.0)),
            ("yaw_rate", obs["time"] > 2.0),
        ):
            innovation = estimates[f"{channel}_innovation"][taken]
            variance = estimates[f"{channel}_innovation_variance"][taken]
            squares.append(normalised_squares(innovation, variance).mean())
            assert abs(whiteness_test(innovation / np.sqrt(variance)).autocorrelation[0]) < 0.25
        error = estimates["sideslip"][2000] - x[2000, 0]
        errors.append(error**2 / estimates["sideslip_variance"][2000])
    np.testing.assert_allclose(squares, 1.0, atol=0.3)
    assert chi_square_test(errors, confidence=0.999).consistent


def test_bank_deceives_a_filter_that_does_not_know_it():
    bank = np.where(STEER > 0.02, -0.14, 0.0)
    obs, x = drive(STEER, bank=bank)
    at = int(26.0 / STEP)
    blind = ModelBasedKalmanFilter().run(BLAZER, obs)["sideslip"][at] - x[at, 0]
    aware = ModelBasedKalmanFilter("bank").run(BLAZER, obs)["sideslip"][at] - x[at, 0]
    assert np.degrees(abs(blind)) > 0.2
    assert np.degrees(abs(aware)) < 0.002


def test_a_late_course_is_compared_with_the_course_of_its_time():
    obs, x = drive(STEER, late=40)
    error = ModelBasedKalmanFilter().run(BLAZER, obs)["sideslip"] - x[:, 0]
    assert np.degrees(np.abs(error[1000:])).max() < 5e-3
    prompt = obs.copy()
    prompt["gps_time"] = prompt["time"]  # the delay ignored
    wrong = ModelBasedKalmanFilter().run(BLAZER, prompt)["course_innovation"]
    assert np.degrees(np.abs(wrong[1000:])).max() > 1.0


def test_repeated_samples_change_nothing_and_missing_ones_leave_the_gyroscope():
    obs, x = drive(STEER, seed=1, noise=NOISE)
    repeated, gone = obs.copy(), obs.copy()
    repeated["course_new"] = 1.0
    gone["course_new"][obs["time"] > 10.0] = 0.0
    method = ModelBasedKalmanFilter()
    np.testing.assert_array_equal(method.run(BLAZER, obs), method.run(BLAZER, repeated))
    error = method.run(BLAZER, gone)["sideslip"] - x[:, 0]
    assert np.degrees(np.abs(error[1000:])).max() < 0.2


def test_standstill_and_reverse_stay_finite():
    obs, _ = drive(STEER[:1000])
    for speed in (0.0, -3.0, 0.5):
        obs["speed_gps"] = speed
        estimates = ModelBasedKalmanFilter().run(BLAZER, obs)
        assert all(np.isfinite(estimates[name]).all() for name in estimates.dtype.names)


def test_variances_are_not_negative():
    obs, _ = drive(STEER, seed=2, noise=NOISE)
    estimates = ModelBasedKalmanFilter().run(BLAZER, obs)
    for name in ModelBasedKalmanFilter.variances:
        assert estimates[name + "_variance"].min() >= 0.0


def test_printed_model_is_unstable():
    """A22 of eq. 5 without its sign."""
    assert poles(BLAZER, 30.0, printed=True).real.max() == pytest.approx(0.10, abs=0.01)
    assert poles(BLAZER, 30.0).real.max() == pytest.approx(-3.3, abs=0.1)


def test_printed_innovation_variance_lacks_the_covariance():
    """Eq. 8; the states do not depend on it."""
    obs, _ = drive(STEER, seed=2, noise=NOISE)
    right = ModelBasedKalmanFilter().run(BLAZER, obs)
    printed = ModelBasedKalmanFilter("paper").run(BLAZER, obs)
    np.testing.assert_array_equal(right["sideslip"], printed["sideslip"])
    name = "course_innovation_variance"
    assert np.all(printed[name][1000:] > 1.005 * right[name][1000:])


def test_stiffness_update_finds_the_true_stiffness():
    wrong = BLAZER | {"cornering_stiffness_front": 90e3, "cornering_stiffness_rear": 90e3}
    obs, x = drive(turn(arc=20.0))
    estimates = StiffnessUpdate().run(wrong, obs)
    assert estimates["cornering_stiffness_front"][-1] == pytest.approx(69e3, rel=0.05)
    assert estimates["cornering_stiffness_rear"][-1] == pytest.approx(110e3, rel=0.05)
    assert estimates["cornering_stiffness_rear_variance"][-1] > 0.0
    at = int(36.0 / STEP)
    without = ModelBasedKalmanFilter().run(wrong, obs)
    error, error_without = (e["sideslip"][at] - x[at, 0] for e in (estimates, without))
    assert abs(error) < 0.2 * abs(error_without)


def test_stiffness_stays_the_vehicles_own_on_a_straight():
    obs, _ = drive(np.zeros(2000), seed=1)
    estimates = StiffnessUpdate().run(BLAZER, obs)
    assert estimates["cornering_stiffness_front"][-1] == pytest.approx(69e3, rel=1e-12)


@pytest.mark.parametrize("method", [ModelBasedKalmanFilter(), StiffnessUpdate()])
def test_online_equals_batch_and_reset_equals_fresh(method):
    obs, _ = drive(STEER[1000:2500], seed=4)
    batch = method.run(BLAZER, obs)
    for _ in range(2):
        method.reset(BLAZER, STEP)
        for k in range(len(obs)):
            last = method.update({name: float(obs[k][name]) for name in obs.dtype.names})
    for name in batch.dtype.names:
        assert last[name] == batch[name][-1]
