"""Traps that other benchmarks' users fell into; docs/reliability.md names the test of each."""

import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import gripbench
from gripbench.bench.catalogue.declarations import declaration_of
from gripbench.bench.command_line import application
from gripbench.bench.running.execution import execute

ROOT = Path(__file__).parents[2]

DAWDLES = """
import time

class Dawdles:
    name = "dawdles"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 50:
            time.sleep(1.5)
        return {"mu_front": 0.5}
"""


def test_a_method_that_raises_is_told_and_counted(plugins, short_scenario, tmp_path):
    call = ["run", "--scenario", short_scenario, "--method", f"{plugins}/faulty.py:Raises",
            "--workers", "1", "--results", str(tmp_path)]  # fmt: skip
    printed = CliRunner().invoke(application(), call).output
    assert "1 cells (1 failed)" in printed
    assert "ValueError: no luck" in printed
    row = gripbench.read_rows(tmp_path).iloc[0]
    assert (row["status"], np.isnan(row["rms"])) == ("failed", True)


def test_a_limit_of_time_cuts_off_and_a_longer_one_runs_the_cell_again(short_scenario, tmp_path):
    """A method that would finish, but late, is not recorded as if it had kept the limit."""
    plugin = tmp_path / "dawdles.py"
    plugin.write_text(DAWDLES, encoding="utf-8")

    def run(limit):
        rows = gripbench.run(
            scenarios=[short_scenario], methods=[str(plugin)], workers=1,
            results=tmp_path / "r", time_limit=limit,
        )  # fmt: skip
        file = next((tmp_path / "r").rglob("0.json"))
        return rows["status"].iloc[0], file.stat().st_mtime_ns

    first = run(0.5)
    assert first[0] == "timeout"
    assert run(0.5) == first  # stored
    later = run(60.0)
    assert later[0] == "ok"
    assert run(0.5) == later  # what is finished stays


class Counts:
    """Its estimate is the number of the run that made it; the first run is slow."""

    name = "counts"
    sensors = ("accel_x",)
    estimates = ("mu_front",)
    runs = 0

    def reset(self, vehicle, dt):
        Counts.runs += 1

    def update(self, obs):
        return {"mu_front": float(Counts.runs)}


def test_times_and_estimates_are_of_the_same_run():
    """No best of several runs stands beside the accuracy of another one."""
    scenario = gripbench.load_scenario("constant_mu").model_copy(update={"horizon": 0.2})
    recording = gripbench.record(scenario, 0)
    declaration = declaration_of(Counts(), "", {})
    before = Counts.runs
    outcome = execute(Counts(), declaration, recording.vehicle, recording.observations, 1e-3, True)
    assert Counts.runs == before + 1
    assert (outcome.estimates["mu_front"] == Counts.runs).all()
    assert outcome.runtime.samples == len(recording.observations)


def test_a_batch_is_timed_once_and_gives_the_estimates():
    calls = []

    class Batch(Counts):
        def run(self, vehicle, observations):
            calls.append(len(observations))
            estimates = np.zeros(len(observations), [("mu_front", float)])
            estimates["mu_front"] = len(calls)
            return estimates

    scenario = gripbench.load_scenario("constant_mu").model_copy(update={"horizon": 0.2})
    recording = gripbench.record(scenario, 0)
    declaration = declaration_of(Batch(), "", {})
    outcome = execute(Batch(), declaration, recording.vehicle, recording.observations, 1e-3, False)
    assert calls == [2, len(recording.observations)]  # two samples compile
    assert (outcome.estimates["mu_front"] == 2.0).all()


def test_every_test_that_the_documentation_names_exists():
    text = (ROOT / "docs/reliability.md").read_text(encoding="utf-8")
    table = text[text.index("## Traps") :]
    named = re.findall(r"`(test_\w+)::(test_\w+)`", table)
    assert len(named) >= 12
    for module, name in named:
        found = list((ROOT / "tests").rglob(f"{module}.py"))
        assert found, module
        assert f"def {name}(" in found[0].read_text(encoding="utf-8"), name


@pytest.mark.parametrize("key", ["seds", "method"])
def test_an_unknown_key_of_a_suite_is_an_error(key, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        'name = "mine"\ndescription = "x"\nscenarios = ["constant_mu"]\n'
        f'methods = ["slip_slope"]\n{key} = 3\n',
        encoding="utf-8",
    )
    done = CliRunner().invoke(application(), ["run", "--suite", str(path)])
    assert f"unknown key '{key}': did you mean" in str(done.exception)
    assert not (tmp_path / "results").exists()
