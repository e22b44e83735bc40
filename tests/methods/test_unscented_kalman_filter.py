"""The unscented filter against filterpy's, on a slalom that saturates the tyres."""

import numpy as np
import pytest
from filterpy.kalman import JulierSigmaPoints
from filterpy.kalman import UnscentedKalmanFilter as Twin
from track_twin import drive, rates

from gripbench.methods.blocks.kalman import correct_scalar, filter_type, predict
from gripbench.methods.blocks.unscented import cholesky, correct, draw, gather, unscented_type
from gripbench.methods.unscented_kalman_filter import UnscentedKalmanFilter


def test_it_is_its_filterpy_twin():
    run = drive()
    car, seen = run.vehicle, run.observations[:1400]
    method = UnscentedKalmanFilter("measured_speed")
    found, noise = method.run(car, seen), method.settings
    twin = Twin(5, 2, 0.01, hx=None, fx=None, points=JulierSigmaPoints(5, kappa=0.0))
    twin.x = np.array([0.0, seen["yaw_rate"][0], 0.0, 0.0, np.log(noise["friction_mean"])])
    first = ["speed_y_std", None, "stiffness_std", "stiffness_std", "friction_std"]
    twin.P = np.diag([noise[name] ** 2 if name else 1.0 for name in first])
    walks = ["speed_y_walk", "yaw_rate_walk", "stiffness_walk", "stiffness_walk", "friction_walk"]

    def moved(x, dt):
        lateral, turning, _ = rates(x, speed, steer, car)
        return x + dt * np.array([lateral, turning, 0.0, 0.0, 0.0])

    def readings(x):
        return np.array([x[1], rates(x, speed, steer, car)[2]])

    for k in range(1, len(seen)):
        speed, steer = max(seen["speed_x"][k], 3.0), seen["steer_angle"][k]
        span = seen["time"][k] - seen["time"][k - 1]
        twin.Q = np.diag([noise[name] ** 2 * span for name in walks])
        twin.R = np.diag([noise["gyro_noise"] ** 2 / span, noise["accel_y_noise"] ** 2 / span])
        twin.predict(dt=span, fx=moved)
        twin.sigmas_f = twin.points_fn.sigma_points(twin.x, twin.P)
        twin.update(np.array([seen["yaw_rate"][k], seen["accel_y"][k]]), hx=readings)
        assert found["speed_y"][k] == pytest.approx(twin.x[0], abs=1e-6)
        assert found["speed_y_variance"][k] == pytest.approx(twin.P[0, 0], rel=1e-5)
        twin.x[2:4] = np.clip(twin.x[2:4], -1.0, 1.0)
        twin.x[4] = np.clip(twin.x[4], np.log(0.05), np.log(1.4))
    assert np.abs(found["sideslip"]).max() > 0.05  # the tyres were at their limit


def test_of_a_linear_model_it_is_the_kalman_filter():
    rng = np.random.default_rng(3)
    F = np.eye(3) + 0.1 * rng.standard_normal((3, 3))
    H = rng.standard_normal((2, 3))
    plain, points = np.zeros(1, filter_type(3)), np.zeros(1, unscented_type(3, 2))
    plain["P"][0], plain["F"][0], plain["Q"][0] = np.eye(3), F, 0.1 * np.eye(3)
    points["P"][0], points["Q"][0], points["R"][0] = np.eye(3), 0.1 * np.eye(3), np.diag([0.2, 0.3])
    one, other = np.rec.array(plain)[0], np.rec.array(points)[0]
    for reading in rng.standard_normal((20, 2)):
        predict(one)
        for row, value, variance in zip(H, reading, (0.2, 0.3), strict=True):
            one.h[:] = row
            correct_scalar(one, value - row @ one.x, variance)
        draw(other)
        other.points[:] = other.points @ F.T
        gather(other)
        draw(other)
        other.outputs[:] = other.points @ H.T
        correct(other, reading)
        np.testing.assert_allclose(other.x, one.x, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(other.P, one.P, rtol=1e-9, atol=1e-12)


def test_cholesky_says_what_has_no_root():
    root = np.zeros((2, 2))
    assert not cholesky(np.array([[1.0, 2.0], [2.0, 1.0]]), root)
    assert cholesky(np.array([[4.0, 2.0], [2.0, 3.0]]), root)
    np.testing.assert_allclose(root @ root.T, [[4.0, 2.0], [2.0, 3.0]])
