"""The friction filter behind a measured velocity, on a drive that its own tyre model makes."""

import numpy as np
import pytest

from gripbench.envs.signals import record_type
from gripbench.methods.friction_ekf import lateral_acceleration, slip_angles
from gripbench.methods.velocity_friction_ekf import VelocityFrictionEkf

VEHICLE = {
    "mass": 1500.0, "cg_to_front": 1.2, "cg_to_rear": 1.5,
    "cornering_stiffness_front": 80e3, "cornering_stiffness_rear": 90e3,
}  # fmt: skip


def _drive(friction, noise=0.2, count=4000):
    rng = np.random.default_rng(4)
    params = np.zeros(1, [(name, float) for name in VEHICLE])
    for name, value in VEHICLE.items():
        params[name] = value
    seen = np.zeros(count, record_type(("time", *VelocityFrictionEkf.sensors)))
    seen["time"] = np.arange(count) * 0.01
    seen["speed_x"] = 12.0
    seen["speed_y"] = -0.8 * np.sin(0.8 * seen["time"])
    seen["yaw_rate"] = 0.25 * np.sin(0.8 * seen["time"])
    seen["steer_angle"] = 0.12 * np.sin(0.8 * seen["time"])
    fresh = np.arange(count) % 5 == 0
    for k in range(count):
        mu = friction(seen["time"][k])
        row = seen[k]
        front, rear = slip_angles(
            row["speed_x"], row["speed_y"], row["yaw_rate"], row["steer_angle"], params[0]
        )
        row["accel_y"] = lateral_acceleration(mu, front, rear, row["steer_angle"], params[0])[0]
    seen["accel_y"] += noise * rng.standard_normal(count)
    seen["accel_y"] = seen["accel_y"][np.arange(count) // 5 * 5]
    seen["accel_y_new"] = fresh
    return seen


@pytest.mark.parametrize("mu", [0.2, 0.35, 0.6])
def test_friction_is_found_with_a_sound_variance(mu):
    seen = _drive(lambda _: mu)
    # A held reading belongs to the sample at which it came, so only those rows are compared.
    estimates = VelocityFrictionEkf(accel_y_density=0.05).run(
        VEHICLE, seen[seen["accel_y_new"] > 0]
    )
    assert estimates["mu"][-1] == pytest.approx(mu, abs=0.02)
    assert 0.0 < estimates["mu_variance"][-1] < 0.01


def test_held_readings_count_once():
    seen = _drive(lambda _: 0.4)
    method = VelocityFrictionEkf()
    every = method.run(VEHICLE, seen)["mu"][seen["accel_y_new"] > 0]
    only = method.run(VEHICLE, seen[seen["accel_y_new"] > 0])["mu"]
    np.testing.assert_array_equal(every, only)


def test_a_step_of_the_friction_is_followed():
    seen = _drive(lambda time: 0.6 if time < 20.0 else 0.3)
    method = VelocityFrictionEkf(mu_walk=0.1)
    mu = method.run(VEHICLE, seen)["mu"]
    assert mu[1900] == pytest.approx(0.6, abs=0.06)
    assert mu[-1] == pytest.approx(0.3, abs=0.06)
