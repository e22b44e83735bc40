"""The compiled filter steps against filterpy and against what covariances must obey."""

import numba
import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from gripbench.methods.blocks import kalman


@numba.njit
def _scalars(records, rows, measured, variances, distances):
    filter = records[0]
    for k in range(measured.shape[0]):
        kalman.predict(filter)
        for i in range(rows.shape[0]):
            predicted = 0.0
            for j in range(rows.shape[1]):
                filter.h[j] = rows[i, j]
                predicted += rows[i, j] * filter.x[j]
            distances[k, i] = kalman.correct_scalar(
                filter, measured[k, i] - predicted, variances[i]
            )


@numba.njit
def _vectors(records, measured, distances):
    filter = records[0]
    for k in range(measured.shape[0]):
        kalman.predict(filter)
        for i in range(measured.shape[1]):
            filter.residual[i] = measured[k, i]
            for j in range(filter.x.shape[0]):
                filter.residual[i] -= filter.H[i, j] * filter.x[j]
        distances[k] = kalman.innovation_distance(filter)
        kalman.correct(filter)


def _case(states, outputs, seed):
    rng = np.random.default_rng(seed)
    records = np.zeros(1, kalman.filter_type(states, outputs))
    twin = KalmanFilter(dim_x=states, dim_z=outputs)
    root = rng.standard_normal((states, states))
    noise = rng.standard_normal((outputs, outputs))
    twin.x = np.zeros((states, 1))
    twin.F = np.eye(states) + 0.05 * rng.standard_normal((states, states))
    twin.P = root @ root.T
    twin.Q = 0.01 * root.T @ root
    twin.H = rng.standard_normal((outputs, states))
    twin.R = noise @ noise.T + np.eye(outputs)
    for name in ("P", "F", "Q", "H", "R"):
        records[name][0] = getattr(twin, name)
    return records, twin, rng.standard_normal((200, outputs))


@pytest.mark.parametrize("states", [2, 5])
def test_scalar_corrections_agree_with_filterpy(states):
    records, twin, measured = _case(states, 2, seed=states)
    twin.R = np.diag(np.diag(twin.R))
    distances = np.zeros(measured.shape)
    _scalars(records, twin.H, measured, np.diag(twin.R).copy(), distances)
    for k, z in enumerate(measured):
        twin.predict()
        twin.update(z)
        joint = float((twin.y.T @ np.linalg.inv(twin.S) @ twin.y).item())
        assert distances[k].sum() == pytest.approx(joint, rel=1e-9, abs=1e-12)
    np.testing.assert_allclose(records["x"][0], twin.x[:, 0], rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(records["P"][0], twin.P, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize(("states", "outputs"), [(2, 3), (5, 2)])
def test_joint_correction_agrees_with_filterpy(states, outputs):
    records, twin, measured = _case(states, outputs, seed=10 + states)
    distances = np.zeros(len(measured))
    _vectors(records, measured, distances)
    for k, z in enumerate(measured):
        twin.predict()
        twin.update(z)
        joint = float((twin.y.T @ np.linalg.inv(twin.S) @ twin.y).item())
        assert distances[k] == pytest.approx(joint, rel=1e-9)
    np.testing.assert_allclose(records["x"][0], twin.x[:, 0], rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(records["P"][0], twin.P, rtol=1e-9, atol=1e-11)


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 2**32 - 1), st.floats(1e-12, 1e6))
def test_covariance_stays_symmetric_and_non_negative(seed, variance):
    records, twin, measured = _case(3, 2, seed)
    records["P"] *= 1e6
    distances = np.zeros(measured.shape)
    _scalars(records, twin.H, measured, np.full(2, variance), distances)
    covariance = records["P"][0]
    np.testing.assert_array_equal(covariance, covariance.T)
    assert np.linalg.eigvalsh(covariance).min() >= -1e-12 * np.abs(covariance).max()


def test_a_measurement_without_information_changes_nothing():
    records = np.zeros(1, kalman.filter_type(2))
    distances = np.ones((1, 1))
    _scalars(records, np.ones((1, 2)), np.ones((1, 1)), np.zeros(1), distances)
    assert distances[0, 0] == 0.0
    assert not records["x"].any()
    assert not records["P"].any()


def test_measurements_with_a_singular_innovation_are_infinitely_far():
    records = np.zeros(1, kalman.filter_type(2, 1))
    distance = kalman.innovation_distance(records[0])
    assert distance == np.inf


def test_a_filter_with_outputs_is_no_subtype_of_one_without():
    plain, joint = kalman.filter_type(2), kalman.filter_type(2, 2)
    assert joint.names[: len(plain.names)] != plain.names
