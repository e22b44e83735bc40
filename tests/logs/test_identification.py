"""Identification finds the parameters of a model that is known."""

import dataclasses

import numpy as np
import pytest

from gripbench.envs.recordings import Recording
from gripbench.envs.signals import record_type
from gripbench.envs.vehicles import Value, Vehicle, load_vehicle
from gripbench.errors import InputError
from gripbench.logs.vehicle.identification import (
    Identified,
    identify_steering,
    identify_tyres,
)
from gripbench.logs.vehicle.identified_vehicles import identified_vehicle, write_vehicle

FRONT, REAR, MASS = 1.2, 1.5, 1500.0
STIFF_FRONT, STIFF_REAR, MU, GYRATION = 55.0, 70.0, 0.7, 1.7
WINDOWS = {"train": ((0.0, 40.0),), "test": ((40.0, 60.0),)}


def _brush(slip, stiffness, largest):
    # Parabolic pressure: the adhesion range ends where the slope of the force is zero.
    limit = 3.0 * largest / stiffness
    x = np.minimum(np.abs(np.tan(slip)) / limit, 1.0)
    return np.sign(slip) * largest * (1.0 - (1.0 - x) ** 3)


def _drive(noise=0.02, steer_scale=1.0):
    """A car in a weave of rising amplitude, integrated with Euler steps of 1 ms."""
    rng = np.random.default_rng(2)
    step, seconds = 0.001, 60.0
    count = int(seconds / step)
    seen = np.zeros(count // 10, record_type(["time", "steer_angle"]))
    truth = np.zeros(
        count // 10, record_type(["time", "speed_x", "speed_y", "yaw_rate", "accel_y"])
    )
    base, v, v_y, r = FRONT + REAR, 15.0, 0.0, 0.0
    for k in range(count):
        t = k * step
        steer = (0.02 + 0.002 * t) * np.sin(1.5 * t + 0.3 * np.sin(0.2 * t))
        slip_front = steer - np.arctan2(v_y + FRONT * r, v)
        slip_rear = -np.arctan2(v_y - REAR * r, v)
        front = _brush(slip_front, STIFF_FRONT, MU * 9.81 * REAR / base) * np.cos(steer)
        rear = _brush(slip_rear, STIFF_REAR, MU * 9.81 * FRONT / base)
        if k % 10 == 0:
            seen[k // 10] = (t, steer / steer_scale)
            truth[k // 10] = (t, v, v_y, r, front + rear)
        v_y += step * (front + rear - v * r)
        r += step * (FRONT * front - REAR * rear) / GYRATION
    for name in ("speed_y", "yaw_rate", "accel_y"):
        truth[name] += noise * rng.standard_normal(len(truth)) * np.std(truth[name])
    vehicle = {"cg_to_front": FRONT, "cg_to_rear": REAR, "mass": MASS}
    return Recording("weave", 0, vehicle, seen, truth, windows=WINDOWS)


@pytest.fixture(scope="module")
def weave():
    return _drive(steer_scale=1.1)


def test_tyres_friction_inertia_and_steering_are_found(weave):
    found = identify_tyres([weave])
    truth = {
        "stiffness_front": STIFF_FRONT, "stiffness_rear": STIFF_REAR, "mu": MU,
        "gyration_squared": GYRATION, "steer_scale": 1.1, "steer_offset": 0.0,
    }  # fmt: skip
    for name, value in truth.items():
        assert abs(found.values[name] - value) < max(5.0 * found.deviations[name], 0.05 * value), (
            name
        )
    assert found.values["stiffness_front"] == pytest.approx(STIFF_FRONT, rel=0.1)
    assert found.values["mu"] == pytest.approx(MU, rel=0.05)
    assert found.test_rms is not None
    assert found.test_rms < 2.0 * found.train_rms


def test_test_window_does_not_touch_the_fit(weave):
    spoilt = weave.truth.copy()
    spoilt["accel_y"][spoilt["time"] > 40.5] *= -1.0
    other = Recording("weave", 0, weave.vehicle, weave.observations, spoilt, windows=WINDOWS)
    assert identify_tyres([other]).values == identify_tyres([weave]).values


def test_vehicle_file_of_what_was_found(weave, tmp_path):
    value = Value(value=MASS, source="scales")
    vehicle = Vehicle(name="car", description='a "car"', parameters={"mass": value})
    found = identify_tyres([weave])
    write_vehicle(identified_vehicle(vehicle, found, "weave"), tmp_path / "car.toml")
    read = load_vehicle(str(tmp_path / "car.toml"))
    expected = MASS * found.values["stiffness_front"]
    assert read.values()["cornering_stiffness_front"] == pytest.approx(expected, rel=1e-3)
    assert "identified from weave" in read.parameters["cornering_stiffness_front"].source
    assert read.parameters["mass"] == value


def test_steering_ratio_offset_and_understeer():
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 200.0, 0.02)
    speed = 15.0 + 8.0 * np.sin(0.05 * time)
    yaw_rate = 0.15 * np.sin(0.11 * time)
    wheel = 0.01 + 16.0 * ((FRONT + REAR) * yaw_rate / speed + 0.03 * speed * yaw_rate / 9.81)
    seen = np.zeros(len(time), record_type(["time", "steer_angle", "yaw_rate", "speed_gps"]))
    seen["time"], seen["speed_gps"] = time, speed
    seen["yaw_rate"] = yaw_rate + 0.001 * rng.standard_normal(len(time))
    seen["steer_angle"] = 0.05 * wheel
    truth = np.zeros(len(time), record_type(["time"]))
    truth["time"] = time
    windows = {"train": ((0.0, 150.0),), "test": ((150.0, 200.0),)}
    vehicle = {"cg_to_front": FRONT, "cg_to_rear": REAR}
    recording = Recording("turns", 0, vehicle, seen, truth, windows=windows)
    found = identify_steering([recording], known_scale=0.05)
    for name, value in (
        ("steering_ratio", 16.0), ("steer_offset", 0.01), ("understeer_gradient", 0.03),
    ):  # fmt: skip
        assert found.values[name] == pytest.approx(value, rel=0.03), name
        assert abs(found.values[name] - value) < 6.0 * found.deviations[name] + 0.01 * value


def test_missing_window_is_named(weave):
    bare = Recording("weave", 0, weave.vehicle, weave.observations, weave.truth)
    with pytest.raises(InputError, match="no window 'train'"):
        identify_tyres([bare])
    blind = Recording("weave", 0, weave.vehicle, weave.observations, weave.truth[["time"]])
    with pytest.raises(
        InputError,
        match=r"weave: nothing to identify from.*no .speed_x or speed_gps",
    ):
        identify_tyres([blind])


def test_friction_below_what_the_window_holds_is_said_to_be_undetermined(weave):
    found = identify_tyres([weave], friction=0.9)
    assert "mu" not in found.values
    assert found.undetermined() is None or "mu" not in found.undetermined()
    wrong = dataclasses.replace(found, values=found.values | {"mu": 0.9 * found.reached})
    wrong = dataclasses.replace(wrong, deviations=found.deviations | {"mu": 0.01})
    assert "only that bound is known" in wrong.undetermined()
    assert found.reached == pytest.approx(
        np.max(np.abs(weave.truth["accel_y"])[:4000]) / 9.81, rel=0.1
    )


def test_a_ratio_that_a_straight_drive_cannot_tell_is_named():
    found = Identified({"steering_ratio": 57.0}, {"steering_ratio": 19.0}, 0.0, None, "rad", 100)
    assert "steering_ratio (57 with a standard deviation of 19)" in found.undetermined()
    sure = dataclasses.replace(found, deviations={"steering_ratio": 2.0})
    assert sure.undetermined() is None


def test_linear_tyres_are_found_without_bias():
    """A friction at the end of its range would bend the curve: a stiffness 5 to 9 % too large."""
    rng = np.random.default_rng(4)
    time = np.arange(0.0, 60.0, 0.01)
    seen = np.zeros(len(time), record_type(["time", "steer_angle"]))
    names = ["time", "speed_x", "speed_y", "yaw_rate", "accel_y"]
    truth = np.zeros(len(time), record_type(names))
    v, v_y, r = 20.0, 0.0, 0.0
    for k, t in enumerate(time):
        steer = 0.04 * np.sin(0.8 * t) + 0.02 * np.sin(2.1 * t)
        front = STIFF_FRONT * np.tan(steer - np.arctan2(v_y + FRONT * r, v)) * np.cos(steer)
        rear = -STIFF_REAR * np.tan(np.arctan2(v_y - REAR * r, v))
        seen[k], truth[k] = (t, steer), (t, v, v_y, r, front + rear)
        for _ in range(10):
            front = STIFF_FRONT * np.tan(steer - np.arctan2(v_y + FRONT * r, v)) * np.cos(steer)
            rear = -STIFF_REAR * np.tan(np.arctan2(v_y - REAR * r, v))
            v_y += 0.001 * (front + rear - v * r)
            r += 0.001 * (FRONT * front - REAR * rear) / GYRATION
    truth["accel_y"] += 0.05 * rng.standard_normal(len(time))
    vehicle = {"cg_to_front": FRONT, "cg_to_rear": REAR, "mass": MASS}
    found = identify_tyres([Recording("linear", 0, vehicle, seen, truth, windows=WINDOWS)])
    assert found.linear
    assert "mu" not in found.values
    assert "the tyres stay linear" in found.undetermined()
    assert found.values["stiffness_front"] == pytest.approx(STIFF_FRONT, rel=0.01)
    assert found.values["stiffness_rear"] == pytest.approx(STIFF_REAR, rel=0.01)
