"""Stored bounds, their columns, and the guard that marks what no honest method can do."""

import numpy as np
import pytest
from synthetic_rows import TORQUE, row
from typer.testing import CliRunner

from gripbench.bench.bounds import stored
from gripbench.bench.bounds.bound import bounds, channels_of
from gripbench.bench.bounds.stored import Least, read_bounds, store_bounds
from gripbench.bench.command_line import application
from gripbench.bench.publishing.board_tables import board_table
from gripbench.bench.publishing.bound_columns import BELOW
from gripbench.bench.publishing.tables import plain
from gripbench.bench.ranking.answers import words
from gripbench.bench.ranking.grids import instruments
from gripbench.bench.ranking.ranking import boards
from gripbench.bench.running.rows import frame_of
from gripbench.bench.running.store import Store
from gripbench.envs.worlds import load_scenario
from gripbench.errors import GripbenchError

SET = ", ".join(instruments(TORQUE))
SCENARIOS = ("step", "hill", "bend")


def allowed(seeds, rms=0.1, scenarios=SCENARIOS):
    known = Least(rms**2, 0.75)
    return {(name, seed, SET, "mu_front"): known for name in scenarios for seed in range(seeds)}


def board_of(errors, seeds, given, **more):
    """A board of methods by their RMS in each run, shape (scenarios, seeds)."""
    rows = [
        row(label, seed, float(rms[s, seed]), scenario=name)
        for label, rms in errors.items()
        for s, name in enumerate(SCENARIOS)
        for seed in range(seeds)
    ]
    return boards(frame_of(rows), bounds=given, **more)[0]


def test_the_ratio_is_that_of_the_errors_and_who_is_below_is_marked():
    seeds = 4
    honest = np.full((3, seeds), 0.2)
    partly = honest.copy()
    partly[1] = 1e-4
    board = board_of(
        {"honest": honest, "cheat": np.full((3, seeds), 2e-14), "partly": partly},
        seeds, allowed(seeds),
    )  # fmt: skip
    lines = board.lines.set_index("label")
    assert lines.loc["honest", "bound"] == pytest.approx(0.1)
    assert lines.loc["honest", "bound_ratio"] == pytest.approx(2.0)
    assert lines.loc["honest", "below_bound"] == ""
    assert "all together" in lines.loc["cheat", "below_bound"]
    assert lines.loc["partly", "below_bound"] == "hill"
    text = plain(board_table(board))
    assert f"cheat {BELOW}" in text
    assert "x bound" in text
    assert len(board_table(board).columns) <= 9
    said = words(board)
    assert "take honest" in said  # the best that is honest
    assert "2 times the bound" in said
    assert "Below what the sensors allow: cheat, partly" in said


def test_only_runs_with_a_bound_count():
    errors = np.full((3, 6), 0.1)
    errors[:, 4:] = 7.0
    board = board_of({"a": errors, "b": 2.0 * errors}, 6, allowed(4))
    assert board.lines["bound_ratio"].to_numpy() == pytest.approx([1.0, 2.0])
    assert set(board.lines["bound_runs"]) == {12}


def test_without_bounds_nothing_is_claimed():
    board = board_of({"a": np.full((3, 4), 1e-9), "b": np.ones((3, 4))}, 4, {})
    assert board.lines["bound_ratio"].isna().all()
    assert (board.lines["below_bound"] == "").all()
    assert "x bound" not in plain(board_table(board))


def test_bounds_of_public_seeds_say_nothing_of_hidden_ones():
    rows = [row(label, seed, rms, scenario="step", salt="0" * 32)
            for label, rms in (("a", 1e-9), ("b", 0.2)) for seed in range(4)]  # fmt: skip
    board = boards(frame_of(rows), bounds=allowed(4), resamples=20)[0]
    assert board.lines["bound"].isna().all()
    assert (board.lines["below_bound"] == "").all()


@pytest.mark.slow
def test_a_method_at_the_bound_is_seldom_accused():
    """The worst case: its error is one draw that stays for all of the run."""
    draws = np.random.default_rng(7)
    accused = 0
    for _ in range(40):
        errors = np.abs(0.1 * draws.normal(size=(3, 4)))
        methods = {"at_the_bound": errors, "other": np.ones((3, 4))}
        board = board_of(methods, 4, allowed(4), resamples=20)
        line = board.lines.set_index("label").loc["at_the_bound"]
        accused += line["below_bound"] != ""
    assert accused <= 4  # 40 boards at a confidence of 95 %


def test_bounds_are_computed_once_and_again_when_what_they_are_made_of_changes(
    tmp_path, monkeypatch
):
    scenario = load_scenario("constant_mu@1").model_copy(update={"horizon": 3.0})
    wanted = {scenario.name: (scenario, [0], [SET, "any"], ["mu_front", "sideslip"])}
    assert store_bounds(tmp_path, wanted, workers=1) == 1
    assert store_bounds(tmp_path, wanted, workers=1) == 0
    found = read_bounds(tmp_path, [scenario])
    assert {place[2:] for place in found} == {(SET, "mu_front"), ("any", "mu_front")}
    expected = bounds(scenario, 0, [channels_of(scenario)], ["mu_front"], stored.STEP)[0]
    kept = found[(scenario.name, 0, "any", "mu_front")]
    assert kept.mean_square == pytest.approx(expected.rms**2, rel=1e-12)

    (path,) = (tmp_path / "bounds").rglob("*.json")
    text = path.read_text()
    path.write_text(text[: len(text) // 2])  # as a damaged disk leaves it
    assert read_bounds(tmp_path, [scenario]) == {}
    assert store_bounds(tmp_path, wanted, workers=1) == 1
    assert path.read_text() == text

    other = scenario.model_copy(update={"road_grade": 0.01})
    assert read_bounds(tmp_path, [other]) == {}
    monkeypatch.setattr(stored, "STEP", 0.01)
    assert read_bounds(tmp_path, [scenario]) == {}


def test_the_command_stores_and_the_ranking_reads(tmp_path):
    store = Store(tmp_path)
    for label, rms in (("good", 0.3), ("oracle", 1e-13)):
        for seed in range(3):
            store.write(row(label, seed, rms, scenario="constant_mu@1"))
    invoke = CliRunner().invoke
    where = ["--results", str(tmp_path)]
    done = invoke(application(), ["bound", "--boards", "--seeds", "3", "--workers", "1", *where])
    assert done.exit_code == 0, done.output
    assert "bounds of 3 runs" in done.output
    done = invoke(application(), ["rank", *where])
    assert "x bound" in done.output
    assert f"oracle {BELOW}" in done.output
    wide = invoke(application(), ["rank", "--wide", "--format", "csv", *where]).output
    assert {"Bound", "RMS / bound"} <= set(wide.splitlines()[0].split(","))


@pytest.mark.parametrize(
    ("arguments", "words_"),
    [
        (["friction_step@1", "--target", "mu_frnt"], "mu_front"),
        (["friction_step@1", "--sensors", "gyroscope"], "has no 'gyroscope'"),
        (["friction_step@1", "--sensors", "blub"], "unknown sensor"),
        (["friction_step@1", "--export", "x.doc"], ".csv"),
        (["li2014_gradient"], "no bound"),
        (["no_such@1"], "unknown scenario"),
        ([], "no scenario"),
        (["friction_step@1", "--format", "foo"], "table format"),
    ],
)
def test_bad_input_is_one_line(arguments, words_):
    done = CliRunner().invoke(application(), ["bound", *arguments])
    assert isinstance(done.exception, GripbenchError)
    assert words_ in str(done.exception)
    assert "\n" not in str(done.exception)


def test_the_command_prints_draws_and_writes(tmp_path):
    sets = ["--sensors", "GPS receiver,accelerometer", "--sensors", "wheel_speed_front"]
    runs = ["--seeds", "1", "--workers", "1", "--step", "0.05"]
    arguments = ["bound", "constant_mu@1", *runs, *sets]
    table = tmp_path / "b.csv"
    done = CliRunner().invoke(application(), [*arguments, "--export", str(table)])
    assert done.exit_code == 0, done.output
    assert done.output.count("mu_front") == 2
    head, *lines = table.read_text().splitlines()
    assert head.startswith("scenario,seed,target,sensors,time,truth,bound,information_rate,known")
    assert len(lines) == 2 * 601
    picture = tmp_path / "b.png"
    done = CliRunner().invoke(application(), [*arguments, "--export", str(picture)])
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert done.exit_code == 0
