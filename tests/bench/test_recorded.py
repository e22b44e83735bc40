"""Scores on recordings without truth: windows, intervals, baselines, tuning, published figures."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

import gripbench
from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.command_line import application
from gripbench.bench.ranking.ranking import boards
from gripbench.bench.running.recorded_scenarios import recorded_scenario, scored_runs
from gripbench.bench.running.tuning import searched, tune
from gripbench.bench.scoring.metric import pooled_rms
from gripbench.errors import InputError
from gripbench.logs.importing import import_frame
from gripbench.logs.published import AbsentDataError, load_recording
from gripbench.logs.storing import store

METHOD = "kinematic_kalman_filter"
MAP = {
    "name": "turning",
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
    "windows": {"train": [[0.0, 30.0]], "test": [[30.0, 60.0]]},
}


def _frame(bias=0.0):
    """Straight and turns at 15 m/s, sideslip from a steady-state gradient; GPS at 5 Hz."""
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 60.0, 0.01)
    rate = np.where((time > 15) & (time < 25) | (time > 40) & (time < 50), 0.2, 0.0)
    yaw = np.cumsum(rate) * 0.01
    beta = -0.1 * rate
    noise = 0.002 * rng.standard_normal(len(time))
    return pd.DataFrame(
        {
            "t": time, "r": rate + bias + noise, "ax": 0.0, "ay": 15.0 * rate, "v": 15.0,
            "course": np.arctan2(np.sin(yaw + beta), np.cos(yaw + beta)), "beta": beta, "yaw": yaw,
        }
    )  # fmt: skip


def _turning(bias=0.0, **changes):
    return import_frame(_frame(bias), {**MAP, **changes}).recordings[0]


def _scores(folder, *methods, bias=0.0, frame=None, **changes):
    """Return the rows of methods on a drive that is imported into a folder."""
    imported = import_frame(_frame(bias) if frame is None else frame, {**MAP, **changes})
    place = store(imported, folder / "turning")
    return gripbench.run(
        scenarios=[f"recording:{place}"], methods=methods, results=folder / "results", workers=1
    )


def _line(rows, target, label):
    (board,) = boards(rows, target, "any")
    return board.lines.set_index("label").loc[label]


def test_method_beats_a_guess_where_it_should(tmp_path):
    rows = _scores(tmp_path, METHOD, "zero_sideslip", bias=0.005)
    best, zero = (_line(rows, "sideslip", label) for label in (METHOD, "zero_sideslip"))
    assert best["rms_to"] < zero["rms"]
    assert best["rms_from"] <= best["rms"] <= best["rms_to"]
    assert zero["rms"] == pytest.approx(0.02 * np.sqrt(10 / 30), rel=0.01)


def test_only_the_test_window_counts(tmp_path):
    spoilt = _frame()
    spoilt.loc[spoilt["t"] < 29.0, "beta"] = 0.9
    one = _scores(tmp_path / "a", "zero_sideslip")
    other = _scores(tmp_path / "b", "zero_sideslip", frame=spoilt)
    assert one["count"].sum() == 3000
    assert list(one["rms"].dropna()) == list(other["rms"].dropna())
    late = _scores(tmp_path / "c", "zero_sideslip", score_from=33.0, windows={})
    assert late["count"].sum() == 2700


def test_missing_sensor_gives_a_row_with_the_reason(tmp_path):
    rows = _scores(tmp_path, "heading_ekf")
    assert set(rows["status"]) == {"skipped"}
    assert "magnetic_field_x" in rows["reason"].iloc[0]


@pytest.mark.parametrize(("high", "distance"), [(10.0, 0.0), (0.1, 3.0 / 9.81 - 0.1)])
def test_of_a_friction_that_lies_in_an_interval_only_the_distance_counts(tmp_path, high, distance):
    bound = {"low": 0.0, "high": high, "start": 42.0, "end": 48.0, "source": "plate"}
    rows = _scores(tmp_path, "specific_force", bounds={"mu": [bound]})
    line = _line(rows, "mu", "specific_force")
    assert line["mean_estimate"] == pytest.approx(3.0 / 9.81, rel=1e-3)
    assert line["rms"] == pytest.approx(distance, abs=1e-3)
    assert rows.loc[rows["target"] == "mu_used", "mean_estimate"].isna().all()


def test_the_whole_test_time_is_the_windows_together(tmp_path):
    rows = _scores(tmp_path, METHOD, bias=0.005)
    whole, *more = scored_runs(recorded_scenario(str(tmp_path / "turning")))
    assert not more
    made = choose_method(METHOD).make().run(whole.vehicle, whole.observations)
    error = made["sideslip"] - whole.truth["sideslip"]
    part = rows[rows["target"] == "sideslip"]
    pooled = pooled_rms(part["sum_of_squares"], part["count"])
    assert pooled == pytest.approx(np.sqrt(np.nanmean(error**2)), rel=1e-12)
    assert part["count"].sum() == np.isfinite(error).sum()


def test_command_is_run_and_rank(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    store(import_frame(_frame(), MAP), tmp_path / "recordings" / "turning")
    arguments = ["--format", "text", "--workers", "1"]
    one = CliRunner().invoke(application(), ["recordings", "turning", *arguments])
    assert one.exit_code == 0, one.output
    ranked = CliRunner().invoke(application(), ["rank", "--sensors", "any", "--format", "text"])
    blocks = {block.split("\n")[0] for block in ranked.stdout.split("\n\n") if "Rank" in block}
    assert blocks
    assert blocks <= {block.split("\n")[0] for block in one.stdout.split("\n\n")}
    assert "30.000 to 59.990 s of the log's own clock, 10 windows" in " ".join(one.stdout.split())
    for baseline in ("zero_sideslip", "course_as_heading", "kinematic_integration:gps_speed"):
        assert baseline in one.stdout
    assert "no sensor for 'magnetic_field_x'" not in one.output  # what cannot run is not asked to


def test_tuning_looks_at_the_training_window_only_and_is_repeatable():
    recording = _turning(0.01)
    spoilt = recording.truth.copy()
    spoilt["sideslip"][3001:] = 0.5
    other = dataclasses.replace(recording, truth=spoilt)
    found = tune(METHOD, [recording], "sideslip", draws=8)
    assert found.after <= found.before
    assert tune(METHOD, [other], "sideslip", draws=8) == found
    assert set(found.settings) <= set(searched(METHOD))


def test_tuning_without_a_training_window_is_refused():
    with pytest.raises(InputError, match="no window 'train'"):
        tune(METHOD, [_turning(windows={"test": [[0.0, 59.0]]})], "yaw")


def test_tuning_names_what_it_cannot_do():
    with pytest.raises(InputError, match="unknown method 'kinematic'"):
        tune("kinematic", [_turning()], "yaw")
    with pytest.raises(InputError, match=r"does not estimate 'mu' but sideslip, yaw"):
        tune(METHOD, [_turning()], "mu", draws=1)


def _sure(rows, target, better, worse):
    """Return the p-value that one method is not better than another, windows paired."""
    (board,) = boards(rows, target, "any")
    return board.p_better.loc[better, worse]


def _published(folder, name, *methods):
    try:
        load_recording(name)
    except AbsentDataError as error:
        pytest.skip(str(error))
    return gripbench.run(
        scenarios=[f"recording:{name}"], methods=methods, results=folder, workers=1
    )


def test_surfaces_are_told_apart(tmp_path):
    names = ("dart_rubber_floor_ramp", "dart_taped_tyres_tiles_ramp")
    rubber, tiles = (
        _line(_published(tmp_path, name, "velocity_friction_ekf"), "mu", "velocity_friction_ekf")
        for name in names
    )
    assert rubber["mean_estimate"] == pytest.approx(0.767, abs=0.002)
    assert tiles["mean_estimate"] == pytest.approx(0.357, abs=0.002)
    assert max(rubber["rms"], tiles["rms"]) < 0.02


def test_heading_of_the_road_drive_beats_the_course(tmp_path):
    labels = (METHOD, "model_based_kalman_filter", "course_as_heading")
    rows = _published(tmp_path, "comma2k19_example", *labels)
    *methods, course = (_line(rows, "yaw", label) for label in labels)
    for line, published in zip((*methods, course), (0.0891, 0.0742, 0.339), strict=True):
        assert np.rad2deg(line["rms"]) == pytest.approx(published, rel=0.01)
        assert line is course or line["rms_to"] < course["rms_from"]


def test_sideslip_of_the_small_car_beats_zero(tmp_path):
    rows = _published(tmp_path, "f1tenth_optitrack", "dugoff_ekf", "zero_sideslip")
    method, zero = (_line(rows, "sideslip", label) for label in ("dugoff_ekf", "zero_sideslip"))
    assert np.rad2deg([method["rms"], zero["rms"]]) == pytest.approx([4.75, 8.46], rel=0.01)
    assert _sure(rows, "sideslip", "dugoff_ekf", "zero_sideslip") < 0.01


def test_sideslip_on_tiles_beats_zero_and_on_rubber_below_the_limit(tmp_path):
    labels = ("dugoff_ekf", "zero_sideslip")
    tiles = _published(tmp_path, "dart_taped_tyres_tiles_ramp", *labels)
    errors = [np.rad2deg(_line(tiles, "sideslip", label)["rms"]) for label in labels]
    assert errors == pytest.approx([1.47, 5.13], rel=0.01)
    assert _sure(tiles, "sideslip", *labels) < 0.05
    rubber = _published(tmp_path, "dart_rubber_floor_ramp", *labels)
    high = [np.rad2deg(_line(rubber, "sideslip", label)["rms_high"]) for label in labels]
    assert high == pytest.approx([1.64, 3.92], rel=0.01)


def test_settings_of_the_user_come_before_those_of_the_map(tmp_path):
    labels = ("dugoff_ekf", "dugoff_ekf@friction=0.6")
    rows = _published(tmp_path, "dart_rubber_floor_ramp", *labels)
    own, other = (np.rad2deg(_line(rows, "sideslip", label)["rms"]) for label in labels)
    assert [own, other] == pytest.approx([2.73, 6.17], rel=0.01)
