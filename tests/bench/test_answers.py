"""Which method to take: the words above a board and the table for roads and sensors."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from synthetic_rows import GPS, IDEAL, TORQUE, noisy_frame, noisy_rows
from typer.testing import CliRunner

from gripbench.bench.command_line import application
from gripbench.bench.publishing.board_tables import answer_table, board_table
from gripbench.bench.publishing.report.content import profile
from gripbench.bench.publishing.report.critical import critical_differences
from gripbench.bench.publishing.tables import plain
from gripbench.bench.ranking.answers import answers, words
from gripbench.bench.ranking.grids import instruments
from gripbench.bench.ranking.plans import plan_of, road_of
from gripbench.bench.ranking.ranking import boards
from gripbench.bench.running.store import Store

GUESS = {"guess": {"baseline": True, "sensors": ()}}


def test_the_words_name_method_error_next_and_guess():
    board = boards(noisy_frame({"a": 1.0, "b": 1.5, "c": 9.0, "guess": 3.0}, **GUESS))[0]
    said = words(board)
    line = board.lines.set_index("label").loc["a"]
    assert said.startswith(f"With {line['sensors']} take a: {line['rms']:.3g} RMS (95 %: ")
    assert "better than b in 100 % of them" in said
    assert "better than the guess guess in 100 % of them" in said
    assert said.endswith("No better than a guess: c.")


def test_a_best_method_that_is_no_better_than_a_guess_is_called_so():
    board = boards(noisy_frame({"a": 3.0, "b": 4.0, "guess": 1.0}, **GUESS))[0]
    assert "It is no better than a guess: guess is as good." in words(board)
    (answer,) = answers(noisy_frame({"a": 3.0, "b": 4.0, "guess": 1.0}, **GUESS), ["mu_front"])
    assert not answer.useful
    assert "none: guess is as good as a" in plain(answer_table([answer]))


def test_sensors_stand_where_they_change_the_method_and_idealised_ones_never():
    more = {**GUESS, "gps": {"sensors": GPS}, "bad": {"sensors": GPS},
            "ideal": {"sensors": IDEAL, "idealised": IDEAL[-1:]}}  # fmt: skip
    frame = noisy_frame(
        {"a": 1.0, "b": 1.5, "gps": 0.5, "bad": 4.0, "ideal": 0.1, "guess": 3.0}, **more
    )
    found = answers(frame, ["mu_front"])
    assert [(one.sensors, one.method) for one in found] == [
        (instruments(TORQUE), "a"), (instruments(GPS), "gps"),
    ]  # fmt: skip
    worse = noisy_frame({"a": 1.0, "b": 1.5, "gps": 2.5, "guess": 3.0}, **more)
    assert [one.method for one in answers(worse, ["mu_front"])] == ["a"]


@pytest.mark.parametrize(
    ("scenario", "road"),
    [("constant_mu", "dry"), ("friction_step", "changing"), ("slalom_snow", "snow"),
     ("double_lane_change_ice", "ice"), ("slalom_snow@1", "snow"), ("none_such", "unknown")],
)  # fmt: skip
def test_the_road_of_a_scenario_is_read_from_its_file(scenario, road):
    assert road_of(scenario) == road


def test_the_plan_of_a_scenario():
    assert plan_of("constant_mu") == "longitudinal"
    assert plan_of("constant_mu@1") == "longitudinal_population"
    assert plan_of("constant_mu@2") == "level 2"
    assert plan_of("mine") == ""


def test_a_board_has_at_most_nine_columns_on_a_hundred_characters():
    names = ("individual_wheel_acceleration:paper", "slip_slope:magic_formula")
    frame = noisy_frame(dict.fromkeys(names, 1e-4) | {"constant_friction": 2e-4},
                        constant_friction={"baseline": True})  # fmt: skip
    for board in (*boards(frame), *boards(frame, sensors="any")):
        table = board_table(board)
        assert len(table.columns) <= 9
        body = [line for line in plain(table).splitlines() if any(n in line for n in names)]
        assert max(map(len, body[-2:])) <= 100


def test_the_command_prints_the_answers_alone(tmp_path):
    store = Store(tmp_path)
    for item in noisy_rows({"a": 1.0, "b": 2.0, "guess": 3.0}, **GUESS):
        store.write(item)
    done = CliRunner().invoke(
        application(), ["leaderboard", "--answer", "--results", str(tmp_path)]
    )
    assert done.exit_code == 0
    assert "| mu_front |" in done.output
    assert "100 % of drives" in done.output
    assert not (tmp_path / "leaderboard.md").exists()


def test_angles_are_shown_in_degrees():
    frame = noisy_frame({"a": 0.1, "b": 0.2}, a={"target": "sideslip"}, b={"target": "sideslip"})
    board = boards(frame)[0]
    assert "RMS [deg]" in plain(board_table(board))
    shown = board_table(board).rows[0]["rms"]
    assert shown == pytest.approx(np.rad2deg(board.lines.loc[0, "rms"]))
    assert " deg RMS" in words(board)


def test_the_critical_differences_join_what_ties_and_nothing_else():
    board = boards(noisy_frame({"a": 1.0, "b": 1.0, "<c>": 2.0}))[0]
    page = ElementTree.fromstring(critical_differences(board))
    assert len([line for line in page.iter("line") if line.get("class") == "tied"]) == 1
    assert [text.text.split()[1] for text in page.iter("text")][-1] == "<c>"


def test_a_profile_starts_with_the_share_of_wins_and_ends_at_one():
    board = boards(noisy_frame({"a": 1.0, "b": 1.5}))[0]
    shares = profile(board)["methods"]
    assert shares["a"][0] + shares["b"][0] == 1.0
    assert shares["a"][-1] == shares["b"][-1] == 1.0
