"""Nothing finished is lost, nothing stale is used, and only what is missing runs."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

import gripbench
from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.ranking.summary import scores_csv
from gripbench.bench.running import runner
from gripbench.bench.running.backends import Backend, WorkerLostError
from gripbench.bench.running.runner import Plan, run_plan
from gripbench.bench.running.store import Store, read_rows
from gripbench.errors import InputError

METHODS = ("slip_slope", "individual_wheel_torque")
KILLS = 20
SEEDS = 200


@pytest.fixture
def plan(short_scenario):
    return Plan((find_scenario(short_scenario),), tuple(map(choose_method, METHODS)), range(3))


def run(plan, folder, **options):
    return run_plan(plan, Store(folder), Backend(workers=1), **options)


def files(folder):
    return {path: path.read_bytes() for path in Store(folder).files()}


def test_a_second_run_runs_nothing_and_gives_the_same(plan, tmp_path):
    first = run(plan, tmp_path)
    before = files(tmp_path)
    second = run(plan, tmp_path)
    assert (first.computed, first.stored) == (6, 0)
    assert (second.computed, second.stored) == (0, 6)
    assert files(tmp_path) == before


def test_fresh_runs_all_again_with_the_same_scores(plan, tmp_path):
    run(plan, tmp_path)
    before = scores_csv(read_rows(tmp_path))
    assert run(plan, tmp_path, fresh=True).computed == 6
    assert scores_csv(read_rows(tmp_path)) == before


def test_more_seeds_or_another_method_run_alone(plan, tmp_path):
    run(plan, tmp_path)
    more = Plan(plan.scenarios, plan.methods, range(5))
    assert run(more, tmp_path).computed == 4
    wider = Plan(plan.scenarios, (*plan.methods, choose_method("slip_slope:paper")), range(5))
    assert run(wider, tmp_path).computed == 5


def test_a_damaged_row_runs_again_alone(plan, tmp_path):
    run(plan, tmp_path)
    before = scores_csv(read_rows(tmp_path))
    path = next(Store(tmp_path).files())
    path.write_bytes(path.read_bytes()[:100])
    assert run(plan, tmp_path).computed == 1
    assert scores_csv(read_rows(tmp_path)) == before


def test_changed_parameters_are_another_cell(plan, tmp_path):
    run(plan, tmp_path)
    name = next(iter(plan.methods[0].declaration.settings))
    value = plan.methods[0].declaration.settings[name]
    changed = choose_method("slip_slope", parameters={name: value * 1.01})
    assert run(Plan(plan.scenarios, (changed,), range(3)), tmp_path).computed == 3
    assert len(read_rows(tmp_path)["label"].unique()) == 3


def test_a_changed_scenario_runs_again(plan, tmp_path):
    run(plan, tmp_path)
    changed = plan.scenarios[0].model_copy(update={"score_from": 0.5})
    assert run(Plan((changed,), plan.methods, plan.seeds), tmp_path).computed == 6


@pytest.fixture
def plugin(tmp_path):
    """A plug-in of two files; `edit` changes the shared one."""
    folder = tmp_path / "plugin"
    (folder / "shared").mkdir(parents=True)
    (folder / "shared" / "__init__.py").write_text("")
    (folder / "shared" / "gain.py").write_text("GAIN = 0.5\n")
    for name in ("First", "Second"):
        imported = "from shared.gain import GAIN" if name == "First" else "GAIN = 0.5"
        (folder / f"{name.lower()}.py").write_text(
            f"{imported}\n\n\nclass {name}:\n"
            f"    name = '{name.lower()}'\n    sensors = ('accel_x',)\n"
            "    estimates = ('mu_front',)\n\n    def reset(self, vehicle, dt):\n        pass\n\n"
            "    def update(self, obs):\n        return {'mu_front': GAIN}\n"
        )
    return folder


def test_editing_a_shared_file_runs_its_users_again_and_nothing_else(plan, plugin, tmp_path):
    def again():
        names = (str(plugin / "first.py"), str(plugin / "second.py"))
        methods = (*plan.methods, *map(choose_method, names))
        ran = []
        run(
            Plan(plan.scenarios, methods, range(1)),
            tmp_path / "r",
            on_row=lambda row: ran.append((row.label, row.scores["mu_front"]["bias"].value)),
        )
        return dict(ran)

    before = again()
    assert before["first"] == before["second"]
    stamps = {path: path.stat().st_mtime_ns for path in Store(tmp_path / "r").files()}
    (plugin / "shared" / "gain.py").write_text("GAIN = 0.6\n")
    after = again()
    assert after["first"] == pytest.approx(before["first"] + 0.1)
    changed = [
        path.parent.name
        for path in Store(tmp_path / "r").files()
        if path.stat().st_mtime_ns != stamps[path]
    ]
    assert changed == ["first"]


def test_workers_and_order_do_not_change_the_scores(plan, tmp_path):
    run(plan, tmp_path / "one")
    swapped = Plan(plan.scenarios, plan.methods[::-1], plan.seeds)
    run_plan(swapped, Store(tmp_path / "two"), Backend(workers=2))
    assert scores_csv(read_rows(tmp_path / "one")) == scores_csv(read_rows(tmp_path / "two"))


def test_a_scenario_that_cannot_be_simulated_leaves_rows(plan, tmp_path, monkeypatch):
    def fail(scenario, seed):
        raise ArithmeticError("no convergence")

    monkeypatch.setattr("gripbench.bench.running.cells.recording_of", fail)
    report = run(plan, tmp_path)
    assert report.statuses == {"failed": 6}
    reason = read_rows(tmp_path)["reason"].iloc[0]
    assert "could not be simulated: ArithmeticError: no convergence" in reason


def test_two_methods_of_one_name_are_refused(plan, tmp_path):
    twice = Plan(plan.scenarios, (plan.methods[0], plan.methods[0]), plan.seeds)
    with pytest.raises(InputError, match="'slip_slope' is given 2 times"):
        run(twice, tmp_path)


def test_the_run_goes_on_where_workers_were_lost(plan, tmp_path, monkeypatch):
    whole = tmp_path / "whole"
    run(plan, whole)
    starts = []

    def flaky(self, work, chunks):
        starts.append(1)
        for number, chunk in enumerate(chunks):
            if number == 1 and len(starts) < 3:
                raise WorkerLostError("a worker process died")
            yield work(chunk)

    monkeypatch.setattr(runner, "CHUNK", 1)
    monkeypatch.setattr(Backend, "run", flaky)
    report = run(plan, tmp_path / "flaky")
    assert len(starts) == 3
    assert report.computed == 6
    assert scores_csv(read_rows(tmp_path / "flaky")) == scores_csv(read_rows(whole))


@pytest.mark.slow
def test_a_run_that_is_killed_goes_on_and_ends_the_same(short_scenario, tmp_path):
    arguments = {"scenarios": [short_scenario], "methods": METHODS, "seeds": SEEDS, "workers": 1}
    program = Path(__file__).parent / "killed_runs.py"
    results = tmp_path / "killed"
    told = [json.dumps(arguments), str(results), str(tmp_path / "warm"), str(KILLS)]
    done = subprocess.run([sys.executable, program, *told], capture_output=True, check=True)
    kept = json.loads(done.stdout)
    print(f"rows after each of {len(kept)} kills: {kept}")
    assert len(kept) == KILLS
    assert kept == sorted(kept)  # no kill lost a row that was finished
    assert 0 < kept[-1] < 2 * SEEDS  # each hit a run at work
    before = files(results)
    after = gripbench.run(**arguments, results=results)
    assert before.items() <= files(results).items()  # nothing finished ran again
    whole = gripbench.run(**arguments, results=tmp_path / "whole")
    assert scores_csv(after) == scores_csv(whole)
    assert len(after["seed"].unique()) == SEEDS


def test_a_moved_project_keeps_its_results(plugin, tmp_path):
    first = choose_method(str(plugin / "first.py")).digest
    shutil.copytree(plugin, tmp_path / "elsewhere")
    assert choose_method(str(tmp_path / "elsewhere" / "first.py")).digest == first


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # joblib's, about the worker that is killed here
def test_a_killed_worker_process_changes_nothing(short_scenario, tmp_path):
    plan = Plan((find_scenario(short_scenario),), tuple(map(choose_method, METHODS)), range(60))
    run(plan, tmp_path / "alone")
    killed = []

    def kill_one(row):
        if not killed:
            killed.append(_a_loky_worker())
            os.kill(killed[0], signal.SIGKILL)

    report = run_plan(plan, Store(tmp_path / "r"), Backend(workers=2), on_row=kill_one)
    assert killed
    assert report.computed == 120
    assert scores_csv(read_rows(tmp_path / "r")) == scores_csv(read_rows(tmp_path / "alone"))


def _a_loky_worker():
    me = os.getpid()
    for task in os.listdir(f"/proc/{me}/task"):
        with open(f"/proc/{me}/task/{task}/children", encoding="ascii") as file:
            for child in file.read().split():
                with open(f"/proc/{child}/cmdline", "rb") as command:
                    if b"popen_loky" in command.read():
                        return int(child)
    raise AssertionError("no worker process found")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_twenty_kills_between_rows_of_parent_and_workers_change_nothing(short_scenario, tmp_path):
    seeds = 600
    run = ["run", "--scenario", short_scenario, "--method", "slip_slope", "--seeds", str(seeds)]
    command = [sys.executable, "-m", "gripbench.bench.command_line", *run, "--workers", "2"]
    results = tmp_path / "killed"
    kept, kills = [], 0

    def wait_for_a_row_after(count, process):
        while sum(1 for _ in Store(results).files()) <= count:
            assert process.poll() is None, process.stderr.read()
            time.sleep(0.002)

    for _ in range(10):
        before = sum(1 for _ in Store(results).files())
        with subprocess.Popen(
            [*command, "--results", results], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
        ) as process:
            wait_for_a_row_after(before, process)
            workers = [
                child
                for child in psutil.Process(process.pid).children()
                if "popen_loky" in " ".join(child.cmdline())
            ]
            workers[0].kill()
            kept.append(sum(1 for _ in Store(results).files()))
            wait_for_a_row_after(kept[-1], process)  # it goes on without that worker
            process.kill()
            kills += 2
        kept.append(sum(1 for _ in Store(results).files()))
    print(f"rows after each of {kills} kills: {kept}")
    assert kills == 20
    assert kept[0] > 0
    assert kept == sorted(kept)
    assert kept[-1] < seeds
    arguments = {"scenarios": [short_scenario], "methods": ["slip_slope"], "seeds": seeds}
    before = files(results)
    after = gripbench.run(**arguments, results=results, workers=2)
    assert before.items() <= files(results).items()
    whole = gripbench.run(**arguments, results=tmp_path / "whole", workers=1)
    assert scores_csv(after) == scores_csv(whole)


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix" or not shutil.which("unshare"), reason="needs unshare")
def test_a_disk_that_is_really_full(short_scenario, tmp_path):
    place = tmp_path / "small"
    place.mkdir()
    run = f"{sys.executable} -m gripbench.bench.command_line run --scenario {short_scenario}"
    run += f" --method slip_slope --seeds 60 --workers 1 --results {place}"
    script = f"""
        mount -t tmpfs -o size=100k none {place} || exit 77
        {run} >&2; echo $?
        mount -o remount,size=4m {place}
        {run} >&2; echo $?; find {place} -name '*.json' | wc -l
    """
    done = subprocess.run(["unshare", "-rm", "sh", "-c", script], capture_output=True, text=True)
    if done.returncode == 77:
        pytest.skip("no file system can be mounted here")
    assert done.stdout.split() == ["2", "0", "60"], done.stderr
    assert "cannot be written: the disk is full; make room" in done.stderr
    assert "Traceback" not in done.stderr
