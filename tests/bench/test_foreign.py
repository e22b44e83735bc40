"""Methods in C and in programs of their own: the same numbers, the same checks, the same keys."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import gripbench
from gripbench.bench.catalogue.declarations import Source
from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.running.execution import run_online
from gripbench.bench.running.store import Store
from gripbench.envs.worlds import load_scenario, record
from gripbench.errors import GripbenchError, InputError

EXAMPLES = Path(__file__).parents[2] / "examples"
GCC = ("gcc", "-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC")
needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
TWIN = """
class Twin:
    name = "twin"
    sensors = ("accel_x",)
    estimates = ("force_x_front",)
    vehicle_parameters = ("mass",)

    def reset(self, vehicle, dt):
        self.mass, self.smooth, self.before = vehicle["mass"], 0.0, 0.0

    def update(self, obs):
        elapsed = obs["time"] - self.before
        self.before = obs["time"]
        if elapsed > 0.0:
            self.smooth += elapsed / (0.05 + elapsed) * (obs["accel_x"] - self.smooth)
        return {"force_x_front": 0.5 * self.mass * self.smooth}
"""


def _build(folder, source="smoothed_force.c", change=("", "")):
    text = (EXAMPLES / "c" / source).read_text().replace(*change)
    (folder / source).write_text(text)
    for name in ("gripbench_method.h", "smoothed_force_c.py"):
        shutil.copy(EXAMPLES / "c" / name, folder)
    library = folder / "libsmoothed_force.so"
    built = folder / "built.so"
    subprocess.run([*GCC, "-o", built, folder / source], check=True)
    built.replace(library)
    return folder / "smoothed_force_c.py"


@pytest.fixture
def program(tmp_path):
    for path in (EXAMPLES / "program").glob("*.py"):
        shutil.copy(path, tmp_path)
    return tmp_path / "smoothed_force_program.py"


@pytest.fixture
def twin(tmp_path):
    path = tmp_path / "twin.py"
    path.write_text(TWIN)
    return path


def _estimates(path, recording, parameters=None):
    spec = Source("file", f"{path}:").make("", parameters or {})
    from gripbench.bench.catalogue.declarations import declaration_of

    return run_online(spec, declaration_of(spec), recording.vehicle, recording.observations)


@needs_gcc
def test_c_program_and_python_give_the_same_estimates(tmp_path, program, twin, short_scenario):
    recording = record(load_scenario(short_scenario), 0)
    expected = _estimates(twin, recording)["force_x_front"]
    for path in (_build(tmp_path), program):
        found = _estimates(path, recording)["force_x_front"]
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=0.0)
    slow = _estimates(tmp_path / "smoothed_force_c.py", recording, {"time_constant": 0.5})
    assert not np.allclose(slow["force_x_front"], expected, rtol=0.1)


@pytest.mark.slow
@needs_gcc
def test_they_rank_beside_a_built_in_one_and_run_again_when_they_change(
    tmp_path, program, short_scenario
):
    source, results = _build(tmp_path), tmp_path / "results"
    lines = []
    choices = [f"{source}", f"{source}:SmoothedForceC:slow", str(program), "force_of_acceleration"]

    def run():
        frame = gripbench.run(
            scenarios=[short_scenario], methods=choices, results=results, workers=1
        )
        lines.append(frame[frame["target"] == "force_x_front"].set_index("label"))
        return lines[-1]

    first = run()
    assert set(first["status"]) == {"ok"}
    assert first.loc["smoothed_force_c", "rms"] == first.loc["smoothed_force_program", "rms"]
    assert first.loc["smoothed_force_c:slow", "rms"] != first.loc["smoothed_force_c", "rms"]
    assert first.loc["smoothed_force_c", "step_p50"] > 0.0
    board = gripbench.rank(gripbench.read_rows(results), target="force_x_front", sensors="any")
    assert set(board["label"]) == set(first.index)
    rows = {row.label: row for row in Store(results).read_all()}
    assert rows["smoothed_force_program"].untracked == ("another program",)
    assert not rows["smoothed_force_c"].untracked
    _build(tmp_path, change=("0.5 * state->mass", "0.6 * state->mass"))
    second = run()
    assert second.loc["smoothed_force_c", "key"] != first.loc["smoothed_force_c", "key"]
    assert second.loc["smoothed_force_c", "rms"] != first.loc["smoothed_force_c", "rms"]
    (tmp_path / "libsmoothed_force.so").unlink()
    with pytest.raises(InputError, match=r"libsmoothed_force\.so"):
        choose_method(str(source))


@needs_gcc
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("return 0; /* missing", "return 7; /* missing"), ""),
        (("estimates[0] = 0.5", "return 3; estimates[0] = 0.5"), "gripbench_update returned 3"),
        (("if (state) {", "if (step > 0.0) return 0; if (state) {"), "returned NULL"),
        (("gripbench_end", "other_end"), "gripbench_end"),
    ],
)
def test_a_library_that_goes_wrong_says_where(tmp_path, short_scenario, change, words):
    source = _build(tmp_path, change=change) if "other" not in change[1] else None
    if source is None:
        text = (EXAMPLES / "c" / "smoothed_force.c").read_text()
        text = text.replace("void gripbench_end", "void other_end")
        (tmp_path / "odd.c").write_text(text)
        shutil.copy(EXAMPLES / "c" / "gripbench_method.h", tmp_path)
        shutil.copy(EXAMPLES / "c" / "smoothed_force_c.py", tmp_path)
        library = tmp_path / "libsmoothed_force.so"
        subprocess.run([*GCC, "-o", library, tmp_path / "odd.c"], check=True)
        source = tmp_path / "smoothed_force_c.py"
    recording = record(load_scenario(short_scenario), 0)
    if not words:  # every sample of this recording is whole
        assert np.isfinite(_estimates(source, recording)["force_x_front"]).all()
        return
    with pytest.raises(GripbenchError, match=words) as error:
        _estimates(source, recording)
    assert "\n" not in str(error.value)


ODD = {
    "ends": ("sys.exit(4)", "ended with exit code 4"),
    "words": ("print('hello', flush=True)", "answered 'hello', which is no JSON object"),
    "a list": ("print('[1]', flush=True)", r"answered '\[1\]', which is no JSON object"),
    "another": ("print('{\"mu\": 1.0}', flush=True)", "'force_x_front' is declared"),
    "text": ('print(\'{"force_x_front": "1"}\', flush=True)', "is str; return a number"),
}


@pytest.mark.parametrize("kind", ODD)
def test_a_program_that_goes_wrong_says_how(program, short_scenario, kind):
    statement, words = ODD[kind]
    path = program.parent / "smoothed_force_lines.py"
    text = path.read_text()
    last = '    print(json.dumps({"force_x_front": force}), flush=True)\n'
    assert text.endswith(last)
    path.write_text(text.removesuffix(last) + f"    {statement}\n")
    recording = record(load_scenario(short_scenario), 0)
    with pytest.raises(GripbenchError, match=words) as error:
        _estimates(program, recording)
    assert "\n" not in str(error.value)


def test_a_missing_channel_is_null_and_the_protocol_is_the_page_s(tmp_path, monkeypatch):
    (tmp_path / "echo.py").write_text(
        "import json, sys\n"
        "heard = open('heard.txt', 'a')\n"
        "for line in sys.stdin:\n"
        "    heard.write(line); heard.flush()\n"
        "    print(json.dumps({'ready': True} if 'step' in line else {'force_x_front': 1.0}),"
        " flush=True)\n"
    )
    (tmp_path / "echo_method.py").write_text(
        "import sys\nfrom gripbench import Program\n"
        "class Echo(Program):\n"
        "    name = 'echo'\n    command = (sys.executable, 'echo.py')\n"
        "    sensors = ('accel_x',)\n    estimates = ('force_x_front',)\n"
        "    vehicle_parameters = ('mass',)\n"
    )
    method = Source("file", f"{tmp_path / 'echo_method.py'}:").make("", {})
    assert method.files == ("echo.py",)
    monkeypatch.chdir(tmp_path)
    method.reset({"mass": 1298.9, "track": 1.5}, 0.001)
    method.update({"accel_x": 0.31, "time": 0.0, "speed_gps": 20.0})
    method.update({"accel_x": float("nan"), "time": 0.001})
    method.reset({"mass": 1298.9}, 0.001)  # ends the first program
    heard = [json.loads(line) for line in (tmp_path / "heard.txt").read_text().splitlines()]
    assert heard[:3] == [
        {
            "vehicle": {"mass": 1298.9}, "settings": {}, "step": 0.001, "sensors": ["accel_x"],
            "estimates": ["force_x_front"],
        },
        {"accel_x": 0.31, "time": 0.0},
        {"accel_x": None, "time": 0.001},
    ]  # fmt: skip
    assert heard[3] == heard[0]
