"""What the runner costs beside the work that it runs, and a run in which nothing is left to do.

GRIPBENCH_SEEDS=100 pytest tests/benchmarks/test_runner_overhead.py -n 0 --benchmark-enable -s
"""

import os
import time

import pytest

from gripbench.bench import runner
from gripbench.bench.api import plan_of
from gripbench.bench.backends import Backend
from gripbench.bench.cells import run_tasks
from gripbench.bench.runner import run_plan
from gripbench.bench.store import Store

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
    benchmark.extra_info["cell_ms"] = 1e3 * spent[0] / plan.cells
    print(
        f"\n{plan.cells} cells: {1e3 * spent[0] / plan.cells:.2f} ms of work a cell, "
        f"{1e3 * (whole - spent[0]) / plan.cells:.2f} ms of runner, {100 * overhead:.1f} %"
    )
    assert report.computed == plan.cells
    assert overhead > 0.0


def test_a_warm_run_of_the_longitudinal_suite(benchmark, plan, tmp_path):
    run_plan(plan, Store(tmp_path), Backend(workers=1))
    report = benchmark(run_plan, plan, Store(tmp_path), Backend(workers=1))
    assert (report.computed, report.stored) == (0, plan.cells)
