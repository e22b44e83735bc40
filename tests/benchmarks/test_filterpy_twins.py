"""A step of the compiled Kalman filter beside filterpy's, for the same filter of the same size."""

import numba
import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from gripbench.methods.blocks.kalman import correct_scalar, filter_type, predict

STEPS = 2000
SIZES = (2, 3, 4, 5)


@numba.njit
def _run(records, measured):
    filter = records[0]
    for k in range(measured.shape[0]):
        predict(filter)
        correct_scalar(filter, measured[k] - filter.x[0], 1.0)


def matrices(states):
    F = np.eye(states) + 0.01 * np.eye(states, k=1)
    return F, 0.01 * np.eye(states), np.eye(1, states)


@pytest.mark.parametrize("states", SIZES)
@pytest.mark.benchmark(group="kalman filter step")
def test_compiled(benchmark, states):
    F, Q, H = matrices(states)
    records = np.zeros(1, filter_type(states))
    records["F"][0], records["Q"][0], records["h"][0] = F, Q, H[0]
    records["P"][0] = np.eye(states)
    measured = np.random.default_rng(0).standard_normal(STEPS)
    benchmark.extra_info["steps"] = STEPS
    benchmark(_run, records, measured)
    assert np.isfinite(records["x"]).all()


@pytest.mark.parametrize("states", SIZES)
@pytest.mark.benchmark(group="kalman filter step")
def test_filterpy(benchmark, states):
    filter = KalmanFilter(dim_x=states, dim_z=1)
    filter.F, filter.Q, filter.H = matrices(states)
    measured = np.random.default_rng(0).standard_normal(STEPS)

    def run():
        for z in measured:
            filter.predict()
            filter.update(z)

    benchmark.extra_info["steps"] = STEPS
    benchmark.pedantic(run, rounds=3)
    assert np.isfinite(filter.x).all()
