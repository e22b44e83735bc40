"""Faulty runs beside their clean twins: plans, pairs, recovery, and what is refused."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from synthetic_rows import noisy_rows

from gripbench.bench.publishing.degradation_table import degradation_tables, every_line
from gripbench.bench.publishing.leaderboard import build, read, write
from gripbench.bench.publishing.report import page
from gripbench.bench.ranking.degradation import degradation
from gripbench.bench.ranking.ranking import boards
from gripbench.bench.running.api import plan_of
from gripbench.bench.running.fault_plans import fault_names, with_fault_scenarios
from gripbench.bench.running.rows import frame_of
from gripbench.bench.scoring.recovery import recovery
from gripbench.envs.recordings import Recording
from gripbench.envs.signals import record_type
from gripbench.errors import InputError


def line(scenario, seed, squares, status="ok", recovered=math.nan):
    return {
        "scenario": scenario, "seed": seed, "label": "m", "target": "mu", "status": status,
        "sum_of_squares": squares, "count": 10, "recovery": recovered,
    }  # fmt: skip


def test_only_pairs_count_and_lost_runs_are_named():
    frame = pd.DataFrame(
        [
            line("a", 0, 1.0), line("a", 1, 1.0), line("b", 0, 1.0),
            line("a+freeze:3", 0, 4.0, recovered=2.0),
            line("a+freeze:3", 1, 4.0, recovered=math.inf),
            line("b+freeze:3", 0, 16.0, recovered=1.0),
            line("c+freeze:3", 0, 1e9),  # no twin
            line("a+drift:3", 0, 0.0, status="diverged"),
        ]
    )  # fmt: skip
    table = degradation(frame).set_index("fault")
    assert table.loc["freeze:3", "ratio"] == pytest.approx(math.sqrt(2.0 * 4.0))
    assert table.loc["freeze:3", "pairs"] == 3
    assert table.loc["freeze:3", "recovery"] == 2.0
    assert table.loc["freeze:3", "recovered"] == pytest.approx(2.0 / 3.0)
    assert table.loc["drift:3", "lost"] == 1
    assert (table["kind"] + ":" + table["severity"].astype(str)).tolist() == table.index.tolist()
    methods, faults = degradation_tables(table.reset_index())
    assert methods.rows[0]["label"] == "m"
    assert methods.rows[0]["worst"] == "freeze:3 2.83"
    assert methods.rows[0]["lost"] == 1
    assert {row["kind"] for row in faults.rows} == {"freeze", "drift"}
    assert len(every_line(table.reset_index(), "mu").rows) == 2


def damaged(scenarios=("step", "step+freeze:3", "step+freeze:1+drift:2")):
    return frame_of(noisy_rows({"a": 1.0, "b": 2.0}, seeds=12, scenarios=scenarios))


def test_a_board_knows_no_faulty_runs_and_the_leaderboard_has_them_apart(tmp_path):
    (board,) = boards(damaged(), "mu_front", "any")
    assert board.scenarios == ("step",)
    (chosen,) = boards(damaged(), "mu_front", "any", scenarios=["step+freeze:3"])
    assert chosen.scenarios == ("step+freeze:3",)
    made, found = build(damaged())
    assert all(one.scenarios == ("step",) for one in found)
    assert {(one["kind"], one["severity"]) for one in made.faults} == {
        ("freeze", 3), ("freeze:1+drift:2", 0),
    }  # fmt: skip
    paths = write(tmp_path, made, found)
    assert "faults.csv" in {path.name for path in paths}
    assert "# Faults of the instruments" in (tmp_path / "leaderboard.md").read_text()
    assert read(tmp_path).faults == made.faults
    assert [path.name for path in write(tmp_path, *build(damaged(["step"])))] == [
        "leaderboard.md", "leaderboard.csv", "leaderboard.json",
    ]  # fmt: skip


def test_the_report_has_the_faults():
    made = page.page(damaged(), ("mu_front",), {}, Path("nowhere"))
    assert "what each fault of the instruments does" in made
    assert '<section id="faults">' in made
    assert "No run with a fault" in page.page(damaged(["step"]), ("mu_front",), {}, Path("nowhere"))


@pytest.mark.parametrize(("until", "expected"), [(4.0, 0.0), (7.0, 2.0), (20.0, None)])
def test_recovery_is_the_time_until_both_errors_agree(until, expected):
    time = np.arange(0.0, 10.0, 0.01)
    truth = np.zeros(len(time), record_type(("time", "mu")))
    truth["time"] = time
    clean = np.zeros(len(time), record_type(("mu",)))
    clean["mu"] = 0.01
    faulty = clean.copy()
    faulty["mu"][(time > 3.0) & (time < until)] = 1.0
    run = Recording("a", 0, {}, truth, truth, notes={"fault_end": 5.0}, clean=truth)
    found = recovery(faulty, clean, "mu", run).value
    assert found == (
        None if expected is None else pytest.approx(expected + 0.5 * (expected > 0), abs=0.02)
    )


def test_a_plan_holds_every_twin_and_leaves_out_what_does_not_fit():
    plan = plan_of("", ["friction_step", "slalom_snow"], ["zero_sideslip"], 1)
    names = [item.name for item in with_fault_scenarios(plan, "magnetic_disturbance:2").scenarios]
    assert names == ["friction_step", "slalom_snow", "slalom_snow+magnetic_disturbance:2"]


@pytest.mark.parametrize(
    "text", ["magnetic_disturbance:2", "freeze:6", "freze:2", ",", "freeze:2:yaw_rate"]
)
def test_a_fault_that_fits_nothing_is_refused(text):
    plan = plan_of("", ["friction_step"], ["slip_slope"], 1)
    with pytest.raises(InputError, match="fault"):
        with_fault_scenarios(plan, text)


def test_names_of_faults():
    assert fault_names("freeze") == tuple(f"freeze:{number}" for number in range(1, 6))
    assert fault_names("freeze:2+drift:1, dropout:3") == ("freeze:2+drift:1", "dropout:3")
    assert len(fault_names("all")) == 3 * 14
