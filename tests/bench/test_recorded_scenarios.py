"""Recordings as scenarios of a run: windows are seeds, rows are like any other."""

import dataclasses
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

import gripbench
from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.command_line import application
from gripbench.bench.ranking.log_windows import scored_windows
from gripbench.bench.ranking.ranking import boards
from gripbench.bench.running.api import plan_of
from gripbench.bench.running.recorded_scenarios import (
    judged,
    on_recording,
    recorded_scenario,
    recording_of,
)
from gripbench.bench.running.recorded_windows import windows_of
from gripbench.bench.running.runner import run_plan
from gripbench.bench.running.store import Store
from gripbench.bench.scoring.metric import pooled_rms
from gripbench.envs.recordings import Bounds, Recording
from gripbench.envs.signals import record_type
from gripbench.errors import InputError
from gripbench.logs.importing import import_frame
from gripbench.logs.mapping.channel_map import ChannelMap
from gripbench.logs.published import AbsentDataError, load_recording
from gripbench.logs.storing import load, store
from gripbench.logs.vehicle.excitation import utilisation_bound

METHOD = "kinematic_kalman_filter"
MAP = {
    "name": "my_drive",
    "time": {"column": "t", "unit": "s"},
    "rows": "yaw_rate",
    "channels": {
        "yaw_rate": {"column": "r", "unit": "rad/s"},
        "course": {"column": "course", "unit": "rad", "rate": 5.0},
        "speed_gps": {"column": "v", "unit": "m/s", "rate": 5.0},
        "accel_x": {"column": "ax", "unit": "m/s^2"},
        "accel_y": {"column": "ay", "unit": "m/s^2"},
    },
    "reference": {
        "sideslip": {"column": "beta", "unit": "rad"},
        "yaw": {"column": "yaw", "unit": "rad"},
    },
    "windows": {"train": [[0.0, 15.0]], "test": [[15.0, 40.0]]},
    "bounds": {"mu": [{"low": 0.5, "high": 0.8, "start": 20.0, "end": 27.0, "source": "plate"}]},
    "settings": {METHOD: {"gyro_noise": 0.01}},
}


def _frame(seed=1):
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 40.0, 0.02)
    rate = 0.3 * np.sin(0.5 * time)
    yaw = 3.0 + 0.6 * (1.0 - np.cos(0.5 * time))
    beta = -0.1 * rate
    course = np.arctan2(np.sin(yaw + beta), np.cos(yaw + beta))
    ay = 15.0 * rate
    noisy = rate + 0.003 * rng.standard_normal(len(time))
    return pd.DataFrame(
        {"t": time, "r": noisy, "course": course, "v": 15.0 + 0.0 * time, "ax": 0.0 * time,
         "ay": ay, "beta": beta, "yaw": yaw}
    )  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    return store(import_frame(_frame(), ChannelMap(**MAP)), tmp_path / "kept" / "my_drive")


@pytest.fixture
def scenario(folder):
    return recorded_scenario(str(folder))


def test_windows_fill_the_test_time_and_end_where_knowledge_of_the_friction_does(folder):
    windows = windows_of(load(folder))
    assert windows[0].start == 15.0
    assert windows[-1].end == pytest.approx(39.98)
    for before, after in pairwise(windows):
        assert before.end == after.start
    edges = {round(window.start, 6) for window in windows}
    assert {20.0, 27.0} <= edges
    assert all(1.5 < window.end - window.start < 6.0 for window in windows)


def test_a_long_log_has_a_bounded_number_of_windows():
    time = np.arange(0.0, 3600.0, 0.5)
    frame = pd.DataFrame({"t": time, "r": 0.0, "beta": 0.0})
    channel_map = {
        "name": "long", "time": MAP["time"],
        "channels": {"yaw_rate": MAP["channels"]["yaw_rate"]},
        "reference": {"sideslip": MAP["reference"]["sideslip"]},
    }  # fmt: skip
    assert len(windows_of(import_frame(frame, channel_map))) == 20


def test_a_window_with_a_gap_of_the_reference_joins_its_neighbour():
    frame = _frame()
    frame.loc[frame["t"].between(28.2, 30.1), "beta"] = np.nan
    imported = import_frame(frame, ChannelMap(**{**MAP, "bounds": {}}))
    found = windows_of(imported)
    whole = windows_of(import_frame(_frame(), ChannelMap(**{**MAP, "bounds": {}})))
    assert (found[0].start, found[-1].end) == (whole[0].start, whole[-1].end)
    assert len(whole) - 2 <= len(found) < len(whole)
    truth = imported.recordings[0].truth
    for one in found:
        inside = (truth["time"] >= one.start) & (truth["time"] < one.end)
        assert np.isfinite(truth["sideslip"][inside]).mean() >= 0.45


def test_windows_come_in_the_order_of_time_and_say_where_they_lie(tmp_path):
    frame = _frame()
    frame["t"] += 1000.0
    given = {"train": [[1000.0, 1010.0]], "test": [[1030.0, 1039.0], [1012.0, 1021.0]]}
    imported = import_frame(frame, ChannelMap(**{**MAP, "bounds": {}, "windows": given}))
    place = store(imported, tmp_path / "my_drive")
    rows = gripbench.run(
        scenarios=[f"recording:{place}"], methods=["zero_sideslip"], results=tmp_path / "r",
        workers=1,
    )  # fmt: skip
    one = rows.drop_duplicates("seed")
    assert list(one["log_from"]) == [1012.0, 1015.0, 1018.0, 1030.0, 1033.0, 1036.0]
    assert list(one["log_to"]) == [1015.0, 1018.0, 1021.0, 1033.0, 1036.0, 1039.0]
    assert set(one["log_run"]) == {0.0}
    said = "1012.000 to 1021.000 s, 1030.000 to 1039.000 s of the log's own clock, 6 windows"
    assert scored_windows(rows) == {"recording:my_drive": said}
    (board,) = boards(rows, "sideslip", "any")
    assert f"Scored: {said}." in board.notes
    stored = gripbench.read_rows(tmp_path / "r")
    assert list(stored["log_from"]) == list(rows["log_from"])


@pytest.mark.parametrize(
    ("windows", "said"),
    [
        ({"test": [[10.0, 30.0], [20.0, 39.0]]}, "test: .* overlap"),
        ({"train": [[0.0, 20.0]], "test": [[15.0, 39.0]]}, "train .* and test .* overlap"),
    ],
)
def test_windows_that_overlap_are_refused(windows, said):
    with pytest.raises(ValueError, match=said):
        ChannelMap(**{**MAP, "windows": windows})


def test_nothing_after_a_window_is_seen_and_nothing_outside_it_is_scored(scenario):
    chosen = windows_of(load_of(scenario))[2]
    recording = recording_of(scenario, 2)
    time = recording.observations["time"]
    assert time[0] == 0.0  # a filter starts with the log, as in a vehicle
    assert time[-1] <= chosen.end < time[-1] + 0.021
    known = np.isfinite(recording.truth["sideslip"])
    assert (recording.truth["time"][known] >= chosen.start).all()
    assert known.sum() == pytest.approx((chosen.end - chosen.start) / 0.02, abs=2)


def load_of(scenario):
    return load(Path(scenario.place))


def test_settings_of_the_map_hold_under_the_plain_label_unless_the_user_sets_otherwise(scenario):
    plain, own = choose_method(METHOD), choose_method(f"{METHOD}@gyro_noise=0.02")
    local = on_recording(plain, scenario)
    assert local.label == plain.label == METHOD
    assert local.declaration.settings["gyro_noise"] == 0.01
    assert on_recording(own, scenario).declaration.settings["gyro_noise"] == 0.02
    assert on_recording(own, scenario).label == own.label
    other = choose_method("dugoff_ekf")
    assert on_recording(other, scenario) is other
    broken = scenario.model_copy(update={"settings": {METHOD: {"giro_noise": 1.0}}})
    with pytest.raises(InputError, match=r"key 'settings\.kinematic_kalman_filter'.*giro_noise"):
        on_recording(plain, broken)


def test_interval_counts_only_the_distance_beyond_it_and_angles_are_wrapped():
    truth = np.zeros(4, record_type(["time", "yaw", "mu"]))
    truth["time"] = np.arange(4.0)
    truth["mu"] = np.nan
    bounds = (Bounds("mu", 0.5, 0.8, 1.0, 9.0),)
    recording = Recording("x", 0, {}, truth, truth, bounds=bounds)
    estimates = np.zeros(4, record_type(["yaw", "mu"]))
    estimates["yaw"] = 2.0 * np.pi + 0.1
    estimates["mu"] = [0.0, 0.4, 0.6, 1.0]
    found = judged(recording, estimates).truth
    np.testing.assert_allclose(estimates["yaw"] - found["yaw"], 0.1)
    np.testing.assert_allclose((estimates["mu"] - found["mu"])[1:], [-0.1, 0.0, 0.2])
    assert np.isnan(found["mu"][0])


def test_utilisation_is_a_lower_bound_and_makes_the_strata(scenario, folder):
    recording = load(folder).recordings[0]
    used = utilisation_bound(recording)
    expected = np.abs(recording.observations["accel_y"]) / 9.81 / 0.8
    assert np.corrcoef(used, expected)[0, 1] > 0.99
    without = dataclasses.replace(recording, bounds=())
    np.testing.assert_allclose(utilisation_bound(without), 0.8 * used)
    assert "utilisation" in recording_of(scenario, 0).truth.dtype.names


def test_figures_by_utilisation_split_the_samples(folder, tmp_path):
    rows = gripbench.run(
        scenarios=[f"recording:{folder}"], methods=["zero_sideslip"], results=tmp_path / "r",
        workers=1,
    )  # fmt: skip
    bands = [f"rms_{name}_count" for name in ("low", "medium", "high", "limit")]
    assert rows[bands].sum(axis=1).sum() == rows["count"].sum()


def test_absent_data_is_a_skipped_row_and_runs_once_it_is_there(tmp_path, monkeypatch):
    monkeypatch.setenv("GRIPBENCH_DATA", str(tmp_path))
    frame = gripbench.run(
        scenarios=["recording:f1tenth_optitrack"], methods=["dugoff_ekf"],
        results=tmp_path / "r", workers=1,
    )  # fmt: skip
    (line,) = frame.to_dict("records")
    assert line["status"] == "skipped"
    assert "get it from https://" in line["reason"]


@pytest.mark.slow
def test_a_log_that_is_imported_again_with_other_samples_runs_again(folder, tmp_path):
    def computed():
        plan = plan_of("", [f"recording:{folder}"], [METHOD], "2")
        return run_plan(plan, Store(tmp_path / "r")).computed

    assert (computed(), computed()) == (2, 0)
    store(import_frame(_frame(seed=2), ChannelMap(**MAP)), folder)
    assert computed() == 2


def test_seeds_choose_windows_and_one_that_is_not_there_is_refused(folder):
    scenario = f"recording:{folder}"
    whole = plan_of("", [scenario, "constant_mu"], ["slip_slope"], None)
    assert [len(whole.seeds_of(item)) for item in whole.scenarios] == [whole.scenarios[0].runs, 1]
    few = plan_of("", [scenario], [METHOD], "1:3")
    assert few.seeds_of(few.scenarios[0]) == (1, 2)
    with pytest.raises(InputError, match=r"seeds '50:60'.*no such window.*0:"):
        plan_of("", [scenario], [METHOD], "50:60")
    with pytest.raises(InputError, match="has 8 windows, so no seed 8"):
        recording_of(whole.scenarios[0], 8)


def test_names_and_folders_that_are_no_recording(tmp_path):
    with pytest.raises(InputError, match="did you mean 'dart_rubber_floor_ramp'"):
        recorded_scenario("recording:dart_ruber_floor_ramp")
    with pytest.raises(InputError, match="is no recording; gripbench import makes one"):
        recorded_scenario(str(tmp_path))


def test_command_runs_an_imported_folder_and_ranks_it_apart(folder, tmp_path):
    arguments = [
        "run", "--recording", str(folder), "--method", METHOD, "--method",
        f"{METHOD}@gyro_noise=0.5", "--results", str(tmp_path / "r"), "--workers", "1",
    ]  # fmt: skip
    result = CliRunner().invoke(application(), arguments)
    assert result.exit_code == 0, result.output
    rows = gripbench.read_rows(tmp_path / "r")
    simulated = rows.assign(scenario="two_turns", seed=rows["seed"] + 3)
    both = pd.concat([rows, simulated], ignore_index=True)
    found = boards(both, "sideslip", "any", resamples=200)
    assert sorted(board.scenarios for board in found) == [("recording:my_drive",), ("two_turns",)]
    (board,) = [board for board in found if board.scenarios == ("recording:my_drive",)]
    assert len(board.seeds) == 8
    assert set(board.lines["label"]) == {METHOD, f"{METHOD}@gyro_noise=0.5"}


@pytest.mark.parametrize("name", ["dart_rubber_floor_ramp", "dart_taped_tyres_tiles_ramp"])
def test_friction_of_published_surfaces_as_rows(name, tmp_path):
    try:
        load_recording(name)
    except AbsentDataError as error:
        pytest.skip(str(error))
    frame = gripbench.run(
        scenarios=[f"recording:{name}"], methods=["velocity_friction_ekf"],
        results=tmp_path, workers=1,
    )  # fmt: skip
    rows = frame[frame["target"] == "mu"]
    assert len(rows) >= 5
    assert pooled_rms(rows["sum_of_squares"], rows["count"]) < 0.05
    assert set(frame.loc[frame["target"] != "mu", "status"]) == {"skipped"}  # nothing known there
