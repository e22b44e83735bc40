"""Formats read through their own libraries: structures, groups, invalid samples, messages."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from gripbench.errors import InputError
from gripbench.logs.readers.reading import read_log

T = np.arange(30) * 0.01
R = np.sin(T)


def test_matlab_arrays_of_structures_and_named_columns(tmp_path):
    path = tmp_path / "log.mat"
    kind = [("name", object), ("data", object), ("time", object), ("unit", object)]
    signals = np.zeros((1, 2), dtype=kind)
    signals[0, 0] = ("YawRate", R, T, "deg/s")
    signals[0, 1] = ("AccelY", 2.0 * R[::2], T[::2], "m/s2")
    savemat(path, {"signals": signals, "data": np.stack([T, R], 1),
                   "names": np.array(["t", "r"], dtype=object)})  # fmt: skip
    log = read_log(path)
    assert log.columns["YawRate"].unit == "deg/s"
    np.testing.assert_array_equal(log.columns["AccelY"].times, T[::2])
    np.testing.assert_array_equal(log.numbers("r", "x"), R)


@pytest.mark.filterwarnings("ignore:duration_to_mat")
def test_matlab_timetable(tmp_path):
    matio = pytest.importorskip("matio")
    path = tmp_path / "log.mat"
    index = pd.to_timedelta(np.arange(30) * 10, unit="ms").as_unit("ms")
    matio.save_to_mat(str(path), {"drive": pd.DataFrame({"r": R}, index=index)})
    column = read_log(path).column("drive.r", "x")
    np.testing.assert_allclose(column.times, T)
    np.testing.assert_array_equal(column.values, R)


@pytest.mark.parametrize("version", ["4.10", "3.30"])
def test_mdf_groups_of_one_name_and_rates(tmp_path, version):
    asammdf = pytest.importorskip("asammdf")
    path = tmp_path / ("log.mf4" if version[0] == "4" else "log.dat")
    with asammdf.MDF(version=version) as mdf:
        mdf.append([asammdf.Signal(R, T, name="YawRate", unit="rad/s")])
        mdf.append([asammdf.Signal(-R[::3], T[::3], name="YawRate", unit="rad/s")])
        written = mdf.save(path.with_suffix(".mf4" if version[0] == "4" else ".mdf"))
    log = read_log(type(path)(written))
    np.testing.assert_array_equal(log.numbers("0/YawRate", "x"), R)
    np.testing.assert_array_equal(log.numbers("1/YawRate", "x"), -R[::3])
    with pytest.raises(InputError, match="two columns are called 'YawRate'"):
        log.column("YawRate", "x")


def test_mdf_invalid_samples_are_blanks(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    path = tmp_path / "log.mf4"
    invalid = np.zeros(len(T), dtype=bool)
    invalid[5:9] = True
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append([asammdf.Signal(R, T, name="YawRate", invalidation_bits=invalid)])
        mdf.save(path)
    values = read_log(path).numbers("YawRate", "x")
    np.testing.assert_array_equal(np.isnan(values), invalid)
    np.testing.assert_array_equal(values[~invalid], R[~invalid])


def test_mcap(tmp_path):
    writer = pytest.importorskip("mcap.writer")
    path = tmp_path / "log.mcap"
    with path.open("wb") as handle:
        mcap = writer.Writer(handle)
        mcap.start()
        schema = mcap.register_schema("imu", "jsonschema", b'{"type": "object"}')
        channel = mcap.register_channel("/imu", "json", schema)
        for t, r in zip(T, R, strict=True):
            stamp = round(1e9 * (5.0 + t))
            data = json.dumps({"angular_velocity": {"z": r}}).encode()
            mcap.add_message(channel, stamp, data, stamp)
        mcap.finish()
    column = read_log(path).column("imu.angular_velocity.z", "x")
    np.testing.assert_allclose(column.times, 5.0 + T)
    np.testing.assert_array_equal(column.values, R)


def test_ros_2_bag_takes_the_time_of_the_header(tmp_path):
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    kinds = [store.types[name] for name in (
        "geometry_msgs/msg/Vector3Stamped", "std_msgs/msg/Header", "builtin_interfaces/msg/Time",
        "geometry_msgs/msg/Vector3")]  # fmt: skip
    stamped, header, time, vector = kinds
    with rosbag2.Writer(tmp_path / "bag", version=9) as writer:
        connection = writer.add_connection("/imu", stamped.__msgtype__, typestore=store)
        for k, r in enumerate(R):
            message = stamped(header(time(5, 10_000_000 * k), "imu"), vector(r, 0.0, 9.8))
            raw = store.serialize_cdr(message, stamped.__msgtype__)
            writer.write(connection, 1_000_000_000 * k, raw)
    column = read_log(tmp_path / "bag").column("imu.vector.x", "x")
    np.testing.assert_allclose(column.times, 5.0 + T)
    np.testing.assert_array_equal(column.values, R)


def test_spreadsheet(tmp_path):
    pytest.importorskip("openpyxl")
    pytest.importorskip("python_calamine")
    path = tmp_path / "log.xlsx"
    pd.DataFrame({"time": T, "yaw_rate": R}).to_excel(path, index=False)
    np.testing.assert_allclose(read_log(path).numbers("yaw_rate", "x"), R, rtol=1e-14)


@pytest.mark.parametrize("suffix", ["parquet", "feather"])
def test_arrow_tables_with_dates(tmp_path, suffix):
    path = tmp_path / f"log.{suffix}"
    frame = pd.DataFrame({"time": pd.Timestamp("2024-03-09") + pd.to_timedelta(T, "s"), "r": R})
    getattr(frame, f"to_{suffix}")(path)
    log = read_log(path)
    assert log.columns["time"].is_text
    np.testing.assert_array_equal(log.numbers("r", "x"), R)


def test_carmaker_result(tmp_path):
    path = tmp_path / "run.erg"
    record = np.zeros(len(T), dtype=[("Time", "<f8"), ("pad", "V4"), ("Car.YawRate", "<f4")])
    record["Time"], record["Car.YawRate"] = T, R
    path.write_bytes(b"CM-ERG".ljust(16, b"\0") + record.tobytes())
    path.with_name("run.erg.info").write_text(
        "File.Format = erg\nFile.ByteOrder = LittleEndian\nFile.At.1.Name = Time\n"
        "File.At.1.Type = Double\nFile.At.2.Name = $none$\nFile.At.2.Type = 4 Bytes\n"
        "File.At.3.Name = Car.YawRate\nFile.At.3.Type = Float\nQuantity.Car.YawRate.Unit = rad/s\n"
    )
    log = read_log(path)
    np.testing.assert_allclose(log.numbers("Car.YawRate", "x"), R, rtol=1e-6)
    assert log.columns["Car.YawRate"].unit == "rad/s"
    path.write_bytes(path.read_bytes()[:-3])
    with pytest.raises(InputError, match=r"run\.erg.*truncated"):
        read_log(path)
