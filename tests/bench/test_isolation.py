"""Whatever a method does, it costs its own cells, leaves a row with the reason, and no more."""

import os
import subprocess
import sys
import time

import pandas as pd
import psutil
import pytest

import gripbench
from gripbench.bench.catalogue.check import check_estimator, failures
from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.running.isolation import processes
from gripbench.bench.running.isolation.limits import CellFailure, Limits
from gripbench.bench.running.isolation.sandbox import Sandbox
from gripbench.errors import InputError

FAULTS = {
    "Sound": ("ok", ""),
    "Raises": ("failed", "ValueError: no luck (in fault, faulty.py:"),
    "Hangs": ("timeout", "stopped after the time limit of 1 s"),
    "Exits": ("failed", "its process exited with code 0"),
    "Leaves": ("failed", "SystemExit: 3"),
    "Crashes": ("failed", "its process was killed by SIGSEGV"),
    "Hoards": ("failed", "out of memory (limit 300 MiB)"),
    "NotANumber": ("diverged", "mu_front is nan from t = 0.099 s"),
    "Infinite": ("diverged", "mu_front is too large to be squared"),
    "Peeks": ("failed", "peeks reads the channel 'speed_gps', which is not among its sensors"),
    "Misnames": ("failed", "the estimate 'mu_front' is declared but update does not return it"),
    "Adds": ("failed", "update returns the estimate 'mu_rear', which is not among its estimates"),
    "Nests": ("failed", "the estimate 'mu_front' is list; return a number"),
    "Demands": ("skipped", "the vehicle does not give the parameter 'yaw_inertia_of_nothing'"),
    "Blind": ("skipped", "the scenario has no sensor for 'yaw_rate'"),
    "Floods": ("failed", "the estimate 'mu_front' is Floods; return a number"),
}


def test_each_fault_costs_one_cell_and_says_why(tmp_path, plugins):
    scenario = gripbench.load_scenario("constant_mu").model_copy(update={"horizon": 0.2})
    common = {"scenarios": [scenario], "results": tmp_path, "workers": 1, "memory_limit": 300}
    others = [f"{plugins}/faulty.py:{name}" for name in FAULTS if name != "Hangs"]
    rows = gripbench.run(methods=["slip_slope", *others], **common)
    # a short limit for the one that hangs alone: a busy machine is slow to start the others
    hanging = gripbench.run(methods=[f"{plugins}/faulty.py:Hangs"], time_limit=1.0, **common)
    rows = pd.concat([rows, hanging])
    found = rows.drop_duplicates("label").set_index("label")
    assert found.loc["slip_slope", "status"] == "ok"
    assert len(found) == len(FAULTS) + 1
    wrong = {}
    for fault, (status, reason) in FAULTS.items():
        row = found.loc["".join(f"_{c.lower()}" if c.isupper() else c for c in fault).lstrip("_")]
        if row["status"] != status or not row["reason"].startswith(reason):
            wrong[fault] = (row["status"], row["reason"])
    assert wrong == {}
    assert not rows["reason"].str.contains("\n").any()
    assert set(rows.loc[rows["label"] != "slip_slope", "target"]) <= {"mu_front", ""}


def test_a_sandbox_is_usable_again_after_its_process_died(plugins):
    spec = choose_method(f"{plugins}/faulty.py:Exits")
    recording = gripbench.record(
        gripbench.load_scenario("constant_mu").model_copy(update={"horizon": 1.0}), 0
    )
    sandbox = Sandbox(Limits(time=20.0))
    observations = recording.observations[["time", "accel_x"]]
    try:
        with pytest.raises(CellFailure, match="exited with code 0"):
            sandbox.execute(
                spec.source, spec.declaration, "", {}, recording.vehicle, observations, 1e-3
            )
        short = sandbox.execute(
            spec.source, spec.declaration, "", {}, recording.vehicle, observations[:50], 1e-3
        )
        assert len(short.estimates) == 50
    finally:
        sandbox.close()


def test_no_process_outlives_its_sandbox(plugins):
    sandbox = Sandbox(Limits(time=1.0))
    source = choose_method(f"{plugins}/faulty.py:Hangs").source
    declaration = sandbox.declare(source, "", {})
    recording = gripbench.record(
        gripbench.load_scenario("constant_mu").model_copy(update={"horizon": 1.0}), 0
    )
    process = sandbox._process
    with pytest.raises(CellFailure, match="time limit"):
        sandbox.execute(
            source, declaration, "", {}, recording.vehicle, recording.observations, 1e-3
        )
    assert process is not None
    assert not psutil.pid_exists(process.number)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("def broken(:", "cannot be imported: SyntaxError"),
        ("import os; os._exit(7)", "its process exited with code 7"),
        ("x = 1", "name the class"),
        (
            "class A:\n name='a'\n sensors=('accel',)\n estimates=('mu_front',)\n"
            " def reset(self, v, d): pass\n def update(self, o): pass",
            "unknown signal 'accel'",
        ),
    ],
)
def test_a_file_that_cannot_be_used_is_one_line(tmp_path, source, message):
    path = tmp_path / "plugin.py"
    path.write_text(source, encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        choose_method(str(path))
    assert "plugin.py" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_killed_run_leaves_no_process_behind(tmp_path, plugins, short_scenario):
    command = (
        f"import gripbench; gripbench.run(scenarios=[{short_scenario!r}], workers=1, "
        f"methods=['{plugins}/faulty.py:Hangs'], results='{tmp_path}/results')"
    )
    run = subprocess.Popen([sys.executable, "-c", command])
    deadline = time.monotonic() + 90.0
    # A starter, the process that holds the plug-in, and the one of the cell.
    seen: set[int] = set()
    while time.monotonic() < deadline and len(seen) < 3:
        seen = {child.pid for child in psutil.Process(run.pid).children(recursive=True)}
        time.sleep(0.02)
    run.kill()
    run.wait()
    deadline = time.monotonic() + 5.0
    while time.monotonic() < deadline and any(_alive(child) for child in seen):
        time.sleep(0.05)
    assert len(seen) == 3
    assert not any(_alive(child) for child in seen)


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
        with open(f"/proc/{pid}/stat", encoding="ascii") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def _recorded(seconds=0.2):
    scenario = gripbench.load_scenario("constant_mu").model_copy(update={"horizon": seconds})
    return gripbench.record(scenario, 0)


@pytest.mark.slow
def test_without_forks(plugins, monkeypatch):
    """The way of systems that cannot fork: one interpreter a cell, over its standard streams."""
    monkeypatch.setattr(processes, "FORKS", False)
    recording = _recorded()
    sandbox = Sandbox(Limits())
    declaration = sandbox.declare(choose_method(f"{plugins}/faulty.py:Sound").source, "", {})
    found = []
    for name in ("Sound", "Exits"):
        source = choose_method(f"{plugins}/faulty.py:{name}").source
        try:
            outcome = sandbox.execute(
                source, declaration, "", {}, recording.vehicle, recording.observations, 1e-3
            )
            found.append(float(outcome.estimates["mu_front"].max()))
        except CellFailure as error:
            found.append(str(error))
    sandbox.close()
    assert found == [0.5, "its process exited with code 0"]


def test_nothing_beside_a_plugin_replaces_a_library(tmp_path, monkeypatch):
    for name in ("random", "signal", "copy", "scipy", "numpy", "psutil"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('not the library')\n")
    (tmp_path / "gripbench").mkdir()
    (tmp_path / "gripbench" / "__init__.py").write_text("raise RuntimeError('not this one')\n")
    (tmp_path / "own_module.py").write_text("VALUE = 0.5\n")
    plugin = tmp_path / "mine.py"
    plugin.write_text(
        "import copy, random, signal, scipy, own_module, gripbench\n"
        "class Mine:\n"
        "    name, sensors, estimates = 'mine', ('accel_x',), ('mu_front',)\n"
        "    def reset(self, vehicle, dt): pass\n"
        "    def update(self, obs): return {'mu_front': own_module.VALUE}\n"
    )
    monkeypatch.chdir(tmp_path)
    spec, recording = choose_method("mine.py"), _recorded()
    sandbox = Sandbox(Limits())
    outcome = sandbox.execute(
        spec.source, spec.declaration, "", {}, recording.vehicle, recording.observations, 1e-3
    )
    sandbox.close()
    assert (outcome.estimates["mu_front"] == 0.5).all()


def test_a_check_of_what_never_ends_ends(plugins):
    found = check_estimator(f"{plugins}/faulty.py:Hangs", ("constant_mu",), limits=Limits(time=1.0))
    assert found["declares_its_channels"] == "PASSED"
    assert failures(found) == {
        "reads_only_its_channels": "stopped after the time limit of 1 s",
    }
