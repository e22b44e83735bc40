"""Scores on recordings without truth: windows, intervals, yardsticks, tuning."""

import dataclasses

import numpy as np
import pytest

from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.running.recorded import score_published, score_recordings, scored_samples
from gripbench.bench.running.tuning import searched, tune
from gripbench.envs.recordings import Bounds, Recording
from gripbench.envs.signals import record_type
from gripbench.errors import InputError
from gripbench.logs.published import AbsentDataError, load_recording


def _turning(bias=0.0, windows=None, bounds=()):
    """Straight and turns at 15 m/s, sideslip from a steady-state gradient; GPS at 5 Hz."""
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 60.0, 0.01)
    rate = np.where((time > 15) & (time < 25) | (time > 40) & (time < 50), 0.2, 0.0)
    yaw = np.cumsum(rate) * 0.01
    beta = -0.1 * rate
    names = [
        "time",
        "yaw_rate",
        "course",
        "course_new",
        "speed_gps",
        "gps_time",
        "accel_x",
        "accel_y",
    ]
    seen = np.zeros(len(time), record_type(names))
    truth = np.zeros(len(time), record_type(["time", "sideslip", "yaw"]))
    seen["time"] = truth["time"] = time
    seen["yaw_rate"] = rate + bias + 0.002 * rng.standard_normal(len(time))
    fresh = np.arange(len(time)) % 20 == 0
    held = np.arange(len(time)) // 20 * 20
    course = np.arctan2(np.sin(yaw + beta), np.cos(yaw + beta))
    seen["course"], seen["course_new"], seen["gps_time"] = course[held], fresh, time[held]
    seen["speed_gps"], seen["accel_y"] = 15.0, 15.0 * rate
    truth["sideslip"], truth["yaw"] = beta, yaw
    chosen = windows or {"train": ((0.0, 30.0),), "test": ((30.0, 60.0),)}
    return Recording("turning", 0, {}, seen, truth, windows=chosen, bounds=bounds)


def _row(rows, target, estimator):
    return next(row for row in rows if (row.target, row.estimator) == (target, estimator))


def test_method_beats_the_trivial_ones_where_it_should():
    rows = score_recordings([_turning(0.005)], [choose_method("kinematic_kalman_filter")])
    best = _row(rows, "sideslip", "kinematic_kalman_filter")
    zero = _row(rows, "sideslip", "zero sideslip")
    assert best.status == "ok"
    assert best.high < zero.value
    assert zero.value == pytest.approx(np.rad2deg(0.02) * np.sqrt(10 / 30), rel=0.01)
    assert best.low <= best.value <= best.high


def test_only_the_test_window_counts():
    recording = _turning()
    assert scored_samples(recording).sum() == pytest.approx(3000, abs=1)
    spoilt = recording.truth.copy()
    spoilt["sideslip"][:2900] = 1.0
    other = dataclasses.replace(recording, truth=spoilt)
    assert score_recordings([recording], []) == score_recordings([other], [])
    late = dataclasses.replace(recording, score_from=59.0)
    assert scored_samples(late).sum() == 100


def test_missing_sensor_gives_a_row_with_the_reason():
    rows = score_recordings([_turning()], [choose_method("heading_ekf")])
    (row,) = [row for row in rows if row.kind == "method"]
    assert row.status == "skipped"
    assert "magnetic_field_x" in row.reason


def test_interval_counts_only_the_distance_beyond_it():
    inside = Bounds("mu", 0.0, 10.0, 42.0, 48.0)
    beyond = Bounds("mu", 0.0, 0.1, 42.0, 48.0)
    for bound, expected in ((inside, 0.0), (beyond, 3.0 / 9.81 - 0.1)):
        rows = score_recordings([_turning(bounds=(bound,))], [])
        row = _row(rows, "mu", "largest |a|/g so far")
        assert row.measure == "mean"
        assert row.value == pytest.approx(3.0 / 9.81, rel=1e-3)
        assert row.outside == pytest.approx(expected, abs=1e-3)


def test_errors_of_angles_are_wrapped():
    recording = _turning()
    truth = recording.truth.copy()
    truth["yaw"] += 2.0 * np.pi
    other = dataclasses.replace(recording, truth=truth)
    one, two = (
        _row(score_recordings([r], []), "yaw", "course as heading") for r in (recording, other)
    )
    assert two.value == pytest.approx(one.value, rel=1e-9)


def test_tuning_looks_at_the_training_window_only_and_is_repeatable():
    recording = _turning(0.01)
    spoilt = recording.truth.copy()
    spoilt["sideslip"][3001:] = 0.5
    other = dataclasses.replace(recording, truth=spoilt)
    found = tune("kinematic_kalman_filter", [recording], "sideslip", draws=8)
    assert found.after <= found.before
    assert tune("kinematic_kalman_filter", [other], "sideslip", draws=8) == found
    assert set(found.settings) <= {one.name for one in searched("kinematic_kalman_filter")}


def test_tuning_without_a_training_window_is_refused():
    with pytest.raises(InputError, match="no window 'train'"):
        tune("kinematic_kalman_filter", [_turning(windows={"test": ((0.0, 60.0),)})], "yaw")


def test_tuning_names_what_it_cannot_do():
    with pytest.raises(InputError, match="unknown method 'kinematic'"):
        tune("kinematic", [_turning()], "yaw")
    with pytest.raises(InputError, match=r"does not estimate 'mu' but sideslip, yaw"):
        tune("kinematic_kalman_filter", [_turning()], "mu", draws=1)


def test_absent_data_is_one_row(tmp_path):
    (row,) = score_published(["f1tenth_optitrack"], [], tmp_path)
    assert row.status == "skipped"
    assert "get it from" in row.reason


def _published(name, *methods):
    try:
        load_recording(name)
    except AbsentDataError as error:
        pytest.skip(str(error))
    return score_published([name], methods)


def test_surfaces_are_told_apart_with_disjoint_intervals():
    rubber, tiles = (
        _row(_published(name, "velocity_friction_ekf"), "mu", "velocity_friction_ekf")
        for name in ("dart_rubber_floor_ramp", "dart_taped_tyres_tiles_ramp")
    )
    assert tiles.high < rubber.low
    assert 0.6 < rubber.value < 0.85
    assert 0.28 < tiles.value < 0.45


def test_heading_of_the_road_drive_beats_the_course():
    rows = _published("comma2k19_example", "kinematic_kalman_filter", "model_based_kalman_filter")
    course = _row(rows, "yaw", "course as heading")
    for method in ("kinematic_kalman_filter", "model_based_kalman_filter"):
        assert _row(rows, "yaw", method).high < course.low


def test_sideslip_of_the_small_car_beats_zero():
    rows = _published("f1tenth_optitrack", "dugoff_ekf")
    assert _row(rows, "sideslip", "dugoff_ekf").high < _row(rows, "sideslip", "zero sideslip").low


def test_sideslip_on_tiles_beats_zero_and_on_rubber_below_the_limit():
    tiles = _published("dart_taped_tyres_tiles_ramp", "dugoff_ekf")
    zero = _row(tiles, "sideslip", "zero sideslip")
    assert _row(tiles, "sideslip", "dugoff_ekf").high < zero.low
    rubber = score_published(["dart_rubber_floor_ramp"], ["dugoff_ekf"], by_excitation=True)
    high = [row for row in rubber if row.excitation == "high"]
    assert _row(high, "sideslip", "dugoff_ekf").high < _row(high, "sideslip", "zero sideslip").low


def test_settings_of_the_user_come_before_those_of_the_map():
    name = "dart_rubber_floor_ramp"
    rows = _published(name, "dugoff_ekf", "dugoff_ekf@friction=0.6")
    own, other = (_row(rows, "sideslip", f"dugoff_ekf{s}") for s in ("", "@friction=0.6"))
    assert own.value != other.value


def test_few_blocks_give_no_interval():
    bound = Bounds("mu", 0.0, 10.0, 42.0, 43.5)
    row = _row(score_recordings([_turning(bounds=(bound,))], []), "mu", "largest |a|/g so far")
    assert row.value is not None
    assert np.isnan(row.low)
    assert np.isnan(row.high)
