"""A real local Dask cluster: the same scores, also when a worker is killed in the middle."""

import os
import signal

import pytest

import gripbench
from gripbench.bench.ranking.summary import scores_csv
from gripbench.bench.running.api import plan_of
from gripbench.bench.running.backends import Backend
from gripbench.bench.running.runner import run_plan
from gripbench.bench.running.store import Store, read_rows

distributed = pytest.importorskip("distributed")

pytestmark = [
    pytest.mark.filterwarnings("ignore"),  # those of a cluster whose worker is killed
]


@pytest.mark.slow
def test_a_killed_worker_changes_nothing(short_scenario, tmp_path):
    arguments = {"scenarios": [short_scenario], "methods": ["slip_slope"], "seeds": 60}
    alone = gripbench.run(**arguments, results=tmp_path / "alone", workers=1)
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        processes = list(client.run(os.getpid).values())
        killed = []

        def kill_one(row):
            if not killed:
                killed.append(processes[0])
                os.kill(processes[0], signal.SIGKILL)

        plan = plan_of("", [short_scenario], ["slip_slope"], 60)
        report = run_plan(
            plan,
            Store(tmp_path / "cluster"),
            Backend("dask", scheduler=cluster.scheduler_address),
            on_row=kill_one,
        )
    assert killed
    assert report.computed == 60
    assert scores_csv(read_rows(tmp_path / "cluster")) == scores_csv(alone)


@pytest.mark.slow
def test_twenty_kills_of_workers_between_rows_change_nothing(short_scenario, tmp_path):
    seeds = 1500
    arguments = {"scenarios": [short_scenario], "methods": ["slip_slope"], "seeds": seeds}
    alone = gripbench.run(**arguments, results=tmp_path / "alone", workers=1)
    kills = []
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        rows = []

        def kill_now_and_then(row):
            rows.append(row)
            if len(kills) < 20 and len(rows) > 3 * len(kills) and len(rows) < seeds:
                try:
                    found = client.run(os.getpid, on_error="ignore")
                    os.kill(min(found.values()), signal.SIGKILL)
                    kills.append(len(rows))
                except (OSError, ValueError):
                    pass  # none is up at this moment

        report = run_plan(
            plan_of("", [short_scenario], ["slip_slope"], seeds),
            Store(tmp_path / "cluster"),
            Backend("dask", scheduler=cluster.scheduler_address),
            on_row=kill_now_and_then,
        )
    print(f"rows at each of {len(kills)} kills: {kills}")
    assert len(kills) == 20
    assert 0 < kills[0] < kills[-1] < seeds
    assert report.computed == seeds
    assert scores_csv(read_rows(tmp_path / "cluster")) == scores_csv(alone)
