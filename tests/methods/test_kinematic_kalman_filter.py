"""The kinematic filter: its filterpy twin, closed forms, late and repeated GPS samples."""

import lateral_twins
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from single_track_drive import STEP, drive, turn

from gripbench.methods.kinematic_kalman_filter import KinematicKalmanFilter

STEER = turn()


def test_agrees_with_filterpy():
    obs, _ = drive(STEER, seed=3, bias=0.005)
    method = KinematicKalmanFilter()
    ours = method.run({}, obs)
    states, covariance = lateral_twins.kinematic(method, obs)
    wrapped = (states[:, 0] + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(ours["yaw"], wrapped, atol=1e-9)
    np.testing.assert_allclose(ours["gyro_bias"], states[:, 1], atol=1e-9)
    assert ours["yaw_variance"][-1] == pytest.approx(covariance[0, 0], rel=1e-9)


def test_sideslip_follows_without_noise():
    obs, x = drive(STEER, bias=0.004)
    estimates = KinematicKalmanFilter(bias_std=0.01).run({}, obs)
    taken = obs["course_new"] > 0.0
    late = obs["time"] > 14.0
    error = np.degrees(estimates["sideslip"] - x[:, 0])[taken & late]
    assert np.abs(error).max() < 0.06


def test_scale_factor_error_grows_with_the_angle_turned():
    """The heading of a gyroscope that reads 2 % high is 2 % of the turn ahead."""
    obs, x = drive(STEER, scale=1.02)
    wrong = KinematicKalmanFilter().run({}, obs)
    right = KinematicKalmanFilter(gyro_scale=1.02).run({}, obs)
    end = int(28.0 / STEP)  # in the turn's last second
    turned = x[end, 2] - x[int(16.0 / STEP), 2]
    error = wrong["sideslip"][end] - right["sideslip"][end]
    assert error == pytest.approx(-0.02 * turned, rel=0.1)


def test_scale_factor_is_learnt_from_a_turn():
    obs, _ = drive(STEER, scale=1.02, seed=1)
    estimates = KinematicKalmanFilter("scale_factor").run({}, obs)
    assert estimates["gyro_scale"][-1] == pytest.approx(1.02, abs=0.004)
    assert estimates["gyro_scale_variance"][-1] < 0.2 * 0.02**2


@settings(max_examples=15)
@given(st.floats(-3.0, 3.0))
def test_heading_of_the_drive_does_not_matter(heading):
    reference, _ = drive(STEER[:2500], seed=5)
    turned, _ = drive(STEER[:2500], seed=5, heading=heading)
    method = KinematicKalmanFilter()
    a, b = method.run({}, reference)["sideslip"], method.run({}, turned)["sideslip"]
    np.testing.assert_allclose(a, b, atol=1e-9)


def test_a_late_course_meets_the_heading_of_its_time():
    """In a steady turn a course that is 0.4 s late is as good as a prompt one."""
    prompt, x = drive(STEER)
    late, _ = drive(STEER, late=40)
    at = int(26.0 / STEP)
    for obs in (prompt, late):
        estimates = KinematicKalmanFilter().run({}, obs)
        assert estimates["sideslip"][at] == pytest.approx(x[at, 0], abs=1e-3)


def test_repeated_and_old_samples_are_left_out():
    obs, _ = drive(STEER, seed=2)
    repeated = obs.copy()
    repeated["course_new"][5::20] = 1.0  # the held sample, announced once more
    method = KinematicKalmanFilter()
    np.testing.assert_array_equal(method.run({}, obs), method.run({}, repeated))


def test_without_gps_the_gyroscope_goes_on():
    obs, x = drive(STEER, seed=2)
    gone = obs.copy()
    gone["course_new"][obs["time"] > 10.0] = 0.0
    estimates = KinematicKalmanFilter().run({}, gone)
    assert np.degrees(abs(estimates["yaw"][2000] - x[2000, 2])) < 0.5
    growth = np.diff(estimates["yaw_variance"][1100:])
    assert np.all(growth > 0.0)


def test_variance_of_sideslip_is_that_of_heading_and_course():
    """Eq. 6."""
    obs, _ = drive(STEER, seed=2)
    estimates = KinematicKalmanFilter().run({}, obs)
    at = int(24.0 / STEP)
    assert obs["course_new"][at] == 1.0
    expected = estimates["yaw_variance"][at] + (0.05 / 30.0) ** 2
    assert estimates["sideslip_variance"][at] == pytest.approx(expected, rel=1e-12)


def test_printed_noise_makes_the_bias_walk_depend_on_the_sample_rate():
    obs, _ = drive(np.zeros(3000), seed=1)
    sparse = obs[::2].copy()
    for variant, same in (("corrected", True), ("paper", False)):
        variances = [
            KinematicKalmanFilter(variant, bias_walk=1e-3).run({}, o)["gyro_bias_variance"][-1]
            for o in (obs, sparse)
        ]
        assert (abs(variances[0] / variances[1] - 1.0) < 0.05) == same


def test_online_equals_batch_and_reset_equals_fresh():
    obs, _ = drive(STEER[:2000], seed=4)
    method = KinematicKalmanFilter()
    batch = method.run({}, obs)
    for _ in range(2):
        method.reset({}, STEP)
        for k in range(0, len(obs)):
            sample = {name: float(obs[k][name]) for name in obs.dtype.names}
            last = method.update(sample)
    assert last["sideslip"] == batch["sideslip"][-1]
    assert last["gyro_bias_variance"] == batch["gyro_bias_variance"][-1]
