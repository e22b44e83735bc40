"""What the runner costs beside the work that it runs, and a run in which nothing is left to do.

GRIPBENCH_SEEDS=100 pytest tests/benchmarks/test_runner_overhead.py -n 0 --benchmark-enable -s
"""

import math
import os
import time
from pathlib import Path

import pytest

from gripbench.bench.running import runner
from gripbench.bench.running.api import plan_of
from gripbench.bench.running.backends import Backend
from gripbench.bench.running.cells import run_tasks
from gripbench.bench.running.runner import run_plan
from gripbench.bench.running.store import Store

SEEDS = int(os.environ.get("GRIPBENCH_SEEDS", "1"))


@pytest.fixture
def plan():
    """The longitudinal suite, or one scenario of it where nothing is measured."""
    return plan_of("longitudinal", () if SEEDS > 1 else ("constant_mu",), (), SEEDS)


def test_runner_overhead_on_the_longitudinal_suite(benchmark, plan, tmp_path, monkeypatch):
    if SEEDS > 1:
        warm = plan_of("longitudinal", (), (), 1)
        run_plan(warm, Store(tmp_path / "warm"), Backend(workers=1))  # compiles
    spent = [0.0]

    def timed(tasks):
        began = time.process_time()
        rows = run_tasks(tasks)
        spent[0] += time.process_time() - began
        return rows

    monkeypatch.setattr(runner, "run_tasks", timed)
    began = time.process_time()
    report = benchmark.pedantic(
        run_plan, (plan, Store(tmp_path / "r"), Backend(workers=1)), rounds=1, iterations=1
    )
    whole = time.process_time() - began
    overhead = (whole - spent[0]) / spent[0]
    benchmark.extra_info["overhead"] = overhead
    benchmark.extra_info["cell_ms"] = 1e3 * spent[0] / plan.size
    print(
        f"\n{plan.size} cells: {1e3 * spent[0] / plan.size:.2f} ms of work a cell, "
        f"{1e3 * (whole - spent[0]) / plan.size:.2f} ms of runner, {100 * overhead:.1f} %"
    )
    assert report.computed == plan.size
    assert overhead > 0.0


def test_a_warm_run_of_the_longitudinal_suite(benchmark, plan, tmp_path):
    run_plan(plan, Store(tmp_path), Backend(workers=1))
    report = benchmark(run_plan, plan, Store(tmp_path), Backend(workers=1))
    assert (report.computed, report.stored) == (0, plan.size)


@pytest.mark.skipif(SEEDS < 2, reason="says nothing with one seed: set GRIPBENCH_SEEDS")
def test_two_workers_against_one(plan, tmp_path):
    """Wall-clock and CPU time of both, in turn and with warm workers: the best of four each.

    CPU time tells what a second worker adds where other programs take turns on the cores.
    """
    wall = {1: math.inf, 2: math.inf}
    spent = {1: math.inf, 2: math.inf}
    for turn in range(5):
        for workers in wall:
            before = _cpu_time()
            store = Store(tmp_path / f"{turn}_{workers}")
            report = run_plan(plan, store, Backend(workers=workers))
            assert report.computed == plan.size
            if turn:  # the first one compiles
                wall[workers] = min(wall[workers], report.seconds)
                spent[workers] = min(spent[workers], _cpu_time() - before)
    print(
        f"\n{plan.size} cells: one worker {wall[1]:.2f} s, CPU {spent[1]:.2f} s; "
        f"two workers {wall[2]:.2f} s, CPU {spent[2]:.2f} s; "
        f"load of the machine {os.getloadavg()[0]:.1f}"
    )


def _cpu_time():
    """Return the CPU time [s] that this process and its present children have taken (Linux)."""
    me = os.getpid()
    children = {
        child
        for path in Path(f"/proc/{me}/task").glob("*/children")
        for child in path.read_text().split()
    }
    ticks = 0
    for process in {str(me), *children}:
        fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")
