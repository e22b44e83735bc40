"""Tables of a run: units, what fits a terminal, responses, and what was skipped."""

import re

import numpy as np
import pytest
import synthetic_rows
from rich.console import Console

from gripbench.bench.publishing import presentation
from gripbench.bench.publishing.tables import plain, terminal
from gripbench.bench.ranking.summary import summary
from gripbench.bench.running.rows import frame_of

SCENARIOS = tuple(f"a_scenario_with_a_long_name_{k}" for k in range(9))


def text_of(rows, width=120):
    found = presentation.rms_tables(summary(frame_of(rows)), width)
    console = Console(width=width, highlight=False, force_terminal=False)
    with console.capture() as captured:
        for table in found:
            console.print(terminal(table))
    assert "…" not in captured.get()
    assert max(map(len, captured.get().splitlines())) <= width
    return "".join(map(plain, found))


def rows_of(target, scenarios, **more):
    return [
        synthetic_rows.row(label, seed, value, scenario, target, **more)
        for scenario in scenarios
        for label, value in (("a", 0.01), ("kinematic_kalman_filter:scale_factor", 0.02))
        for seed in range(2)
    ]


def test_angles_are_shown_in_degrees():
    text = text_of(rows_of("sideslip", ("one",)))
    assert "sideslip [deg]" in text
    assert f"{np.degrees(0.01):.3f}" in text
    assert "yaw_rate [deg/s]" in text_of(rows_of("yaw_rate", ("one",)))


@pytest.mark.parametrize("width", [100, 120])
def test_many_scenarios_become_blocks_within_the_width(width):
    lines = text_of(rows_of("sideslip", SCENARIOS), width).splitlines()
    assert max(map(len, lines)) <= width
    assert "…" not in "".join(lines)
    for scenario in SCENARIOS:
        assert sum(line.strip() == scenario for line in lines) == 1
    names = [line.split()[0] for line in lines if re.search(r"\d\.\d", line)]
    assert names == ["a", "kinematic_kalman_filter:scale_factor"] * len(SCENARIOS)


def test_few_scenarios_stay_side_by_side():
    assert text_of(rows_of("sideslip", ("one", "two")), 120).count(" one ") == 1
    assert re.search(r"one.*two", text_of(rows_of("sideslip", ("one", "two")), 120))


def test_the_response_of_the_friction_has_its_columns():
    response = synthetic_rows.response(4.0, 100, 1.5)
    late = synthetic_rows.response(4.0, 100)
    never = synthetic_rows.row("quiet", 0, 0.1, "one", "mu")
    jump = synthetic_rows.response(1.0, 100, jump_delay=0.25)
    rows = [
        synthetic_rows.row("a", seed, None, "one", "mu",
                           score=synthetic_rows.score(0.5, **friction))
        for seed, friction in enumerate((response, late))
    ]  # fmt: skip
    rows += [never, synthetic_rows.row("a", 0, None, "two", "mu",
                                       score=synthetic_rows.score(0.5, **jump))]  # fmt: skip
    text = text_of(rows)
    line = next(line for line in text.splitlines() if line.startswith("  a"))
    assert line.split() == ["a", "0.500", "0.200", "1.50", "1/2"]  # no interval from two runs
    assert "not excited" in text
    assert "mu: delay [s] from the jump of the friction" in text
    assert re.search(r"a +0\.25 +1/1", text)
    assert max(map(len, text.splitlines())) <= 120


def test_skipped_methods_take_one_line_for_each_reason(capsys):
    more = {"status": "skipped", "reason": "no sensor for 'x'"}
    rows = [
        synthetic_rows.row("a", seed, None, scenario, "mu", **more)
        for scenario in ("one", "two")
        for seed in range(3)
    ]
    rows += [synthetic_rows.row("b", 4, None, "one", "mu", reason="ValueError: no")]
    presentation.print_failures(frame_of(rows))
    assert capsys.readouterr().out.splitlines() == [
        "failed: b on one (seed 4): ValueError: no",
        "skipped: a: no sensor for 'x': one, two",
    ]


def test_an_interval_has_two_ends_or_is_left_out():
    assert presentation.bounded(9.07, 9.0699, 9.0701) == "9.07 [9.0699, 9.0701]"
    assert presentation.bounded(9.07, 9.07, 9.07) == "9.07"
