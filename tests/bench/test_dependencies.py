"""A row is used again only while all that its method reads is the same, seen or declared."""

import json
import os
import shutil
import subprocess
import sys

import pytest

import gripbench
from gripbench.bench.running.api import plan_of
from gripbench.bench.running.backends import Backend
from gripbench.bench.running.runner import run_plan
from gripbench.bench.running.store import Store
from gripbench.errors import InputError

PLAIN = """
class Method:
    name = "{name}"; sensors = ("accel_x",); estimates = ("mu_front",); {more}

    def reset(self, vehicle, dt):
        {reset}

    def update(self, obs):
        return {{"mu_front": {gain}}}
"""

COMPILED = """
import numpy as np
{before}
from gripbench.methods.contract import CompiledMethod, compiled

@compiled
def step(state, obs, params, est):
    est.mu_front = {gain}

class Method(CompiledMethod):
    name = "{name}"; title = "t"; reference = "r"; sensors = ("accel_x",)
    estimates = ("mu_front",); parameters = (); state = np.dtype([("n", np.float64)]); step = step
"""
HERE = "import json, pathlib\nHERE = pathlib.Path(__file__).parent\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Methods that read a number somewhere; `set_gain` writes it to all these places."""
    place = tmp_path / "methods"
    elsewhere = tmp_path / "elsewhere"
    place.mkdir()
    elsewhere.mkdir()
    monkeypatch.setenv("PYTHONPATH", str(elsewhere))
    plain = {
        "weights": (HERE, "self.g = json.loads((HERE / 'gain.json').read_text())", "self.g", ""),
        "declares": (
            "",
            "self.g = float(open('declared.txt').read())",
            "self.g",
            "files = ('declared.txt',)",
        ),
        "on_path": ("import far", "pass", "far.GAIN", ""),
        "by_name": (
            "import importlib\nlate = importlib.import_module('late_' + 'helper')",
            "pass",
            "late.GAIN",
            "",
        ),
        "lists": (
            HERE,
            "self.g = max(float(p.stem) for p in (HERE / 'gains').iterdir())",
            "self.g",
            "",
        ),
    }
    for name, (before, reset, gain, more) in plain.items():
        text = before + PLAIN.format(name=name, reset=reset, gain=gain, more=more)
        (place / f"{name}.py").write_text(text)
    (elsewhere / "class_elsewhere.py").write_text(
        PLAIN.format(name="made", reset="pass", gain="self.gain", more="gain = 0.0")
    )
    compiled = {
        "constant": (HERE + "GAIN = json.loads((HERE / 'gain.json').read_text())", "GAIN"),
        "late_compiled": (
            "import importlib\ngain = importlib.import_module('late_c').gain",
            "gain()",
        ),
    }
    for name, (before, gain) in compiled.items():
        text = COMPILED.format(name=name, before=before, gain=gain)
        (place / f"{name}.py").write_text(text)
    return place


def set_gain(folder, gain):
    (folder / "gain.json").write_text(str(gain))
    (folder / "declared.txt").write_text(str(gain))
    (folder.parent / "elsewhere" / "far.py").write_text(f"GAIN = {gain}\n")
    (folder / "late_helper.py").write_text(f"GAIN = {gain}\n")
    (folder / "late_c.py").write_text(
        "from gripbench.methods.contract import compiled\n"
        f"@compiled\ndef gain():\n    return {gain}\n"
    )
    (folder / "made.py").write_text(
        f"from class_elsewhere import Method\nmethod = Method()\nmethod.gain = {gain}\n"
    )
    shutil.rmtree(folder / "gains", ignore_errors=True)
    (folder / "gains").mkdir()
    (folder / "gains" / f"{gain}.txt").touch()


def run(scenario, results, *methods):
    rows = []
    plan = plan_of("", [scenario], methods, 1)
    report = run_plan(plan, Store(results), Backend(workers=1), on_row=rows.append)
    return report, {row.label: row for row in rows}


ALL = ("weights", "declares", "on_path", "by_name", "lists", "constant", "late_compiled")


@pytest.mark.slow
def test_a_method_runs_again_when_anything_that_it_reads_is_another(
    short_scenario, folder, tmp_path
):
    names = [*(str(folder / f"{name}.py") for name in ALL), f"{folder / 'made.py'}:method"]
    set_gain(folder, 0.25)
    report, first = run(short_scenario, tmp_path / "r", *names)
    assert {row.label: row.reason for row in first.values() if row.status != "ok"} == {}
    assert not any(row.untracked for row in first.values())
    assert first["weights"].dependencies.keys() >= {"file:gain.json", "file:weights.py"}
    report, again = run(short_scenario, tmp_path / "r", *names)
    assert (report.computed, again) == (0, first)
    set_gain(folder, 0.75)
    report, second = run(short_scenario, tmp_path / "r", *names)
    assert report.computed == len(names)
    for label, row in second.items():
        moved = row.scores["mu_front"]["bias"].value - first[label].scores["mu_front"]["bias"].value
        assert moved == pytest.approx(0.5), label


def test_a_missing_file_is_a_failure_that_ends_when_it_comes_back(short_scenario, folder, tmp_path):
    set_gain(folder, 0.25)
    (folder / "gain.json").unlink()
    method = str(folder / "weights.py")
    _, rows = run(short_scenario, tmp_path / "r", method)
    assert rows["weights"].status == "failed"
    assert "No such file" in rows["weights"].reason
    assert rows["weights"].dependencies["file:gain.json"] == "absent"
    assert run(short_scenario, tmp_path / "r", method)[0].computed == 0
    (folder / "gain.json").write_text("0.25")
    report, rows = run(short_scenario, tmp_path / "r", method)
    assert (report.computed, rows["weights"].status) == (1, "ok")
    (folder / "declared.txt").unlink()
    with pytest.raises(InputError, match=r"declares: 'files' names 'declared.txt', and .* cannot"):
        run(short_scenario, tmp_path / "r", str(folder / "declares.py"))


def test_what_cannot_be_followed_is_said_and_runs_again(short_scenario, folder, tmp_path):
    (folder / "asks.py").write_text(
        "import subprocess, os\n"
        + PLAIN.format(
            name="asks",
            reset="self.g = float(subprocess.check_output(['echo', '0.5']))",
            gain="self.g",
            more="",
        )
    )
    method = str(folder / "asks.py")
    for _ in range(2):
        report, rows = run(short_scenario, tmp_path / "r", method)
        assert report.computed == 1
        assert rows["asks"].untracked == ("another program",)


def test_an_environment_variable_that_no_method_is_given_is_named(
    short_scenario, folder, tmp_path, monkeypatch
):
    (folder / "env.py").write_text(
        "import os\n"
        + PLAIN.format(
            name="env", reset="pass", gain="float(os.environ.get('MY_GAIN', '0.5'))", more=""
        )
    )
    method = str(folder / "env.py")
    _, rows = run(short_scenario, tmp_path / "r", method)
    assert rows["env"].dependencies["environment:MY_GAIN"] == "absent"
    assert run(short_scenario, tmp_path / "r", method)[0].computed == 0
    monkeypatch.setenv("MY_GAIN", "0.9")
    report, rows = run(short_scenario, tmp_path / "r", method)
    assert report.computed == 1
    assert rows["env"].untracked == ("the environment variable MY_GAIN, which no method is given",)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_a_rebuilt_library_runs_again(short_scenario, folder, tmp_path):
    def build(gain):
        (tmp_path / "gain.c").write_text(f"double gain(void) {{ return {gain}; }}")
        fresh = folder / "fresh.so"
        subprocess.run(["cc", "-shared", "-o", fresh, tmp_path / "gain.c"], check=True)
        os.replace(fresh, folder / "libgain.so")

    (folder / "native.py").write_text(
        HERE + "import ctypes\nlib = ctypes.CDLL(str(HERE / 'libgain.so'))\n"
        "lib.gain.restype = ctypes.c_double\n"
        + PLAIN.format(name="native", reset="pass", gain="lib.gain()", more="")
    )
    biases = []
    for gain in (0.25, 0.75):
        build(gain)
        report, rows = run(short_scenario, tmp_path / "r", str(folder / "native.py"))
        assert report.computed == 1
        assert "file:libgain.so" in rows["native"].dependencies
        biases.append(rows["native"].scores["mu_front"]["bias"].value)
    assert biases[1] - biases[0] == pytest.approx(0.5)


EDITED = """
import json, pathlib, sys
import gripbench
path, scenario, results = map(pathlib.Path, sys.argv[1:])
text, found = path.read_text(), []
for gain in ("0.25", "0.75"):
    path.write_text(text.replace("GAIN", gain))
    rows = gripbench.run(
        scenarios=[str(scenario)], methods=[str(path)], seeds=2, workers=2, results=results
    )
    found.append(rows["bias"].tolist())
print(json.dumps(found))
"""


@pytest.mark.slow
def test_an_edited_file_runs_anew_in_one_python_session(short_scenario, tmp_path):
    (tmp_path / "mine.py").write_text(PLAIN.format(name="mine", reset="pass", gain="GAIN", more=""))
    told = [tmp_path / "mine.py", short_scenario, tmp_path / "r"]
    done = subprocess.run(
        [sys.executable, "-c", EDITED, *told], capture_output=True, check=True, text=True
    )
    before, after = json.loads(done.stdout)
    assert [b - a for a, b in zip(before, after, strict=True)] == pytest.approx([0.5, 0.5])
    again = gripbench.run(
        scenarios=[short_scenario], methods=[str(tmp_path / "mine.py")], seeds=2,
        results=tmp_path / "r", workers=1,
    )  # fmt: skip
    assert again["bias"].tolist() == after
