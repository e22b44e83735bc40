"""Round trips through every format, and what a truncated file of each brings."""

import shutil
from importlib.util import find_spec

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gripbench.envs.recordings import Recording
from gripbench.envs.signals import record_type
from gripbench.envs.worlds import load_scenario, record
from gripbench.errors import GripbenchError, InputError
from gripbench.logs.exporting import export_recording
from gripbench.logs.importing import import_log
from gripbench.logs.readers.reading import optional, read_log
from gripbench.methods.slip_slope import SlipSlope

FORMATS = ["csv", "parquet", "mat", "mf4"]


def _needs(suffix: str) -> None:
    if suffix == "mf4":
        pytest.importorskip("asammdf", reason="the extra 'logs' is not installed")


def _recording() -> Recording:
    rng = np.random.default_rng(3)
    count = 400
    seen = np.zeros(
        count, record_type(["time", "yaw_rate", "accel_x", "speed_gps", "speed_gps_new"])
    )
    truth = np.zeros(count, record_type(["time", "sideslip"]))
    seen["time"] = truth["time"] = np.cumsum(rng.uniform(0.001, 0.02, count)) - 0.001
    seen["time"] -= seen["time"][0]
    truth["time"] = seen["time"]
    for name in ("yaw_rate", "accel_x"):
        seen[name] = rng.standard_normal(count)
    seen["speed_gps_new"] = np.arange(count) % 7 == 0
    seen["speed_gps"] = np.repeat(rng.uniform(5, 20, 58), 7)[:count]
    truth["sideslip"] = rng.standard_normal(count) * 0.01
    return Recording("round_trip", 0, {}, seen, truth)


@pytest.mark.parametrize("suffix", FORMATS)
def test_round_trip_keeps_every_bit(tmp_path, suffix):
    _needs(suffix)
    original = _recording()
    path = tmp_path / f"log.{suffix}"
    channel_map = export_recording(original, path)
    again = import_log(path, channel_map).recordings[0]
    for name in original.observations.dtype.names:
        np.testing.assert_array_equal(again.observations[name], original.observations[name])
    np.testing.assert_array_equal(again.truth["sideslip"], original.truth["sideslip"])


def test_simulated_recording_gives_the_same_estimates(tmp_path):
    original = record(load_scenario("constant_mu"), 1)
    method = SlipSlope()
    expected = method.run(original.vehicle, original.observations)
    for suffix in FORMATS:
        if suffix == "mf4" and find_spec("asammdf") is None:
            continue
        path = tmp_path / f"log.{suffix}"
        channel_map = export_recording(original, path)
        again = import_log(path, channel_map).recordings[0]
        found = method.run(original.vehicle, again.observations)
        assert found.tobytes() == expected.tobytes(), suffix


def test_matlab_73(tmp_path):
    h5py = pytest.importorskip("h5py", reason="the extra 'logs' is not installed")
    path = tmp_path / "log.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"] = np.arange(5.0)[None, :]
        file["imu/gz"] = np.arange(5.0)[None, :] * 2.0
        file["matrix"] = np.arange(10.0).reshape(2, 5)
    data = bytearray(path.read_bytes())
    head = b"MATLAB 7.3 MAT-file"
    data[: len(head)] = head
    data[124:128] = b"\x00\x02IM"
    path.write_bytes(bytes(data))
    log = read_log(path)
    assert set(log.names) == {"t", "imu.gz", "matrix(:,1)", "matrix(:,2)"}
    np.testing.assert_array_equal(log.columns["imu.gz"].values, np.arange(5.0) * 2.0)
    np.testing.assert_array_equal(log.columns["matrix(:,2)"].values, np.arange(5.0, 10.0))


def test_matlab_structures_and_matrices(tmp_path):
    from scipy.io import savemat

    path = tmp_path / "log.mat"
    savemat(path, {"imu": {"t": np.arange(3.0), "a": np.eye(3)}, "note": "text"})
    log = read_log(path)
    assert set(log.names) == {"imu.t", "imu.a(:,1)", "imu.a(:,2)", "imu.a(:,3)"}


DBC = """VERSION ""
NS_ :
BS_:
BU_: ECU
BO_ 256 Motion: 8 ECU
 SG_ YawRate : 0|16@1- (0.01,0) [-300|300] "deg/s" ECU
 SG_ Lateral : 16|16@1- (0.001,0) [-30|30] "m/s2" ECU
BO_ 512 Speed: 8 ECU
 SG_ Wheel : 0|16@1+ (0.01,0) [0|300] "km/h" ECU
"""


def _trace(folder, suffix, frames=200):
    can = pytest.importorskip("can", reason="the extra 'logs' is not installed")
    cantools = pytest.importorskip("cantools", reason="the extra 'logs' is not installed")
    (folder / "car.dbc").write_text(DBC)
    database = cantools.database.load_string(DBC)
    path = folder / f"log.{suffix}"
    with can.Logger(str(path)) as writer:
        for k in range(frames):
            data = database.encode_message("Motion", {"YawRate": k * 0.1, "Lateral": -k * 0.01})
            writer.on_message_received(
                can.Message(
                    timestamp=100.0 + k * 0.01, arbitration_id=256, data=data, is_extended_id=False
                )
            )
            if k % 2 == 0:
                data = database.encode_message("Speed", {"Wheel": 36.0 + 0.1 * k})
                writer.on_message_received(
                    can.Message(
                        timestamp=100.004 + k * 0.01,
                        arbitration_id=512,
                        data=data,
                        is_extended_id=False,
                    )
                )
    (folder / "map.toml").write_text(
        'name = "bus"\ndatabase = "car.dbc"\n'
        '[channels.yaw_rate]\ncolumn = "Motion.YawRate"\nunit = "deg/s"\n'
        '[channels.speed_gps]\ncolumn = "Speed.Wheel"\nunit = "km/h"\n'
    )
    return path


@pytest.mark.parametrize("suffix", ["blf", "asc"])
def test_can_trace(tmp_path, suffix):
    path = _trace(tmp_path, suffix)
    imported = import_log(path, tmp_path / "map.toml")
    seen = imported.recordings[0].observations
    yaw = seen["yaw_rate"][seen["yaw_rate_new"] == 1.0]
    np.testing.assert_allclose(np.rad2deg(yaw[1:]), 0.1 * np.arange(1, 200), atol=1e-9)
    speed = seen["speed_gps"][seen["speed_gps_new"] == 1.0]
    np.testing.assert_allclose(speed * 3.6, 36.0 + 0.2 * np.arange(100), atol=1e-9)
    assert not [finding for finding in imported.report.findings if finding.check == "unit"]


def test_unit_of_the_database_contradicts_the_map(tmp_path):
    path = _trace(tmp_path, "blf")
    text = (tmp_path / "map.toml").read_text().replace('"deg/s"', '"rad/s"')
    (tmp_path / "map.toml").write_text(text)
    found = import_log(path, tmp_path / "map.toml").report.findings
    assert [f.suggestion for f in found if f.check == "unit"] == ['unit = "deg/s"']


def test_can_trace_without_database(tmp_path):
    path = _trace(tmp_path, "blf")
    with pytest.raises(InputError, match="key 'database'"):
        read_log(path)


@pytest.mark.parametrize("suffix", [*FORMATS, "blf", "asc"])
def test_truncated_file_is_one_error_or_the_whole_truth(tmp_path_factory, suffix):
    """No cut of a file may bring a traceback, or samples that the whole file does not have."""
    folder = tmp_path_factory.mktemp(suffix)
    _needs(suffix)
    if suffix in ("blf", "asc"):
        path = _trace(folder, suffix)
        channel_map = folder / "map.toml"
    else:
        path = folder / f"log.{suffix}"
        channel_map = export_recording(_recording(), path)
    whole = import_log(path, channel_map)
    content = path.read_bytes()
    cut = folder / "cut" / path.name
    cut.parent.mkdir()
    if (folder / "car.dbc").exists():
        shutil.copy(folder / "car.dbc", cut.parent)

    @settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
    @given(st.integers(min_value=0, max_value=len(content) - 1))
    def check(length):
        cut.write_bytes(content[:length])
        try:
            found = import_log(cut, channel_map)
        except GripbenchError as error:
            refusals.append(str(error))
            return
        mine, theirs = found.recordings[0].observations, whole.recordings[0].observations
        warned = any(finding.check == "file" for finding in found.report.findings)
        whole_rows = len(mine) - 1 if warned else len(mine)
        assert mine[:whole_rows].tobytes() == theirs[:whole_rows].tobytes()
        if suffix not in ("csv", "asc"):  # a text file cut between two lines is a shorter log
            assert len(mine) == len(theirs)

    refusals: list[str] = []
    check()
    assert refusals
    assert all(cut.name in text and "\n" not in text for text in refusals)


@pytest.mark.parametrize("suffix", [*FORMATS, "blf", "asc"])
def test_noise_instead_of_a_file(tmp_path, suffix):
    _needs(suffix)
    if suffix in ("blf", "asc"):
        pytest.importorskip("can", reason="the extra 'logs' is not installed")
    rng = np.random.default_rng(1)
    path = tmp_path / f"log.{suffix}"
    (tmp_path / "car.dbc").write_text(DBC)
    (tmp_path / "map.toml").write_text(
        'name = "x"\n'
        + ('database = "car.dbc"\n' if suffix in ("blf", "asc") else "")
        + '[channels.yaw_rate]\ncolumn = "Motion.YawRate"\nunit = "deg/s"\n'
    )
    for size in (1, 64, 5000):
        path.write_bytes(rng.bytes(size))
        with pytest.raises(InputError, match=r"log\."):
            import_log(path, tmp_path / "map.toml")


def test_missing_extra_is_named(monkeypatch):
    import importlib

    def absent(name):
        raise ImportError(name)

    monkeypatch.setattr(importlib, "import_module", absent)
    with pytest.raises(InputError, match=r"pip install 'gripbench\[logs\]'"):
        optional("asammdf", "an MDF4 file")
