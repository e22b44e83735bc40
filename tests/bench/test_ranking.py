import math

import numpy as np
import pytest
from scipy import stats
from synthetic_rows import GPS, IDEAL, TORQUE, noisy_frame, noisy_rows, row, score

from gripbench.bench.ranking.grids import instruments
from gripbench.bench.ranking.ranking import boards, columns, rank
from gripbench.bench.running.rows import Runtime, frame_of
from gripbench.bench.scoring.metric import Value
from gripbench.errors import InputError


def test_known_order_with_known_scores():
    frame = noisy_frame({"worst": 4.0, "best": 1.0, "middle": 2.0}, spread=0.0)
    found = rank(frame)
    assert tuple(found.columns) == columns()
    assert list(found["label"]) == ["best", "middle", "worst"]
    assert list(found["rank"]) == [1, 2, 3]
    np.testing.assert_allclose(found["score"], [0.5, 1.0, 2.0], rtol=1e-12)
    assert list(found["group"]) == ["a", "b", "c"]
    np.testing.assert_allclose(rank(frame, reference="best")["score"], [1.0, 2.0, 4.0], rtol=1e-12)


def test_rank_by_geometric_mean_over_scenarios_not_by_the_largest_unit():
    rows = []
    for seed in range(5):
        rows += [row("a", seed, 1000.0, "large"), row("b", seed, 900.0, "large"),
                 row("a", seed, 0.01, "small"), row("b", seed, 0.02, "small")]  # fmt: skip
    found = rank(frame_of(rows), reference="a").set_index("label")
    assert list(found.index) == ["a", "b"]
    assert found.loc["b", "score"] == pytest.approx(math.sqrt(0.9 * 2.0), rel=1e-12)
    assert found.loc["b", "rms"] < found.loc["a", "rms"]  # pooled over all samples, in the unit


def test_pooled_columns_are_by_the_mean_of_squares():
    rows = [row("a", 0, None, score=score(3.0, 100)), row("a", 1, None, score=score(4.0, 300))]
    line = rank(frame_of(rows)).iloc[0]
    assert line["rms"] == pytest.approx(math.sqrt((900 + 4800) / 400), rel=1e-12)
    assert line["rms_limit"] == pytest.approx(math.sqrt(0.75 * 5700 / 200), rel=1e-12)
    assert line["bias"] == pytest.approx((1.5 * 100 + 2.0 * 300) / 400, rel=1e-12)
    assert line["peak"] == 12.0
    assert math.isnan(line["rms_medium"])


def test_never_converged_counts_as_infinite_in_the_median():
    rows = [row("a", seed, None, score=score(1.0, convergence_time=Value(value=time)))
            for seed, time in enumerate([1.0, 2.0, None])]  # fmt: skip
    rows += [row("b", seed, None, score=score(2.0)) for seed in range(3)]
    found = rank(frame_of(rows)).set_index("label")
    assert found.loc["a", "convergence_time"] == 2.0
    assert found.loc["a", "converged"] == pytest.approx(2 / 3)
    assert found.loc["b", "convergence_time"] == math.inf


def test_noise_leaves_equal_methods_tied_and_separates_the_other():
    found = rank(noisy_frame({"a": 1.0, "b": 1.0, "c": 1.5})).set_index("label")
    assert found.loc[["a", "b"], "group"].tolist() == ["a", "a"]
    assert found.loc[["a", "b"], ["rank_from", "rank_to"]].to_numpy().tolist() == [[1, 2], [1, 2]]
    assert found.loc["c", ["rank", "rank_from", "rank_to", "group"]].tolist() == [3, 3, 3, "b"]
    assert (found["score_from"] < found["score"]).all()
    assert (found["score"] < found["score_to"]).all()


def test_equal_but_for_rounding_shares_the_rank():
    rows = [row(label, seed, (1.0 + seed) * factor) for seed in range(4)
            for label, factor in {"x": 1.0, "y": 1.0 + 1e-14, "z": 2.0}.items()]  # fmt: skip
    found = rank(frame_of(rows))
    assert list(found["rank"]) == [1, 1, 3]
    assert list(found["group"]) == ["a", "a", "b"]


def test_one_seed_ranks_but_separates_nobody():
    found = rank(noisy_frame({"a": 1.0, "b": 9.0}, seeds=1))
    assert list(found["rank"]) == [1, 2]
    assert list(found["group"]) == ["a", "a"]
    assert list(found["rank_to"]) == [2, 2]
    assert found["score_from"].isna().all()


def test_failures_rank_last_count_and_show_no_score():
    rows = noisy_rows({"bad": 9.0, "worse": 10.0}, spread=0.0)
    for seed in range(20):
        for scenario in ("step", "hill"):
            # the best RMS of all, wherever it does not fail
            rows.append(row("fails_once", seed, None if (seed, scenario) == (3, "hill") else 0.1,
                            scenario))  # fmt: skip
            rows.append(row("fails", seed, None, scenario, status="timeout", reason="5 s"))
    found = boards(frame_of(rows))[0]
    lines = found.lines.set_index("label")
    assert list(lines.index) == ["bad", "worse", "fails_once", "fails"]
    assert list(lines["rank"]) == [1, 2, 3, 4]
    assert list(lines["failures"]) == [0, 0, 1, 40]
    assert lines.loc["fails_once", ["rms", "score", "rms_limit"]].isna().all()
    assert lines.loc["fails_once", "reason"] == "failed: ValueError: no"
    assert lines.loc["fails", "reason"] == "timeout: 5 s"
    assert list(lines["rank_from"]) == [1, 2, 3, 3]
    assert list(lines["rank_to"]) == [1, 2, 4, 4]
    assert not lines["pareto"][["fails_once", "fails"]].any()
    assert found.wins.loc["fails_once", "bad"] == 39.0
    assert found.wins.loc["bad", "fails"] == 40.0
    assert list(found.p_better.index) == ["bad", "worse"]


def test_all_failing_still_has_a_board():
    rows = [row("a", seed, None) for seed in range(3)] + [row("b", seed, None) for seed in range(3)]
    found = rank(frame_of(rows))
    assert list(found["rank"]) == [1, 1]
    assert list(found["failures"]) == [3, 3]


def test_boards_of_gps_and_idealised_methods_are_apart():
    sensors = {"gps": {"sensors": GPS}, "ideal": {"sensors": IDEAL, "idealised": (IDEAL[-1],)}}
    frame = noisy_frame({"plain": 3.0, "gps": 2.0, "ideal": 1.0}, **sensors)
    found = {board.sensors: list(board.lines["label"]) for board in boards(frame)}
    assert found == {  # alone with its sensors, `plain` stands on the larger boards only
        instruments(GPS): ["gps", "plain"],
        instruments(IDEAL): ["ideal", "plain"],
    }
    assert "idealised" in instruments(IDEAL)
    mixed = rank(frame, sensors="any")
    assert list(mixed["label"]) == ["ideal", "gps", "plain"]
    assert list(mixed["idealised"]) == ["wheel_acceleration_front", "", ""]
    assert "GPS receiver" in mixed.loc[1, "reads"]
    chosen = rank(
        frame, sensors="GPS receiver, accelerometer,torque on the vehicle bus,wheel speed sensor"
    )
    assert list(chosen["label"]) == ["gps", "plain"]


def test_boards_of_targets_are_apart():
    rows = noisy_rows({"a": 1.0, "b": 2.0}) + noisy_rows(
        {"c": 2e3, "d": 1e3}, c={"target": "force_x_front"}, d={"target": "force_x_front"}
    )
    found = {board.target: list(board.lines["label"]) for board in boards(frame_of(rows))}
    assert found == {"force_x_front": ["d", "c"], "mu_front": ["a", "b"]}
    assert set(rank(frame_of(rows), target="mu_front")["label"]) == {"a", "b"}


def test_only_common_seeds_count():
    rows = noisy_rows({"a": 1.0, "b": 2.0}, seeds=5)
    rows += [row("a", seed, 1e6, scenario) for seed in (7, 8) for scenario in ("step", "hill")]
    board = boards(frame_of(rows))[0]
    assert board.seeds == (0, 1, 2, 3, 4)
    assert board.lines.loc[0, "label"] == "a"
    assert board.notes[0] == ("hill: 5 of up to 7 seeds are common to all methods ('b' has 5).")


def test_no_common_seed_is_an_error_that_names_the_method():
    rows = [row("a", 0, 1.0), row("a", 1, 1.0), row("b", 2, 1.0)]
    with pytest.raises(InputError, match="no seed of 'step' in common; run 'b' with"):
        rank(frame_of(rows))
    apart = [row("a", seed, 1.0, scenario) for scenario, first in (("s", 0), ("t", 2))
             for seed in (first, first + 1)]  # fmt: skip
    with pytest.raises(InputError, match="scenarios have no seed in common: s, t"):
        rank(frame_of(apart))


def test_scenario_that_was_not_run_counts_as_failure():
    rows = noisy_rows({"a": 2.0, "b": 1.0}, seeds=4)
    rows = [item for item in rows if (item.label, item.scenario) != ("b", "hill")]
    found = rank(frame_of(rows)).set_index("label")
    assert list(found.index) == ["a", "b"]
    assert found.loc["b", "failures"] == 4
    assert found.loc["b", "reason"] == "not run in every scenario"


def test_scenario_that_nobody_can_run_is_left_out():
    rows = noisy_rows({"a": 2.0, "b": 1.0}, seeds=4)
    rows += [row(label, 0, None, "blind", status="skipped", reason="no GPS") for label in "ab"]
    board = boards(frame_of(rows))[0]
    assert board.scenarios == ("hill", "step")
    assert list(board.lines["failures"]) == [0, 0]


def test_a_log_with_one_run_enters_beside_simulated_scenarios():
    rows = noisy_rows({"a": 1.0, "b": 1.0}, seeds=6, spread=0.01)
    rows += [row("a", 0, 1.0, "log"), row("b", 0, 8.0, "log")]
    board = boards(frame_of(rows), reference="a")[0]
    assert board.scenarios == ("hill", "log", "step")
    assert board.seeds == tuple(range(6))
    assert board.lines.loc[1, "score"] == pytest.approx(2.0, rel=0.02)


def test_method_that_nowhere_finds_its_sensors_gets_no_board_of_its_own():
    rows = noisy_rows({"a": 2.0, "b": 1.0}, seeds=4)
    rows += [row("gps", 0, None, status="skipped", sensors=GPS)]
    assert [board.sensors for board in boards(frame_of(rows))] == [instruments(TORQUE)]


def test_methods_without_a_common_scenario_stand_on_different_boards():
    rows = noisy_rows({"a": 2.0, "b": 1.0}, seeds=4, scenarios=("step", "hill"))
    rows += noisy_rows({"c": 2.0, "d": 1.0}, seeds=4, scenarios=("bend",))
    # tried there, but it found no sensors: no failure, it is at home elsewhere
    rows += [row("c", seed, None, "step", status="skipped") for seed in range(4)]
    found = {board.title.partition(" in ")[2]: list(board.lines["label"])
             for board in boards(frame_of(rows))}  # fmt: skip
    assert found == {"bend": ["d", "c"], "hill, step": ["b", "a"]}
    # one method that ran in both makes them one board, on which the others are incomplete
    rows += noisy_rows({"e": 9.0}, seeds=4, scenarios=("step", "hill", "bend"))
    (board,) = boards(frame_of(rows))
    assert list(board.lines["label"]) == ["e", "a", "b", "c", "d"]
    assert list(board.lines["failures"]) == [0, 4, 4, 4, 4]  # without the step


def test_scenario_that_lacks_a_method_s_sensors_is_no_failure_of_it():
    rows = noisy_rows({"a": 2.0}, seeds=4, scenarios=("step", "hill"))
    rows += noisy_rows({"g": 1.0}, seeds=4, scenarios=("step",), g={"sensors": GPS})
    rows += [row("g", seed, None, "hill", status="skipped", sensors=GPS) for seed in range(4)]
    (with_gps,) = boards(frame_of(rows))
    (plain,) = boards(frame_of(rows), sensors=instruments(TORQUE))
    assert plain.scenarios == ("hill", "step")
    assert with_gps.scenarios == ("step",)
    assert list(with_gps.lines["label"]) == ["g", "a"]
    assert list(with_gps.lines["failures"]) == [0, 0]
    assert with_gps.notes == ("Left out, as not every method can run there: hill.",)
    # where no scenario is left, skipped runs count
    rows = noisy_rows({"a": 1.0, "b": 1.0}, seeds=2, scenarios=("step", "hill"))
    lacking = {("a", "step"), ("b", "hill")}
    rows = [item for item in rows if (item.label, item.scenario) not in lacking]
    rows += [
        row(label, seed, None, scenario, status="skipped")
        for label, scenario in lacking
        for seed in (0, 1)
    ]
    rows += noisy_rows({"c": 9.0}, seeds=2, scenarios=("step", "hill"))
    (board,) = boards(frame_of(rows))
    assert list(board.lines["label"]) == ["c", "a", "b"]
    assert list(board.lines["failures"]) == [0, 2, 2]
    assert "skipped runs count" in board.notes[0]


def test_pareto_front_of_score_and_runtime():
    slow, fast = Runtime(batch=1e-3), Runtime(batch=1e-7)
    found = rank(noisy_frame({"a": 1.0, "b": 2.0, "c": 3.0}, a={"runtime": slow},
                             b={"runtime": fast})).set_index("label")  # fmt: skip
    assert found["pareto"].to_dict() == {"a": True, "b": True, "c": False}


def test_ranking_does_not_depend_on_the_order_of_rows_or_on_other_seeds_of_numpy():
    frame = noisy_frame({"a": 1.0, "b": 1.03, "c": 1.1})
    np.random.seed(3)  # noqa: NPY002
    shuffled = frame.sample(frac=1.0, random_state=1)
    assert rank(frame).equals(rank(shuffled))


def test_bad_input_names_what_would_be_right():
    frame = noisy_frame({"alpha": 1.0, "beta": 2.0}, seeds=2)
    for arguments, message in [
        ({"target": "mu_frnt"}, "did you mean 'mu_front'"),
        ({"labels": ["alpa"]}, "unknown method 'alpa': did you mean 'alpha'"),
        ({"scenarios": ["stp"]}, "unknown scenario 'stp': did you mean 'step'"),
        ({"sensors": "GPS reciever"}, "did you mean 'GPS receiver'"),
        ({"sensors": "GPS receiver"}, "no method estimates it with these instruments"),
        ({"reference": "gamma"}, "unknown reference on the board 'gamma'"),
        ({"confidence": 95.0}, "from 0.5 to below 1"),
    ]:
        with pytest.raises(InputError, match=message):
            rank(frame, **arguments)
    with pytest.raises(InputError, match="nothing to rank"):
        rank(frame_of([]))
    blind = [row("a", 0, None, status="skipped")]
    with pytest.raises(InputError, match="nothing to rank: every run was skipped"):
        rank(frame_of(blind))
    with pytest.raises(InputError, match="mu_front: every run was skipped"):
        rank(frame_of(blind), sensors="any")
    with pytest.raises(InputError, match="'a' has two rows for seed 0 of 'step'"):
        rank(frame_of([row("a", 0, 1.0), row("a", 0, 2.0)]))


def test_skill_is_against_the_best_guess_of_the_same_sensors():
    guesses = {"zero": {"baseline": True, "sensors": ()}, "held": {"baseline": True}}
    frame = noisy_frame({"a": 1.0, "b": 3.0, "zero": 2.5, "held": 2.0}, spread=0.0, **guesses)
    board = boards(frame)[0]
    lines = board.lines.set_index("label")
    assert board.guess == "held"
    assert lines.loc["a", "skill"] == pytest.approx(0.5)
    assert lines.loc["held", "skill"] == 0.0
    assert lines.loc["b", "skill"] == pytest.approx(-0.5)
    assert list(lines["verdict"]) == ["", "", "", "no better than a guess"]
    assert lines.loc["a", "beats_guess"] == 1.0
    assert lines.loc["b", "worse_than_guess"] == "hill, step"
    assert lines.loc["a", "beats_next"] == 1.0
    assert boards(frame, labels=["a", "b"])[0].guess == ""


def test_a_guess_that_lacks_a_sensor_takes_no_scenario_away():
    rows = noisy_rows({"a": 1.0, "b": 2.0})
    rows += [row("held", seed, 3.0, "step", baseline=True) for seed in range(20)]
    rows += [row("held", seed, None, "hill", status="skipped", baseline=True) for seed in range(20)]
    board = boards(frame_of(rows))[0]
    assert board.scenarios == ("hill", "step")
    assert list(board.lines["label"]) == ["a", "b"]


def test_a_cell_exact_to_rounding_does_not_dominate():
    """Exact in one scenario and bad in two is not better than good in all three."""
    rows = []
    for seed in range(12):
        for scenario, lucky in (("one", 1e-15), ("two", 0.3), ("three", 0.3)):
            rows.append(row("lucky", seed, lucky * (1.0 + 0.01 * seed), scenario))
            rows.append(row("good", seed, 0.03 * (1.0 + 0.01 * seed), scenario))
    assert list(rank(frame_of(rows))["label"]) == ["good", "lucky"]


def test_a_stray_run_moves_nobody():
    rows = noisy_rows({"a": 1.0, "b": 2.0, "c": 3.0})
    alone = rank(frame_of(rows))
    rows += [row("c", seed, 0.1, "elsewhere") for seed in range(20)]
    board = boards(frame_of(rows))[0]
    assert board.lines.equals(alone)
    assert board.notes == ("Left out: elsewhere, in which 1 of 3 methods ran.",)


def test_levels_and_suites_never_share_a_board():
    names = ("step", "step@1", "friction_step", "friction_step@1")
    found = boards(noisy_frame({"a": 1.0, "b": 2.0}, scenarios=names, seeds=3))
    assert {board.scenarios for board in found} == {(name,) for name in names}
    titles = {board.title.rpartition(" (")[2].rstrip(")") for board in found}
    assert {"longitudinal", "longitudinal_population", "level 1"} <= titles


def test_rows_of_two_versions_of_a_scenario_are_refused():
    rows = [row("a", seed, 1.0, world="old") for seed in range(3)]
    rows += [row("b", seed, 2.0, world="new") for seed in range(3)]
    with pytest.raises(InputError, match="rows of 'step' come from 2 versions") as caught:
        rank(frame_of(rows))
    assert "\n" not in str(caught.value)


def test_the_score_in_another_scenario_is_student_over_scenarios():
    scenarios = ("one", "two", "three", "four")
    rows = []
    for seed in range(12):
        for number, scenario in enumerate(scenarios):
            rows.append(row("a", seed, 1.0, scenario))
            rows.append(row("b", seed, 2.0 + number, scenario))
    line = rank(frame_of(rows), reference="a").set_index("label").loc["b"]
    logs = np.log([2.0, 3.0, 4.0, 5.0])
    width = stats.t.ppf(0.975, 3) * logs.std(ddof=1) / 2.0
    assert line["elsewhere_to"] == pytest.approx(np.exp(logs.mean() + width))
    assert line["elsewhere_from"] == pytest.approx(np.exp(logs.mean() - width))
    assert line["score_from"] == pytest.approx(line["score_to"])
