"""A short log of a vehicle whose physics is consistent, and the map that reads it."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

WHEELBASE = 2.7
VEHICLE = """
name = "car"
description = "A car."
[parameters]
wheel_radius = { value = 0.3, source = "tape" }
cg_to_front = { value = 1.2, source = "scales" }
cg_to_rear = { value = 1.5, source = "scales" }
"""
MAP = """
name = "drive"
description = "Two curves."
licence = "MIT"
vehicle = "car.toml"
[time]
column = "t"
unit = "ms"
[channels.yaw_rate]
column = "gyro_down"
unit = "deg/s"
sign = -1
[channels.accel_x]
column = "acc_fwd"
unit = "m/s^2"
[channels.accel_y]
column = "acc_right"
unit = "g"
sign = -1
[channels.accel_z]
column = "acc_down"
unit = "g"
sign = -1
[channels.steer_angle]
column = "steering"
unit = "deg"
scale = 0.0625
[channels.wheel_speed_rear]
column = "wheel"
unit = "km/h"
per = "wheel_radius"
[channels.speed_gps]
column = "gps_speed"
unit = "km/h"
[channels.course]
column = "gps_course"
unit = "deg"
sign = -1
delay = 0.2
[reference.sideslip]
column = "beta"
unit = "deg"
"""


def drive(seconds: float = 60.0, rate: float = 50.0) -> pd.DataFrame:
    rng = np.random.default_rng(7)
    t = np.arange(0.0, seconds, 1.0 / rate)
    moving = np.clip((t - 3.0) / 5.0, 0.0, 1.0)
    v = moving * (15.0 + 3.0 * np.sin(0.4 * t))
    delta = np.where(t > 8.0, 0.05 * np.sin(0.5 * (t - 8.0)), 0.0)
    r = v * delta / WHEELBASE
    heading = np.cumsum(r) / rate
    frame = pd.DataFrame(
        {
            "t": 1000.0 * t,
            "gyro_down": -np.rad2deg(r + 0.002 * rng.standard_normal(len(t))),
            "acc_fwd": np.gradient(v, t) + 0.05 * rng.standard_normal(len(t)),
            "acc_right": -(v * r + 0.05 * rng.standard_normal(len(t))) / 9.80665,
            "acc_down": -1.0 + 0.005 * rng.standard_normal(len(t)),
            "steering": np.rad2deg(delta) * 16.0,
            "wheel": 3.6 * v + 0.01 * rng.standard_normal(len(t)),
            "gps_speed": 3.6 * v,
            "gps_course": np.rad2deg(-heading) % 360.0,
            "beta": np.rad2deg(-0.02 * delta * v),
        }
    )
    frame.loc[np.arange(len(t)) % 10 != 0, ["gps_speed", "gps_course"]] = np.nan  # 5 Hz
    return frame


@pytest.fixture
def frame() -> pd.DataFrame:
    return drive()


@pytest.fixture
def folder(tmp_path: Path, frame: pd.DataFrame) -> Path:
    (tmp_path / "car.toml").write_text(VEHICLE)
    (tmp_path / "map.toml").write_text(MAP)
    frame.to_csv(tmp_path / "drive.csv", index=False)
    return tmp_path
