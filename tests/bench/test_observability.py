"""Observability: Lie derivatives of a model in closed form, and the rank of the Dugoff model."""

import numpy as np
import pytest

from gripbench.bench.scoring.observability import dugoff_observability, observability_matrix
from gripbench.envs.worlds import load_scenario, record
from gripbench.methods.dugoff_ekf import DugoffEkf


def pendulum(x):
    """Angle, rate and unknown stiffness; f = (w, -k sin(a), 0)."""
    angle, rate, k = x
    f = np.array([rate, -k * np.sin(angle), 0.0])
    slope = np.array([[0, 1, 0], [-k * np.cos(angle), 0, -np.sin(angle)], [0, 0, 0]], dtype=float)
    return f, slope


def test_matrix_of_a_pendulum():
    """h = a, L_f h = w, L_f^2 h = -k sin(a)."""
    x = np.array([0.7, 0.3, 2.0])
    matrix = observability_matrix(pendulum, x, np.array([[1.0, 0.0, 0.0]]))
    expected = [[1, 0, 0], [0, 1, 0], [-2.0 * np.cos(0.7), 0, -np.sin(0.7)]]
    np.testing.assert_allclose(matrix, expected, atol=1e-8)


def test_second_lie_derivative_has_the_bend_of_the_model():
    """With h = w: L_f h = -k sin(a), L_f^2 h = -k cos(a) w."""
    a, w, k = 0.7, 0.3, 2.0
    matrix = observability_matrix(pendulum, np.array([a, w, k]), np.array([[0.0, 1.0, 0.0]]))
    expected = [k * np.sin(a) * w, -k * np.cos(a), -np.cos(a) * w]
    np.testing.assert_allclose(matrix[2], expected, atol=1e-7)


@pytest.fixture(scope="module")
def run():
    scenario = load_scenario("dakhlallah_mild").model_copy(update={"horizon": 8.0})
    recording = record(scenario, 0)
    return recording, DugoffEkf().run(recording.vehicle, recording.observations)


def test_states_are_observable_from_speed_and_yaw_rate(run):
    recording, estimates = run
    result = dugoff_observability(recording.vehicle, recording.observations, estimates)
    assert len(result.rank) == len(result.time) == 81
    assert np.all(result.rank == 3)
    assert result.condition.max() < 10.0


def test_lateral_speed_is_not_observable_from_speed_straight_ahead(run):
    """Straight ahead, v_x tells nothing of the lateral motion."""
    recording, estimates = run
    vehicle, obs = recording.vehicle, recording.observations[:1].copy()
    start = estimates[:1].copy()
    for name in ("speed_y", "yaw_rate"):
        start[name] = 0.0
    obs["steer_angle"], obs["accel_x"], obs["accel_y"] = 0.0, 0.0, 0.0
    for wheel in ("front_left", "front_right", "rear_left", "rear_right"):
        obs[f"wheel_speed_{wheel}"] = start["speed_x"] / vehicle["wheel_radius"]
    alone = dugoff_observability(vehicle, obs, start, outputs=("speed_x",))
    both = dugoff_observability(vehicle, obs, start)
    assert (alone.rank[0], both.rank[0]) == (1, 3)
