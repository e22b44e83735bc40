"""The environments as the command line and the documentation show them."""

import subprocess
import sys
from pathlib import Path

import gymnasium
import pytest
from typer.testing import CliRunner

from gripbench.bench.catalogue.environments import (
    action_lines,
    ends,
    environment_lines,
    environment_settings,
    markdown,
    observation_lines,
)
from gripbench.bench.command_line import application
from gripbench.envs.worlds import load_scenario, record, scenario_files
from gripbench.errors import InputError

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs/environments.md"


@pytest.mark.parametrize("table", [environment_lines, action_lines, observation_lines])
def test_the_page_holds_the_tables_of_the_code(table):
    assert markdown(table()) in PAGE.read_text(encoding="utf-8")


def test_every_environment_is_listed():
    _, lines = environment_lines()
    stepped = [load_scenario(name).environment for name in scenario_files()]
    assert {line[0] for line in lines} == set(filter(None, stepped))


def test_one_environment_is_shown_with_units_and_ranges():
    shown = environment_settings("gripbench/FrictionStep-v0")
    assert [item["name"] for item in shown["actions"]] == ["torque_front", "torque_rear"]
    assert shown["observation"]["speed_gps"]["unit"] == "m/s"
    requested = {name for name, item in shown["observation"].items() if item["on_request"]}
    assert "speed_x_rate" in requested
    plain = gymnasium.make("gripbench/FrictionStep-v0").observation_space
    assert set(plain.spaces) == set(shown["observation"]) - requested


def test_the_nearest_environment_is_named():
    with pytest.raises(InputError, match="gripbench/FrictionStep-v0"):
        environment_settings("gripbench/FrictonStep-v0")
    done = CliRunner().invoke(application(), ["show", "gripbench/ConstantMu-v0"])
    assert done.exit_code == 0
    assert '"torque_front"' in done.output


@pytest.mark.parametrize("name", ["split_mu_braking", "two_turns_bicycle"])
def test_a_run_ends_as_listed(name):
    scenario = load_scenario(name)
    assert record(scenario, 0).termination in ("", *ends(scenario))


def test_a_script_beside_a_folder_of_the_same_name_finds_the_package(tmp_path):
    (tmp_path / "gripbench" / "docs").mkdir(parents=True)  # a clone, as Python sees it
    script = tmp_path / "script.py"
    script.write_text("import gripbench\nprint(gripbench.__file__, gripbench.run)\n")
    done = subprocess.run([sys.executable, script], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert str(Path("gripbench") / "__init__.py") in done.stdout


@pytest.mark.slow
def test_the_example_prints_what_the_page_shows(tmp_path):
    script = ROOT / "examples/train_anti_lock.py"
    done = subprocess.run(
        [sys.executable, script], cwd=tmp_path, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout in PAGE.read_text(encoding="utf-8")
