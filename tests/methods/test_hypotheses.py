"""Interacting models against filterpy's, and the extended filters in the limit of linear tyres."""

import numpy as np
import pytest
from filterpy.kalman import IMMEstimator, KalmanFilter

from gripbench.bench.catalogue.registry import built_in_methods
from gripbench.envs.vehicles import load_vehicle
from gripbench.methods.baselines.bicycle_on_paper import steady_sideslip, steady_yaw_rate
from gripbench.methods.blocks.hypotheses import bank_type, mix, moments, put, score_of, take, weigh
from gripbench.methods.blocks.kalman import correct_scalar, filter_type, predict

CAR = load_vehicle("yoon2015_pickup").values()
ADAPTIVE = ("single_track_ekf", "joint_ekf", "dual_ekf", "imm_friction")


def test_a_bank_is_filterpys_interacting_multiple_model():
    random, n, k = np.random.default_rng(3), 2, 3
    prior, leaving = np.array([0.5, 0.3, 0.2]), 0.2
    transition = (1.0 - leaving) * np.eye(k) + leaving * np.tile(prior, (k, 1))
    F = np.array([[1.0, 0.1], [0.0, 1.0]])
    noises = [0.01, 0.1, 1.0]
    bank = np.zeros(1, bank_type(k, n)).view(np.recarray)[0]
    bank.prior[:] = bank.weight[:] = prior
    twins = []
    for j in range(k):
        bank.P[j] = np.eye(n)
        twin = KalmanFilter(n, 1)
        twin.F, twin.H, twin.Q = F, np.array([[1.0, 0.0]]), noises[j] * np.eye(n)
        twin.R, twin.P, twin.x = np.array([[0.5]]), np.eye(n), np.zeros((n, 1))
        twins.append(twin)
    imm = IMMEstimator(twins, prior.copy(), transition)
    filter = np.zeros(1, filter_type(n)).view(np.recarray)[0]
    for reading in np.cumsum(random.normal(size=40)):
        mix(bank, leaving, 1.0)
        for j in range(k):
            take(bank, j, filter)
            filter.F[:], filter.Q[:] = F, noises[j] * np.eye(n)
            predict(filter)
            filter.h[:] = 1.0, 0.0
            spread = filter.P[0, 0] + 0.5
            distance = correct_scalar(filter, reading - filter.x[0], 0.5)
            bank.score[j] = score_of(distance, spread)
            put(bank, j, filter)
        weigh(bank)
        imm.predict()
        imm.update(np.array([[reading]]))
        np.testing.assert_allclose(bank.weight, imm.mu, rtol=1e-6, atol=1e-9)
        mean, variance = moments(bank, 0)
        assert mean == pytest.approx(float(imm.x[0, 0]), rel=1e-6, abs=1e-9)
        assert variance == pytest.approx(float(imm.P[0, 0]), rel=1e-6)


def test_a_change_that_copies_no_state_moves_the_weights_alone():
    banks = [np.zeros(1, bank_type(3, 2)).view(np.recarray)[0] for _ in range(2)]
    for bank, copied in zip(banks, (1.0, 0.0), strict=True):
        bank.prior[:], bank.weight[:] = [0.5, 0.3, 0.2], [0.9, 0.09, 0.01]
        bank.x[:] = np.arange(6.0).reshape(3, 2)
        bank.P[:] = np.eye(2)
        mix(bank, 0.1, copied)
    np.testing.assert_allclose(
        banks[0].weight, 0.9 * np.array([0.9, 0.09, 0.01]) + 0.1 * bank.prior
    )
    np.testing.assert_array_equal(banks[1].weight, banks[0].weight)
    np.testing.assert_allclose(banks[1].mixed_x, banks[1].x)
    np.testing.assert_allclose(banks[1].mixed_P, banks[1].P)


def drive(n=3000, speed=15.0):
    """Return exact readings of the linear model on a sine of steering, and its lateral velocity."""
    m, inertia = CAR["mass"], CAR["yaw_inertia"]
    a, b = CAR["cg_to_front"], CAR["cg_to_rear"]
    front, rear = CAR["cornering_stiffness_front"], CAR["cornering_stiffness_rear"]
    names = ("time", "speed_x", "steer_angle", "yaw_rate", "accel_y")
    seen = np.zeros(n, [(name, float) for name in names])
    seen["time"], seen["speed_x"] = 0.005 * np.arange(n), speed
    seen["steer_angle"] = 0.004 * np.sin(1.5 * seen["time"])
    state, lateral = np.zeros(2), np.zeros(n)
    for k in range(n):
        steer = seen["steer_angle"][k]
        force_front = front * (steer - (state[0] + a * state[1]) / speed)
        force_rear = rear * (b * state[1] - state[0]) / speed
        seen["accel_y"][k] = (force_front + force_rear) / m
        seen["yaw_rate"][k], lateral[k] = state[1], state[0]
        rates = seen["accel_y"][k] - speed * state[1], (a * force_front - b * force_rear) / inertia
        state = state + 0.005 * np.array(rates)
    return seen, lateral


@pytest.mark.parametrize("name", ADAPTIVE)
def test_small_angles_are_linear_tyres_for_every_filter(name):
    seen, lateral = drive()
    found = built_in_methods()[name]("measured_speed").run(CAR, seen)
    late = seen["time"] > 2.0
    error = np.sqrt(np.mean((found["speed_y"] - lateral)[late] ** 2))
    assert error < 0.15 * np.sqrt(np.mean(lateral[late] ** 2))
    assert (found["sideslip_variance"] >= 0.0).all()


def test_the_kinematic_observer_settles_at_the_steady_turn():
    seen, _ = drive(n=6000, speed=20.0)
    params = np.rec.array(np.array([tuple(CAR.values())], [(n, float) for n in CAR]))[0]
    seen["steer_angle"] = 0.01
    rate = steady_yaw_rate(20.0, 0.01, params)
    seen["yaw_rate"], seen["accel_y"] = rate, 20.0 * rate
    found = built_in_methods()["kinematic_observer"]("measured_speed").run(CAR, seen)
    expected = np.arctan(steady_sideslip(20.0, rate, params))
    assert found["sideslip"][-1] == pytest.approx(expected, rel=0.02)
