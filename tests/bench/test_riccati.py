"""Steady-state covariance: the running filter settles at it; Table I's yaw rate."""

import numpy as np
import pytest

from gripbench.bench.papers.anderson2004.riccati import steady_state
from gripbench.envs.signals import record_type
from gripbench.envs.vehicles import load_vehicle
from gripbench.methods.model_based_kalman_filter import ModelBasedKalmanFilter

VEHICLE = load_vehicle("anderson2004_blazer").values()


def degrees_at(rate, gyro, course, steer_noise=1.0):
    state = steady_state(
        VEHICLE,
        speed=30.0,
        rate=rate,
        gyro_std=np.radians(gyro),
        course_std=np.radians(course),
        steer_noise=np.radians(steer_noise),
        bias_walk=np.radians(0.005),
    )
    return np.degrees([state.sideslip, state.yaw_rate])


@pytest.mark.parametrize(
    ("rate", "gyro", "course", "printed"),
    [
        (5.0, 0.0671, 0.0086, 0.0636),
        (20.0, 0.1342, 0.0171, 0.1272),
        (50.0, 0.2121, 0.0270, 0.2012),
        (100.0, 0.3, 0.0382, 0.2845),
    ],
)
def test_yaw_rate_of_table_1(rate, gyro, course, printed):
    assert degrees_at(rate, gyro, course)[1] == pytest.approx(printed, rel=0.02)


def test_no_steering_noise_gives_the_sideslip_of_table_1():
    """Printed is 0.1558 deg at 100 Hz."""
    sideslip = [degrees_at(100.0, 0.3, 0.0382, q)[0] for q in np.geomspace(1e-3, 1e3, 13)]
    assert np.all(np.diff(sideslip) > -1e-12)
    assert max(sideslip) < 0.1 * 0.1558 + 1e-3


def test_the_running_filter_settles_at_the_solution():
    """Both measurements in every sample at 20 Hz, for a minute."""
    step, n = 0.05, 1200
    obs = np.zeros(n, record_type(("time", *ModelBasedKalmanFilter.sensors)))
    obs["time"] = obs["gps_time"] = step * np.arange(n)
    obs["course_new"], obs["speed_gps"] = 1.0, 30.0
    noise = {"gyro_noise": 5e-4, "steer_noise": 2e-4, "bias_walk": 1e-3}
    method = ModelBasedKalmanFilter(gps_speed_noise=0.05, **noise)
    settled = method.run(VEHICLE, obs)[-1]
    expected = steady_state(
        VEHICLE,
        speed=30.0,
        rate=1.0 / step,
        gyro_std=noise["gyro_noise"] / np.sqrt(step),
        course_std=0.05 / 30.0,
        steer_noise=noise["steer_noise"],
        bias_walk=noise["bias_walk"],
    )
    for name in ("sideslip", "yaw_rate", "yaw", "gyro_bias"):
        assert np.sqrt(settled[name + "_variance"]) == pytest.approx(
            getattr(expected, name), rel=1e-6
        )
