"""An hour at 100 Hz with 20 channels: import, and one method over it."""

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import pytest

from gripbench.envs.signals import SIGNALS
from gripbench.logs.importing import import_log
from gripbench.logs.mapping.channel_map import ChannelMap
from gripbench.methods.kinematic_kalman_filter import KinematicKalmanFilter

CHANNELS = [
    "accel_x", "accel_y", "accel_z", "roll_rate", "pitch_rate", "yaw_rate", "steer_angle",
    "wheel_speed_front_left", "wheel_speed_front_right", "wheel_speed_rear_left",
    "wheel_speed_rear_right", "torque_front", "torque_rear", "speed_gps", "course",
    "magnetic_field_x", "magnetic_field_y", "magnetic_field_z", "velocity_north", "velocity_west",
]  # fmt: skip
ROWS = 360_000


@pytest.fixture(scope="module")
def hour(tmp_path_factory):
    rng = np.random.default_rng(0)
    time = np.arange(ROWS) * 0.01
    columns = {"time": time}
    for index, name in enumerate(CHANNELS):
        wave = np.sin(0.1 * (index + 1) * time) + 0.01 * rng.standard_normal(ROWS)
        columns[name] = np.round(wave, 6)
    folder = tmp_path_factory.mktemp("hour")
    table = pa.table(columns)
    pa.csv.write_csv(table, folder / "hour.csv")
    pa.parquet.write_table(table, folder / "hour.parquet")
    channels = {name: {"column": name, "unit": SIGNALS[name].unit} for name in CHANNELS}
    return folder, ChannelMap.model_validate({"name": "hour", "channels": channels})


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_import_of_an_hour(benchmark, hour, suffix):
    folder, channel_map = hour
    path = folder / f"hour.{suffix}"
    imported = benchmark.pedantic(import_log, (path, channel_map), rounds=1, iterations=1)
    assert len(imported.recordings[0].observations) == ROWS


def test_a_method_over_an_hour(benchmark, hour):
    folder, channel_map = hour
    seen = import_log(folder / "hour.parquet", channel_map).recordings[0].observations
    method = KinematicKalmanFilter()
    method.run({}, seen[:10])
    estimates = benchmark.pedantic(method.run, ({}, seen), rounds=3, iterations=1)
    assert len(estimates) == ROWS
