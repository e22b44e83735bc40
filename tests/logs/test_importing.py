import numpy as np
import pandas as pd
import pytest

from gripbench.errors import InputError
from gripbench.logs.importing import import_frame, import_log
from gripbench.logs.mapping.channel_map import load_channel_map
from gripbench.logs.storing import load, store


def test_values_are_si_with_the_signs_of_the_table(folder, frame):
    recording = import_log(folder / "drive.csv", folder / "map.toml").recordings[0]
    seen = recording.observations
    assert recording.scenario == "drive"
    assert recording.vehicle["wheel_radius"] == 0.3
    np.testing.assert_allclose(seen["time"], frame["t"] / 1000.0, atol=1e-9)
    np.testing.assert_allclose(seen["yaw_rate"], -np.deg2rad(frame["gyro_down"]), rtol=1e-12)
    np.testing.assert_allclose(seen["accel_y"], -9.80665 * frame["acc_right"], rtol=1e-12)
    np.testing.assert_allclose(seen["wheel_speed_rear"], frame["wheel"] / 3.6 / 0.3, rtol=1e-12)
    np.testing.assert_allclose(
        seen["steer_angle"], np.deg2rad(frame["steering"]) / 16.0, rtol=1e-12
    )
    np.testing.assert_allclose(recording.truth["sideslip"], np.deg2rad(frame["beta"]), atol=1e-15)


def test_rates_are_kept_and_new_samples_flagged(folder, frame):
    seen = import_log(folder / "drive.csv", folder / "map.toml").recordings[0].observations
    new = seen["speed_gps_new"] == 1.0
    np.testing.assert_array_equal(np.flatnonzero(new), np.arange(0, len(frame), 10))
    np.testing.assert_allclose(
        seen["speed_gps"][new], frame["gps_speed"].dropna() / 3.6, rtol=1e-12
    )
    held = np.repeat(seen["speed_gps"][new], 10)[: len(seen)]
    np.testing.assert_array_equal(seen["speed_gps"], held)
    assert np.all(seen["yaw_rate_new"] == 1.0)


def test_late_gps_tells_its_age(folder):
    seen = import_log(folder / "drive.csv", folder / "map.toml").recordings[0].observations
    new = seen["course_new"] == 1.0
    np.testing.assert_allclose(seen["gps_time"][new], seen["time"][new] - 0.2, atol=1e-9)
    assert np.all(np.abs(seen["course"]) <= np.pi)


def test_frame_and_file_give_the_same(folder, frame):
    content = load_channel_map(folder / "map.toml").model_dump(exclude_defaults=True)
    content["vehicle"] = str(folder / "car.toml")
    of_frame = import_frame(frame, content).recordings[0]
    of_file = import_log(folder / "drive.csv", folder / "map.toml").recordings[0]
    assert of_frame.observations.tobytes() == of_file.observations.tobytes()
    assert of_frame.truth.tobytes() == of_file.truth.tobytes()


def _two_rates(extra=None, **first):
    fast = np.arange(100) * 0.01
    frame = pd.DataFrame(
        {"t": fast, "own": np.floor(fast / 0.05) * 0.05, "r": np.sin(fast), "a": fast}
    )
    content = {
        "name": "x",
        "time": {"column": "t"},
        "channels": {
            "yaw_rate": {"column": "r", "unit": "rad/s"},
            "accel_x": {"column": "a", "unit": "m/s^2", **first},
        },
        **(extra or {}),
    }
    return frame, content


def test_own_time_column_gives_own_times():
    frame, content = _two_rates(time="own")
    seen = import_frame(frame, content).recordings[0].observations
    # Of the rows with one own time the last counts; it is seen from that time on.
    assert int(seen["accel_x_new"].sum()) == 20
    new = seen["accel_x_new"] == 1.0
    np.testing.assert_allclose(seen["time"][new], np.arange(20) * 0.05, atol=1e-9)


def test_new_when_another_column_changes():
    frame, content = _two_rates(new_when="own")
    seen = import_frame(frame, content).recordings[0].observations
    assert int(seen["accel_x_new"].sum()) == 20
    assert int(seen["yaw_rate_new"].sum()) == 100


def test_declared_rate_marks_changes_and_overdue_samples():
    frame, content = _two_rates(rate=20.0)
    frame["a"] = np.where(frame["t"] < 0.5, np.floor(frame["t"] / 0.05 + 1e-9), 10.0)
    seen = import_frame(frame, content).recordings[0].observations
    assert 16 <= int(seen["accel_x_new"].sum()) <= 20


def test_two_clocks_merge_without_interpolation(tmp_path):
    pd.DataFrame({"t": [0.0, 1.0, 2.0, 3.0], "r": [1.0, 2.0, 3.0, 4.0]}).to_csv(
        tmp_path / "a.csv", index=False
    )
    pd.DataFrame({"t": [0.5, 1.5, 2.0], "a": [5.0, 6.0, 7.0]}).to_csv(
        tmp_path / "b.csv", index=False
    )
    (tmp_path / "map.toml").write_text(
        'name = "two"\n[files.one]\npath = "a.csv"\ntime = {column = "t"}\n'
        '[files.two]\npath = "b.csv"\ntime = {column = "t"}\n'
        '[channels.yaw_rate]\nfile = "one"\ncolumn = "r"\nunit = "rad/s"\n'
        '[channels.accel_x]\nfile = "two"\ncolumn = "a"\nunit = "m/s^2"\n'
    )
    seen = import_log(tmp_path, tmp_path / "map.toml").recordings[0].observations
    np.testing.assert_allclose(seen["time"], [0.0, 0.5, 1.0, 1.5, 2.5])
    np.testing.assert_array_equal(seen["yaw_rate"], [1.0, 2.0, 2.0, 3.0, 4.0])
    np.testing.assert_array_equal(seen["yaw_rate_new"], [1.0, 1.0, 0.0, 1.0, 1.0])
    np.testing.assert_array_equal(seen["accel_x"], [5.0, 5.0, 6.0, 7.0, 7.0])
    np.testing.assert_array_equal(seen["accel_x_new"], [1.0, 0.0, 1.0, 1.0, 0.0])


def test_rows_of_one_channel_report_what_falls_between():
    frame, content = _two_rates({"rows": "accel_x"}, time="own")
    imported = import_frame(frame, content)
    assert len(imported.recordings[0].observations) == 20
    found = [f for f in imported.report.findings if f.check == "rows"]
    assert found[0].channel == "channels.yaw_rate"
    assert found[0].message.startswith("76 samples")


def test_runs_become_recordings_of_their_own():
    frame = pd.DataFrame(
        {
            "t": [0.0, 0.1, 0.2, 0.0, 0.1, 0.2, 0.3],
            "run": [3, 3, 3, 5, 5, 5, 5],
            "r": np.arange(7.0),
        }
    )
    content = {
        "name": "x",
        "time": {"column": "t"},
        "runs": "run",
        "training_runs": [3],
        "channels": {"yaw_rate": {"column": "r", "unit": "rad/s"}},
    }
    first, second = import_frame(frame, content).recordings
    assert (first.seed, second.seed) == (3, 5)
    assert list(second.observations["yaw_rate"]) == [3.0, 4.0, 5.0, 6.0]
    assert set(first.windows) == {"train"}
    assert set(second.windows) == {"test"}


def test_hole_in_the_reference_is_no_truth():
    frame, content = _two_rates({"reference": {"yaw": {"column": "a", "unit": "rad"}}})
    frame.loc[40:60, "a"] = np.nan
    del content["channels"]["accel_x"]
    truth = import_frame(frame, content).recordings[0].truth
    np.testing.assert_array_equal(
        np.isnan(truth["yaw"]), (np.arange(100) >= 40) & (np.arange(100) <= 60)
    )


def test_slower_reference_is_interpolated_and_its_samples_marked():
    frame, content = _two_rates({"reference": {"yaw": {"column": "a", "unit": "rad"}}})
    frame.loc[np.arange(100) % 4 != 0, "a"] = np.nan
    del content["channels"]["accel_x"]
    truth = import_frame(frame, content).recordings[0].truth
    np.testing.assert_allclose(truth["yaw"][:97], frame["t"][:97], atol=1e-12)
    assert int(truth["yaw_new"].sum()) == 25


def test_delayed_reference_is_moved_back():
    frame, content = _two_rates(
        {"reference": {"yaw": {"column": "a", "unit": "rad", "delay": 0.1}}}
    )
    del content["channels"]["accel_x"]
    truth = import_frame(frame, content).recordings[0].truth
    np.testing.assert_allclose(truth["yaw"][:89], frame["t"][:89] + 0.1, atol=1e-9)


def test_zero_from_the_first_standstill(folder, frame):
    text = (
        (folder / "map.toml")
        .read_text()
        .replace('column = "gyro_down"', 'column = "gyro_down"\nzero = "standstill"')
    )
    (folder / "map.toml").write_text(text)
    frame["gyro_down"] += 5.0
    frame.to_csv(folder / "drive.csv", index=False)
    imported = import_log(folder / "drive.csv", folder / "map.toml")
    bias = imported.recordings[0].notes["zero_yaw_rate"]
    assert bias == pytest.approx(-np.deg2rad(5.0), abs=1e-3)
    assert any(finding.check == "zero" for finding in imported.report.findings)


def test_zero_from_a_straight_stretch_that_is_not_there_is_refused():
    frame, content = _two_rates(zero="straight")
    with pytest.raises(InputError, match=r"channels\.accel_x\.zero.*no straight"):
        import_frame(frame, content)


def test_dates_are_times(frame):
    frame = pd.DataFrame({"t": ["2024-03-01T10:00:00Z", "2024-03-01T10:00:00.5Z"], "r": [1.0, 2.0]})
    content = {
        "name": "x",
        "time": {"column": "t", "unit": "datetime"},
        "channels": {"yaw_rate": {"column": "r", "unit": "rad/s"}},
    }
    seen = import_frame(frame, content).recordings[0].observations
    np.testing.assert_allclose(seen["time"], [0.0, 0.5])


def test_store_and_load_give_the_same(folder):
    imported = import_log(folder / "drive.csv", folder / "map.toml")
    loaded = load(store(imported, folder / "kept" / "drive"))
    again = load(store(imported, folder / "kept" / "drive"))
    for one in (loaded, again):
        assert one.provenance == imported.provenance
        assert one.report == imported.report
        for mine, theirs in zip(one.recordings, imported.recordings, strict=True):
            assert mine.observations.tobytes() == theirs.observations.tobytes()
            assert mine.truth.tobytes() == theirs.truth.tobytes()
            assert mine.windows == theirs.windows
            assert mine.bounds == theirs.bounds
    assert len(imported.provenance.files["drive.csv"]) == 64
    assert imported.provenance.licence == "MIT"


def test_store_never_replaces_what_is_no_recording(folder):
    imported = import_log(folder / "drive.csv", folder / "map.toml")
    with pytest.raises(InputError, match="something other than a recording"):
        store(imported, folder)
    assert (folder / "drive.csv").exists()


@pytest.mark.parametrize("damage", ["truncate", "missing", "json", "schema"])
def test_damaged_store_is_one_error(folder, damage):
    kept = store(import_log(folder / "drive.csv", folder / "map.toml"), folder / "kept")
    about, samples = kept / "recording.json", kept / "observations-0.parquet"
    if damage == "truncate":
        samples.write_bytes(samples.read_bytes()[:-50])
    elif damage == "missing":
        samples.unlink()
    elif damage == "json":
        about.write_text(about.read_text()[:-20])
    else:
        about.write_text(about.read_text().replace('"schema": 1', '"schema": 99'))
    with pytest.raises(InputError, match="kept"):
        load(kept)
