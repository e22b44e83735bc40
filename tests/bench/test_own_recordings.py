"""A log of one's own, by folder, name and map: identify, tune, run, rank, plot, report, study."""

import html
import tomllib

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

import gripbench
from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.command_line import application
from gripbench.bench.publishing.figures.run_plot import run_plot
from gripbench.bench.publishing.figures.runs import Runs
from gripbench.bench.publishing.report.series import SeriesPlan, series_of, unpacked
from gripbench.bench.running import cells
from gripbench.bench.running.recorded_scenarios import recorded_scenario, recording_of
from gripbench.bench.scoring.metric import pooled_rms
from gripbench.envs.populations.causes import CAUSES

FRONT, REAR, MASS, INERTIA = 1.2, 1.5, 1500.0, 2500.0
MAP = """
name = "my_drive"
vehicle = "car.toml"
[time]
column = "t"
unit = "s"
[channels.speed_x]
column = "v"
unit = "m/s"
[channels.accel_x]
column = "ax"
unit = "m/s^2"
[channels.accel_y]
column = "ay"
unit = "m/s^2"
[channels.yaw_rate]
column = "r"
unit = "rad/s"
[channels.steer_angle]
column = "delta"
unit = "rad"
[reference.sideslip]
column = "beta"
unit = "rad"
[windows]
train = [[100.0, 120.0]]
test = [[120.0, 139.9]]
"""
METHOD = "single_track_kalman_filter:measured_speed"


def drive(seconds=40.0, start=100.0):
    """Return a handling log of a single-track car with linear tyres, as a frame."""
    rng = np.random.default_rng(3)
    step, v = 0.01, 20.0
    stiff_front, stiff_rear = 60.0 * MASS, 75.0 * MASS
    time = np.arange(0.0, seconds, step)
    delta = 0.03 * np.sin(0.8 * time) + 0.02 * np.sin(2.1 * time)
    slide = np.zeros((len(time), 2))
    accel = np.zeros(len(time))
    y, r = 0.0, 0.0
    for k, steer in enumerate(delta):
        front = stiff_front * (steer - (y + FRONT * r) / v)
        rear = -stiff_rear * (y - REAR * r) / v
        accel[k] = (front + rear) / MASS
        slide[k] = y, r
        y += step * (accel[k] - v * r)
        r += step * (FRONT * front - REAR * rear) / INERTIA

    def noise(size):
        return size * rng.standard_normal(len(time))

    return pd.DataFrame(
        {
            "t": start + time, "v": v + noise(0.02), "ax": noise(0.05), "ay": accel + noise(0.05),
            "r": slide[:, 1] + noise(0.002), "delta": delta, "beta": np.arctan2(slide[:, 0], v),
        }
    )  # fmt: skip


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    drive().to_csv("map.csv", index=False)
    (tmp_path / "map.toml").write_text(MAP)
    given = {
        "mass": MASS, "cg_to_front": FRONT, "cg_to_rear": REAR, "yaw_inertia": INERTIA,
        "cornering_stiffness_front": 45.0 * MASS, "cornering_stiffness_rear": 95.0 * MASS,
    }  # fmt: skip
    lines = [f'{key} = {{ value = {value}, source = "test" }}' for key, value in given.items()]
    (tmp_path / "car.toml").write_text(
        'name = "car"\ndescription = "a car"\n[parameters]\n' + "\n".join(lines) + "\n"
    )
    return tmp_path


def _call(*arguments):
    result = CliRunner().invoke(application(), [str(one) for one in arguments])
    assert result.exit_code == 0, result.output
    return result.output


def test_a_recording_by_folder_name_and_map_through_every_command(here):
    _call("import", "map.csv", "--map", "map.toml")
    texts = [_call("identify", place) for place in ("recordings/my_drive", "my_drive", "map.toml")]
    assert texts[0] == texts[1] == texts[2]
    assert "train 100.000 to 120.000 s" in texts[0]
    values = {line.split()[0]: float(line.split()[1]) for line in texts[0].splitlines()[1:4]}
    assert values["stiffness_front"] == pytest.approx(60.0, rel=0.15)
    assert values["stiffness_rear"] == pytest.approx(75.0, rel=0.15)
    _call("identify", "map.toml", "--out", "found.toml")
    found = tomllib.loads((here / "found.toml").read_text())["parameters"]
    assert found["cornering_stiffness_front"]["value"] == pytest.approx(60.0 * MASS, rel=0.15)

    tuned = [
        _call("tune", place, METHOD, "--draws", 6, "--out", "tuned.toml")
        for place in ("recordings/my_drive", "my_drive", "map.toml")
    ]
    assert tuned[0] == tuned[1] == tuned[2]
    record = tomllib.loads((here / "tuned.toml").read_text())["record"]
    assert record["after"] <= record["before"]
    assert record["windows"] == [[100.0, 120.0]]

    frame = gripbench.run(
        scenarios=["recording:map.toml"], methods=["tuned.toml", METHOD, "zero_sideslip"],
        results="results", workers=1,
    )  # fmt: skip
    label = f"{METHOD}@tuned_my_drive_sideslip"
    assert {label, METHOD, "zero_sideslip"} == set(frame["label"])
    assert set(frame.loc[frame["target"] == "sideslip", "status"]) == {"ok"}
    assert label in _call("rank", "--target", "sideslip", "--sensors", "any", "--format", "text")
    assert (frame["seed"].nunique()) == recorded_scenario("map.toml").runs


@pytest.mark.slow
def test_study_writes_a_ranked_page(here):
    text = _call("study", "map.csv", "--map", "map.toml", "--budget", 6, "--workers", 1)
    assert "test 120.000 to 139.900 s" in text
    page = (here / "study_my_drive" / "index.html").read_text()
    for part in ("single_track_kalman_filter", "zero_sideslip", "data:image/png", "undetermined"):
        assert part in page
    assert "no sensor for" in page
    assert "http" not in page


def test_one_pass_over_the_log_serves_all_windows(here, monkeypatch):
    passes = []
    real = cells.execute
    monkeypatch.setattr(cells, "execute", lambda *given: passes.append(0) or real(*given))
    scenario = recorded_scenario("map.toml")
    method = choose_method(METHOD)
    made = tuple(cells.cell_of(scenario, seed, method, "") for seed in range(scenario.runs))
    monkeypatch.setattr(cells, "_check_code", lambda cell: None)
    rows = cells.run_task(cells.Task(made, cells.Limits(), False))
    assert len(passes) == 1
    alone = [
        cells.run_cell(cell, recording_of(scenario, cell.seed), cells.Limits(), False)
        for cell in made
    ]
    assert [row.scores for row in rows] == [row.scores for row in alone]


def test_all_that_is_missing_to_identify_is_named_at_once(here):
    text = MAP.replace('vehicle = "car.toml"\n', "").replace("train = [[100.0, 120.0]]\n", "")
    start = text.index("[channels.steer_angle]")
    (here / "map.toml").write_text(text[:start] + text[text.index("[reference.sideslip]") :])
    result = CliRunner().invoke(application(), ["identify", "map.toml"])
    assert result.exit_code != 0
    said = f"{result.output} {result.exception}"
    for part in ("steer_angle", "cg_to_front", "cg_to_rear", "no window 'train'"):
        assert part in said


def test_every_output_says_which_window_was_scored(here):
    whole = "120.000 to 139.900 s of the log's own clock, 7 windows"
    arguments = ("--method", METHOD, "--method", "zero_sideslip", "--workers", 1)
    printed = _call("run", "--recording", "map.toml", *arguments)
    assert f"scored of recording:my_drive: {whole}" in printed
    ranked = _call("rank", "--target", "sideslip", "--sensors", "any", "--format", "text")
    assert f"Scored: {whole}." in ranked
    assert "over 7 windows of one drive" in " ".join(ranked.split())
    place = "recording:map.toml"
    assert "Written" in _call("plot", place, "--methods", METHOD, "--seed", 2)
    figure = run_plot(Runs(), place, [METHOD], "sideslip", 2)
    assert figure.get_suptitle().endswith("run 0, 125.686 to 128.529 s of the log's clock")
    low, high = figure.axes[0].get_xlim()
    assert (low, high) == pytest.approx((125.69, 128.52), abs=0.16)  # with margins
    series = series_of(SeriesPlan(place, {"sideslip": (METHOD,)}, (2,), (0, 1, 2)))
    assert series["windows"]["2"] == {"run": 0, "start": 125.685714, "end": 128.528571}
    assert series["band_seeds"] == 0
    times = unpacked(series["time"])
    assert (times[0], times[-1]) == pytest.approx((0.0, 128.528571 - 125.685714), abs=1e-3)
    assert np.isfinite(unpacked(series["estimates"]["sideslip"][METHOD]["2"])).mean() > 0.98
    _call("report", "--recording", "map.toml", "--output", "report.html", "--workers", 1)
    page = (here / "report.html").read_text()
    assert html.escape(whole) in page
    assert '"windows":{"0":{"run":0,"start":120.0,' in page


def test_sensitivity_of_a_recording_is_what_methods_are_told_of_the_car(here):
    place = ("--scenario", "recording:map.toml", "--target", "sideslip", "--workers", 1)
    said = _call("sensitivity", METHOD, *place, "--cause", "paper.mass", "--export", "out.csv")
    assert "paper.mass" in said
    lines = pd.read_csv(here / "out.csv").set_index(["label", "cause", "multiple"])["rms"]
    light, heavy = (lines[METHOD, "paper.mass", size] for size in (-1.0, 1.0))
    assert light != heavy
    whole = lines[METHOD, "paper.mass", 0.0]
    rows = gripbench.run(scenarios=["recording:map.toml"], methods=[METHOD], results="r", workers=1)
    part = rows[rows["target"] == "sideslip"]
    pooled = pooled_rms(part["sum_of_squares"], part["count"])
    assert whole == pytest.approx(pooled, rel=1e-5)
    cause = next(iter(CAUSES))
    result = CliRunner().invoke(
        application(), ["sensitivity", METHOD, *map(str, place), "--cause", cause]
    )
    assert "of a recording are what they were" in str(result.exception)


@pytest.mark.slow
def test_inspection_proposes_a_car_and_says_what_runs_and_what_more_would_need(here):
    result = CliRunner().invoke(application(), ["import", "--inspect", "map.csv"])
    proposal = tomllib.loads(result.stdout)
    assert set(proposal["vehicle"]) >= {"mass", "cg_to_front", "cornering_stiffness_rear"}
    assert all(value["guess"] for value in proposal["vehicle"].values())
    notes = " ".join(result.stderr.split())
    assert "can run: bicycle_on_paper:measured_speed" in notes
    assert f"{METHOD}" in notes
    assert "needs channels.wheel_speed_front_left" in notes
    (here / "proposed.toml").write_text(result.stdout)
    text = _call("study", "map.csv", "--map", "proposed.toml", "--budget", 2, "--workers", 1)
    assert "these are guesses, no data of this car: mass" in " ".join(text.split())
    assert "first half of the log was taken for training" in " ".join(text.split())
