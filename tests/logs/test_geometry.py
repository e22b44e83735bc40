"""Whatever the sensors' places, axes and units: mapped, the log equals the clean one."""

import copy

import numpy as np
import pytest
from single_track import MAP, drive

from gripbench.errors import InputError
from gripbench.logs.channels.geometry import rotation
from gripbench.logs.importing import import_frame

G = 9.81


@pytest.fixture(scope="module")
def frame():
    return drive(20.0, noise=0.0)


def _imported(frame, content):
    return import_frame(frame, content).recordings[0]


def _same(found, frame, name, column, tolerance, part="observations"):
    seen = getattr(found, part)[name]
    np.testing.assert_allclose(seen[50:-50], frame[column].to_numpy()[50:-50], atol=tolerance)


def _with(changes):
    content = copy.deepcopy(MAP)
    for key, value in changes.items():
        place = content
        *path, last = key.split(".")
        for part in path:
            place = place.setdefault(part, {})
        place[last] = value
    return content


@pytest.mark.parametrize("place", [(1.4, 0.0, 0.0), (-0.8, 0.5, 0.4)])
def test_lever_arms(frame, place):
    """Velocity v + omega x p, acceleration by its derivative: two ways to the same sensor."""
    x, y, _ = place
    step = frame["t"][1]
    r, v, vy = frame["r"].to_numpy(), frame["v"].to_numpy(), frame["vy"].to_numpy()
    spin = np.gradient(r, step)
    there = frame.assign(
        ax=frame["ax"] - spin * y - r**2 * x,
        ay=frame["ay"] + spin * x - r**2 * y,
        beta=np.arctan2(vy + r * x, v - r * y),
    )
    arm = {"position": list(place)}
    content = _with(
        {
            "sensors.imu": arm, "sensors.optical": arm, "channels.accel_x.sensor": "imu",
            "channels.accel_y.sensor": "imu", "reference.sideslip.sensor": "optical",
        }
    )  # fmt: skip
    found = _imported(there, content)
    _same(found, frame, "accel_x", "ax", 0.03)
    _same(found, frame, "accel_y", "ay", 0.03)
    np.testing.assert_allclose(
        found.truth["sideslip"][50:-50], np.arctan2(vy, v)[50:-50], atol=2e-4
    )


def test_reference_ahead_carries_a_mapped_sideslip(frame):
    there = frame.assign(
        vy=frame["vy"] + 1.5 * frame["r"],
        beta=np.arctan2(frame["vy"] + 1.5 * frame["r"], frame["v"]),
    )
    content = _with({"derived.reference_ahead": 1.5})
    content["reference"] |= {
        "speed_x": {"column": "v", "unit": "m/s"}, "speed_y": {"column": "vy", "unit": "m/s"},
        "yaw_rate": {"column": "r", "unit": "rad/s"},
    }  # fmt: skip
    found = _imported(there, content)
    _same(found, frame, "speed_y", "vy", 1e-9, "truth")
    _same(found, frame, "sideslip", "beta", 1e-9, "truth")


@pytest.mark.parametrize("angles", [(0.0, 0.0, 90.0), (5.0, -8.0, 30.0), (180.0, 0.0, 0.0)])
def test_mounting_rotation(frame, angles):
    matrix = rotation(angles)
    vector = np.stack([frame["ax"], frame["ay"], np.full(len(frame), G)])
    rates = np.stack([np.zeros(len(frame)), np.zeros(len(frame)), frame["r"]])
    measured, turned = matrix.T @ vector, matrix.T @ rates
    there = frame.assign(
        ax=measured[0], ay=measured[1], az=measured[2], p=turned[0], q=turned[1], r=turned[2]
    )
    content = _with(
        {
            "sensors.imu.rotation": list(angles),
            "channels.accel_z": {"column": "az", "unit": "m/s^2"},
            "channels.roll_rate": {"column": "p", "unit": "rad/s"},
            "channels.pitch_rate": {"column": "q", "unit": "rad/s"},
        }
    )
    for name in ("accel_x", "accel_y", "accel_z", "roll_rate", "pitch_rate", "yaw_rate"):
        content["channels"][name]["sensor"] = "imu"
    found = _imported(there, content)
    for name, column in (("accel_x", "ax"), ("accel_y", "ay"), ("yaw_rate", "r")):
        _same(found, frame, name, column, 1e-9)


def test_a_rotation_that_needs_an_unmapped_component_is_refused(frame):
    content = _with({"sensors.imu.rotation": [5.0, 0.0, 0.0], "channels.accel_y.sensor": "imu"})
    with pytest.raises(InputError, match=r"sensors\.imu\.rotation.*needs 'accel_z'"):
        _imported(frame, content)


def test_sae_axes_by_one_key(frame):
    turned = frame.assign(ay=-frame["ay"], r=-frame["r"], d=-frame["d"], beta=-frame["beta"])
    found = _imported(turned, _with({"axes": "SAE"}))
    for name, column in (("accel_x", "ax"), ("accel_y", "ay"), ("yaw_rate", "r"),
                         ("steer_angle", "d"), ("speed_x", "v")):  # fmt: skip
        _same(found, frame, name, column, 1e-12)
    _same(found, frame, "sideslip", "beta", 1e-12, "truth")


def test_steering_by_ratio_table_and_speed(frame):
    wheel = np.rad2deg(frame["d"]) * 16.0 + 3.0
    entry = {"column": "sw", "unit": "deg", "offset": 3.0}
    for more, column in (
        ({"scale": 1.0 / 16.0}, wheel),
        ({"table": [[-600.0, -37.5], [0.0, 0.0], [600.0, 37.5]]}, wheel),
        (
            {"ratio_over_speed": [[0.0, 12.0], [40.0, 20.0]]},
            np.rad2deg(frame["d"]) * (12.0 + 0.2 * frame["v"]) + 3.0,
        ),
    ):
        content = _with({"channels.steer_angle": entry | more})
        _same(_imported(frame.assign(sw=column), content), frame, "steer_angle", "d", 1e-12)


def test_wheel_speeds_from_everything(frame):
    omega = frame["v"] / 0.3
    step = frame["t"][1]
    count = np.floor(np.cumsum(omega) * step / (2.0 * np.pi) * 48.0) % 256.0
    for entry, column, tolerance in (
        ({"unit": "rpm"}, omega * 30.0 / np.pi, 1e-9),
        ({"unit": "km/h", "per": "wheel_radius", "radius": 0.3}, 3.6 * frame["v"], 1e-9),
        ({"unit": "rev/s", "pulses": 48}, omega / (2.0 * np.pi) * 48.0, 1e-9),
        ({"unit": "rev/s", "pulses": 48, "rollover": 256.0, "rate_over": 0.4}, count, 0.9),
    ):
        content = _with({"channels.wheel_speed_rear": {"column": "w"} | entry})
        found = _imported(frame.assign(w=column), content)
        seen, truth = found.observations["wheel_speed_rear"], np.asarray(omega)
        at = np.searchsorted(frame["t"], found.observations["time"] + found.notes["time_origin"])
        np.testing.assert_allclose(seen[50:-50], truth[at][50:-50], atol=tolerance)


def test_torques_from_pressure_engine_and_gear(frame):
    n = len(frame)
    gear = np.where(np.arange(n) < n // 2, 1.0, 2.0)
    more = frame.assign(p=np.linspace(0.0, 2e6, n), e=100.0, gear=gear)
    content = _with({"brake.front": {"pressure": {"column": "p", "unit": "Pa"},
                                     "torque_per_bar": 25.0}})  # fmt: skip
    content["drive"] = {
        "axle": "rear", "engine": {"column": "e", "unit": "N m"},
        "gear": {"column": "gear", "unit": "-"}, "ratios": {"1": 3.5, "2": 2.0},
        "final_drive": 4.0, "efficiency": 0.9,
    }  # fmt: skip
    seen = _imported(more, content).observations
    np.testing.assert_allclose(seen["torque_front"], -np.linspace(0.0, 500.0, n))
    np.testing.assert_allclose(seen["torque_rear"], np.where(gear == 1.0, 1260.0, 720.0))
    del content["drive"]["ratios"]["2"]
    with pytest.raises(InputError, match=r"drive\.ratios.*gear 2"):
        _imported(more, content)


def test_positions_from_latitude_and_longitude(frame):
    pytest.importorskip("pymap3d")
    radius = 6378137.0  # at the equator a small step east is an angle over this radius
    more = frame.assign(
        lat=np.rad2deg(frame["north"] / 6335439.327), lon=np.rad2deg(-frame["west"] / radius)
    )
    content = _with(
        {
            "geodetic.latitude": {"column": "lat", "unit": "deg"},
            "geodetic.longitude": {"column": "lon", "unit": "deg"},
            "geodetic.origin": [0.0, 0.0, 0.0],
        }
    )
    found = _imported(more, content)
    _same(found, frame, "position_x", "north", 0.02, "truth")
    _same(found, frame, "position_y", "west", 0.02, "truth")


def test_yaw_from_a_quaternion(frame):
    half = 0.5 * frame["yaw"]
    more = frame.assign(qx=0.0, qy=0.0, qz=np.sin(half), qw=np.cos(half))
    content = _with({"attitude.quaternion": ["qx", "qy", "qz", "qw"]})
    _same(_imported(more, content), frame, "yaw", "yaw", 1e-9, "truth")


def test_gravity_of_a_rolled_accelerometer_is_taken_off(frame):
    roll = 0.02 * frame["ay"] / G
    more = frame.assign(ay=frame["ay"] + G * np.sin(roll), roll=roll)
    content = _with({"level.roll": "roll"})
    content["reference"]["roll"] = {"column": "roll", "unit": "rad"}
    _same(_imported(more, content), frame, "accel_y", "ay", 1e-2)


def test_course_from_velocities(frame):
    course = frame["yaw"] + frame["beta"]
    more = frame.assign(vn=frame["v"] * np.cos(course), ve=-frame["v"] * np.sin(course))
    content = _with({"derived.course_from_velocity": True})
    content["channels"] |= {
        "velocity_north": {"column": "vn", "unit": "m/s"},
        "velocity_west": {"column": "ve", "unit": "m/s", "sign": -1},
    }
    seen = _imported(more, content).observations["course"]
    np.testing.assert_allclose(np.unwrap(seen), course, atol=1e-9)


def test_an_unknown_sensor_is_named(frame):
    with pytest.raises(InputError, match=r"channels\.accel_y\.sensor: unknown sensor 'imuu'"):
        _imported(frame, _with({"sensors.imu": {}, "channels.accel_y.sensor": "imuu"}))
