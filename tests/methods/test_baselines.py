"""Baselines: each against its closed form, and robust to what is missing."""

import numpy as np
import pytest

from gripbench.bench.catalogue.registry import built_in_methods
from gripbench.envs.vehicles import load_vehicle

CAR = load_vehicle("yoon2015_pickup").values() | {"friction_prior": 0.7, "friction_prior_std": 0.2}
BASELINES = {name: kind for name, kind in built_in_methods().items() if kind.baseline}
EACH = [(kind, variant) for kind in BASELINES.values() for variant in ("corrected", *kind.variants)]


def samples(n=2001, **channels):
    observations = np.zeros(n, [(name, float) for name in ("time", *channels)])
    observations["time"] = np.linspace(0.0, 0.01 * (n - 1), n)
    for name, value in channels.items():
        observations[name] = value
    return observations


def test_they_are_marked_and_need_production_channels_only():
    assert set(BASELINES) == {
        "bicycle_on_paper", "constant_friction", "course_as_heading", "force_of_acceleration",
        "kinematic_integration", "specific_force", "zero_sideslip",
    }  # fmt: skip
    production = {"accel_x", "accel_y", "yaw_rate", "steer_angle", "course"}
    for kind in BASELINES.values():
        assert set(kind().sensors) <= production | {
            f"wheel_speed_rear_{side}" for side in ("left", "right")
        }


def test_constants():
    observations = samples(3)
    friction = BASELINES["constant_friction"]
    assert friction().run({}, observations)["mu_front"].tolist() == [0.8] * 3
    prior = friction("prior").run(CAR, observations)
    assert prior["mu"].tolist() == [0.7] * 3
    assert prior["mu_rear_variance"] == pytest.approx(0.04)
    zero = BASELINES["zero_sideslip"]().run({}, observations)
    assert not zero["sideslip"].any()


def test_a_bicycle_in_a_steady_turn():
    """Forces of the linear axles hold the steady turn that the baseline gives."""
    speed, rate = 20.0, 0.2
    observations = samples(2, speed_x=speed, yaw_rate=rate)
    beta = BASELINES["bicycle_on_paper"]("measured_speed").run(CAR, observations)["sideslip"][-1]
    a, b = CAR["cg_to_front"], CAR["cg_to_rear"]
    rear = CAR["cornering_stiffness_rear"] * (b * rate / speed - beta)
    assert rear == pytest.approx(CAR["mass"] * a / (a + b) * speed * rate)
    front = CAR["mass"] * b / (a + b) * speed * rate
    steer = front / CAR["cornering_stiffness_front"] + beta + a * rate / speed
    rolling = speed / CAR["wheel_radius"]
    wheels = dict.fromkeys(("wheel_speed_rear_left", "wheel_speed_rear_right"), rolling)
    steering = BASELINES["bicycle_on_paper"]("steering")
    again = steering.run(CAR, samples(2, steer_angle=steer, **wheels))["sideslip"][-1]
    assert again == pytest.approx(beta)


def test_kinematic_integration_forgets_in_a_second():
    """A constant rate c settles at c times the forgetting time, as c T (1 - exp(-t/T))."""
    observations = samples(accel_y=2.5, yaw_rate=0.1, speed_x=20.0)
    found = BASELINES["kinematic_integration"]("measured_speed").run(CAR, observations)
    expected = 0.5 * -np.expm1(-observations["time"])
    np.testing.assert_allclose(found["speed_y"], expected, atol=1e-12)
    np.testing.assert_allclose(found["sideslip"], np.arctan2(expected, 20.0), atol=1e-12)


def test_specific_force_holds_its_largest_value():
    observations = samples(accel_x=3.0, accel_y=4.0)
    observations["accel_x"][1000:] = observations["accel_y"][1000:] = 0.0
    found = BASELINES["specific_force"]().run(CAR, observations)
    assert found["mu"][-1] == found["mu"][999] == pytest.approx(5.0 / 9.81, rel=1e-6)
    assert found["mu_used"][-1] < 1e-6


def test_forces_share_newtons():
    found = BASELINES["force_of_acceleration"]().run(CAR, samples(2, accel_x=1.5))[-1]
    assert found["force_x_front"] + found["force_x_rear"] == pytest.approx(1.5 * CAR["mass"])


def test_heading_by_gyroscope():
    observations = samples(101, course=0.3, yaw_rate=0.5)
    found = BASELINES["course_as_heading"]("gyroscope").run(CAR, observations)
    assert found["yaw"][-1] == pytest.approx(0.3 + 0.5)


@pytest.mark.parametrize(("kind", "variant"), EACH)
def test_missing_samples_and_a_clock_that_steps_back(kind, variant):
    method = kind(variant)
    random = np.random.default_rng(0)
    observations = samples(200, **dict.fromkeys(method.sensors, 1.0))
    for name in method.sensors:
        observations[name] = random.normal(10.0, 1.0, 200)
        observations[name][random.random(200) < 0.3] = np.nan
    observations["time"][100:] -= 0.5
    found = method.run(CAR, observations)
    for name in method.outputs:
        assert np.isfinite(found[name]).all()
