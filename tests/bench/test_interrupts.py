"""An interrupt, a limit, a closed pipe: one line says what is kept, and nothing is left hanging."""

import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.running import cells
from gripbench.bench.running.backends import Backend
from gripbench.bench.running.deadline import DeadlineError, deadline
from gripbench.bench.running.isolation.limits import Limits
from gripbench.bench.running.runner import Plan, run_plan
from gripbench.bench.running.store import Store

COMMAND = (sys.executable, "-m", "gripbench.bench.command_line")


def started(*arguments, **options):
    return subprocess.Popen(
        [*COMMAND, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, start_new_session=True, **options,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("rows", [0, 1])
def test_an_interrupted_run_says_what_is_kept(short_scenario, tmp_path, rows):
    results = tmp_path / "r"
    run = ["run", "--scenario", short_scenario, "--method", "slip_slope", "--seeds", "3000"]
    process = started(*run, "--workers", "2", "--results", results)
    while sum(1 for _ in Store(results).files()) < rows:
        assert process.poll() is None
        time.sleep(0.01)
    if rows == 0:
        time.sleep(2.0)  # while workers start
    children = psutil.Process(process.pid).children(recursive=True)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all of them
    with process:
        _, said = process.communicate(timeout=60)
    kept = sum(1 for _ in Store(results).files())
    assert process.returncode == 130
    lines = said.strip().splitlines()
    assert len(lines) == 1, said
    assert lines[0].startswith("gripbench: interrupted; ")
    if rows:
        assert f"{kept} of 3000 rows are kept in {results}: the same command goes on" in lines[0]
        assert kept >= rows
    _, alive = psutil.wait_procs(children, timeout=10)
    assert not [child for child in alive if child.status() != psutil.STATUS_ZOMBIE]


def test_a_reader_that_goes_away_is_no_traceback(tmp_path):
    with started("list", "scenarios") as process:
        process.stdout.close()
        said = process.stderr.read()
    assert "Traceback" not in said


def test_a_parent_of_the_export_that_is_a_file_is_noticed_before_the_work(short_scenario, tmp_path):
    (tmp_path / "file").write_text("mine")
    done = subprocess.run(
        [
            *COMMAND, "run", "--scenario", short_scenario, "--method", "slip_slope",
            "--export", tmp_path / "file" / "scores.csv", "--results", tmp_path / "r",
        ],
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "is a file" in done.stderr
    assert not (tmp_path / "r").exists()


def _work_for_ever():
    while True:
        pass


def test_a_deadline_ends_code_of_any_thread_and_leaves_later_code_alone():
    began = time.monotonic()
    with pytest.raises(DeadlineError), deadline(0.2):
        _work_for_ever()
    assert time.monotonic() - began < 5.0
    for _ in range(200):
        with deadline(5.0):
            pass
    time.sleep(0.2)


def test_a_simulation_that_takes_too_long_is_told_from_its_method(
    short_scenario, tmp_path, monkeypatch
):
    def endless(scenario, seed):
        while True:
            time.sleep(0.01)

    plan = Plan((find_scenario(short_scenario),), (choose_method("slip_slope"),), range(1))
    rows = []
    usual = cells.recording_of
    monkeypatch.setattr(cells, "recording_of", endless)
    run_plan(plan, Store(tmp_path), Backend(workers=1), Limits(time=0.3), on_row=rows.append)
    assert rows[0].status == "timeout"
    assert rows[0].reason == "the simulation was stopped after the time limit of 0.3 s"
    assert rows[0].time_limit == 0.3
    monkeypatch.setattr(cells, "recording_of", usual)
    report = run_plan(plan, Store(tmp_path), Backend(workers=1), Limits(time=0.3))
    assert (report.computed, report.stored) == (0, 1)
    report = run_plan(plan, Store(tmp_path), Backend(workers=1), Limits(time=20.0))
    assert report.statuses == {"ok": 1}


def test_what_a_limit_or_somebody_else_decided_runs_again(short_scenario, tmp_path):
    plan = Plan((find_scenario(short_scenario),), (choose_method("slip_slope"),), range(1))
    place = Store(tmp_path)
    run_plan(plan, place, Backend(workers=1))
    row = place.read("short", "slip_slope", 0)
    less, more = Limits(memory=100 * 1024**2), Limits(memory=200 * 1024**2)
    bad = {"status": "failed", "scores": {}, "runtime": None}
    for changes, limits, runs in (
        ({"memory_limit": 100.0}, less, 0),
        ({"memory_limit": 100.0}, more, 1),
        ({"passing": True}, less, 1),
        ({"untracked": ("another program",)}, less, 1),
        ({"dependencies": {"file:gone.npz": "0" * 32}}, less, 1),
        ({"dependencies": {"file:gone.npz": "absent"}}, less, 0),
    ):
        place.write(row.model_copy(update={**bad, **changes}))
        assert run_plan(plan, place, Backend(workers=1), limits).computed == runs, changes
