"""A command starts without the libraries that only some commands need."""

import subprocess
import sys

import pytest

HEAVY = ("asammdf", "dask", "distributed", "matplotlib", "plotly", "scipy.signal", "scipy.stats")

START = "from gripbench.bench.command_line import application; application()"
RUN = (
    START + "; from typer.testing import CliRunner; "
    "done = CliRunner().invoke(application(), ['run', '--scenario', {scenario!r}, '--seeds', '2', "
    "'--method', 'slip_slope', '--workers', '1', '--results', {results!r}]); "
    "assert done.exit_code == 0, done.output"
)


def loaded_by(code):
    report = "; import sys; print(*sorted(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code + report], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


def test_help_needs_no_numerics():
    assert loaded_by(START).isdisjoint({*HEAVY, "numba", "pandas", "scipy"})


def test_run_and_what_it_prints_need_no_figures_and_no_other_formats(short_scenario, tmp_path):
    loaded = loaded_by(RUN.format(scenario=short_scenario, results=str(tmp_path)))
    assert {"numba", "pandas"} <= loaded
    assert loaded.isdisjoint({*HEAVY, "scipy.special"})


@pytest.mark.parametrize(
    "module", ["gripbench", "gripbench.bench.running.api", "gripbench.bench.ranking.ranking"]
)
def test_the_python_interface_needs_no_figures(module):
    assert loaded_by(f"import {module}").isdisjoint(HEAVY)
