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


TELL = "import sys; sys.argv = ['gripbench', {arguments}]; " + (
    "from gripbench.bench.command_line import main\n"
    "try:\n    main()\nexcept SystemExit:\n    pass\n"
    "print(); print(*sorted(sys.modules))"
)


@pytest.mark.parametrize(
    "arguments",
    ["--help", "--version", "list methods", "list scenarios", "list signals", "show slip_slope",
     "show double_lane_change_snow", "show li2014"],
)  # fmt: skip
def test_what_there_is_is_told_without_the_libraries_that_run_it(arguments):
    listed = ", ".join(map(repr, arguments.split()))
    done = subprocess.run(
        [sys.executable, "-c", TELL.format(arguments=listed)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    *told, modules = done.stdout.rstrip().splitlines()
    assert len(told) >= 1
    slow = {*HEAVY, "numba", "gymnasium", "pandas", "scipy", "joblib", "pyarrow"}
    assert slow.isdisjoint(modules.split())


MAKE = "print(gymnasium.make('gripbench/ConstantMu-v0').spec.id)"


@pytest.mark.parametrize("order", ["gripbench, gymnasium", "gymnasium, gripbench"])
def test_environments_are_known_after_both_imports_in_any_order(order):
    done = subprocess.run(
        [sys.executable, "-c", f"import {order}; {MAKE}"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stdout.strip() == "gripbench/ConstantMu-v0", done.stderr


def test_the_package_costs_no_library():
    loaded = loaded_by("import gripbench")
    assert loaded.isdisjoint({*HEAVY, "numba", "gymnasium", "pandas", "numpy", "typer"})


def test_help_needs_no_numerics():
    assert loaded_by(START).isdisjoint({*HEAVY, "numba", "pandas", "scipy"})


def test_run_and_what_it_prints_need_no_figures_and_no_other_formats(short_scenario, tmp_path):
    loaded = loaded_by(RUN.format(scenario=short_scenario, results=str(tmp_path)))
    assert {"numba", "pandas"} <= loaded
    assert not loaded & {*HEAVY, "scipy.special"}


@pytest.mark.parametrize(
    "module", ["gripbench", "gripbench.bench.running.api", "gripbench.bench.ranking.ranking"]
)
def test_the_python_interface_needs_no_figures(module):
    assert loaded_by(f"import {module}").isdisjoint(HEAVY)
