"""Which method to take: the words above a board and the table for roads and sensors."""

import csv
import io
import xml.etree.ElementTree as ElementTree

import numpy as np
import pandas as pd
import pytest
from synthetic_rows import GPS, IDEAL, TORQUE, noisy_frame, noisy_rows, row
from typer.testing import CliRunner

from gripbench.bench.command_line import application
from gripbench.bench.publishing.answer_table import answer_table
from gripbench.bench.publishing.board_tables import board_table, one_table
from gripbench.bench.publishing.leaderboard import build, text_of
from gripbench.bench.publishing.report.content import found_boards, profile
from gripbench.bench.publishing.report.critical import critical_differences
from gripbench.bench.publishing.tables import csv as csv_text
from gripbench.bench.publishing.tables import plain
from gripbench.bench.ranking.answers import answers, words
from gripbench.bench.ranking.grids import PRODUCTION, instruments
from gripbench.bench.ranking.plans import plan_of, road_of
from gripbench.bench.ranking.ranking import boards
from gripbench.bench.running.rows import frame_of
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


def test_methods_that_the_runs_do_not_tell_apart_are_named():
    board = boards(noisy_frame({"a": 1.0, "b": 1.0, "c": 1.0, "d": 9.0}))[0]
    first, *_ = board.lines["label"]
    alike = [name for name in board.lines["label"][:3] if name != first]
    assert f"do not tell it apart from {alike[0]} or {alike[1]}." in words(board)
    clear = boards(noisy_frame({"a": 1.0, "b": 2.0}))[0]
    assert "tell it apart" not in words(clear)


def test_a_best_method_that_is_no_better_than_a_guess_is_called_so():
    board = boards(noisy_frame({"a": 3.0, "b": 4.0, "guess": 1.0}, **GUESS))[0]
    said = words(board)
    assert f"With {board.lines['sensors'][0]} no method is better than the guess guess: " in said
    assert "The best of them is a: " in said
    (answer,) = answers(noisy_frame({"a": 3.0, "b": 4.0, "guess": 1.0}, **GUESS), ["mu_front"])
    assert not answer.useful
    assert "none is better than guess; best: a" in plain(answer_table([answer]))


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
     ("double_lane_change_ice", "ice"), ("slalom_snow@1", "any"), ("none_such", "unknown")],
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


def test_one_table_of_boards_names_the_unit_of_each():
    angle = {"target": "sideslip"}
    frame = noisy_frame({"a": 1.0, "b": 2.0, "c": 0.1, "d": 0.2}, c=angle, d=angle)
    lines = csv.DictReader(io.StringIO(csv_text(one_table(boards(frame)))))
    found = {line["Method"]: (line["Target"], line["Unit"], float(line["RMS"])) for line in lines}
    assert found["a"][:2] == ("mu_front", "-")
    assert found["c"][:2] == ("sideslip", "deg")
    board = next(board for board in boards(frame) if board.target == "sideslip")
    assert found["c"][2] == pytest.approx(
        np.rad2deg(board.lines.set_index("label").loc["c", "rms"])
    )


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


def test_level_one_and_its_production_cars_stand_first_and_the_papers_setting_last():
    bus = ("wheel_speed_front", "steer_angle", "yaw_rate", "accel_y")
    assert instruments(bus) == PRODUCTION
    of_label = {"guess": {"sensors": bus, "baseline": True}, "bus": {"sensors": bus},
                "gps": {"sensors": (*bus, "speed_gps")}}  # fmt: skip
    frames = [
        noisy_frame({"bus": 0.3, "gps": 0.1, "guess": 0.5}, scenarios=(scenario,), **of_label)
        for scenario in ("constant_mu", "constant_mu@1", "constant_mu@2")
    ]
    frame = pd.concat(frames, ignore_index=True)
    found = answers(frame, ["mu_front"])
    assert [(one.setting, one.method) for one in found] == [
        ("production spread", "bus"), ("production spread", "gps"),
        ("wide spread, level 2", "bus"), ("wide spread, level 2", "gps"),
        ("the papers' setting", "bus"), ("the papers' setting", "gps"),
    ]  # fmt: skip
    made, shown = build(frame)
    assert shown[0].sensors == PRODUCTION
    assert [board.scenarios[0] for board in shown] == [
        name for name in ("constant_mu@1", "constant_mu@2", "constant_mu") for _ in range(3)
    ]
    text = text_of(made, shown)
    assert text.index("# Level 1") < text.index("# Wide") < text.index("# Level 0, the papers'")
    assert made.answers_found() == found
    assert found_boards(frame, ["mu_front"])[0].scenarios[0] == "constant_mu@1"


def test_more_sensors_that_give_a_larger_error_are_no_answer():
    """By score the larger set's method is first, by the error that is shown it is not."""

    def frame(on_the_hill):
        rms = {"a": (1.0, 1.0), "c": (3.0, 3.0), "b": (0.1, on_the_hill)}
        return frame_of([
            row(label, seed, value * (1.0 + 0.01 * seed), scenario,
                sensors=GPS if label == "b" else TORQUE)
            for label, values in rms.items()
            for scenario, value in zip(("step", "hill"), values, strict=True)
            for seed in range(12)
        ])  # fmt: skip

    assert [one.method for one in answers(frame(0.9), ["mu_front"])] == ["a", "b"]
    assert [one.method for one in answers(frame(2.0), ["mu_front"])] == ["a"]
