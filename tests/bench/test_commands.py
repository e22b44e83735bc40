"""The command line: what it prints, what it writes, and one line for every mistake."""

import json
import os
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from gripbench.bench.command_line import application
from gripbench.errors import GripbenchError

invoke = CliRunner().invoke


def text_of(*arguments):
    result = invoke(application(), list(arguments), catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def test_run_prints_intervals_marks_and_exports(short_scenario, tmp_path):
    arguments = [
        "run", "--scenario", short_scenario, "--method", "slip_slope", "--seeds", "3",
        "--method", "proposed_observer:paper", "--workers", "1",
        "--results", str(tmp_path / "r"), "--export", str(tmp_path / "scores.csv"),
    ]  # fmt: skip
    first = text_of(*arguments)
    assert "mu_front [-]: RMS error, pooled over 3 runs" in first
    assert "proposed_observer:paper†" in first
    assert "† reads an idealised channel" in first
    assert "6 cells (6 ok); 6 run, 0 stored already" in first
    content = (tmp_path / "scores.csv").read_bytes()
    second = text_of(*arguments)
    assert "0 run, 6 stored already" in second
    assert (tmp_path / "scores.csv").read_bytes() == content
    listed = text_of("results", "list", "--results", str(tmp_path / "r"))
    assert "slip_slope" in listed
    assert "0 to 2" in listed
    shown = text_of("results", "show", "--results", str(tmp_path / "r"), "--method", "slip_slope")
    assert "slip_slope" in shown
    assert "†" not in shown
    pruned = text_of("results", "prune", "--results", str(tmp_path / "r"), "--method", "slip_slope")
    assert "removed 3 files" in pruned


def test_prune_removes_what_is_damaged(short_scenario, tmp_path):
    text_of("run", "--scenario", short_scenario, "--method", "slip_slope", "--seeds", "2",
            "--workers", "1", "--results", str(tmp_path))  # fmt: skip
    path = tmp_path / "rows" / "short" / "slip_slope" / "1.json"
    path.write_text(path.read_text()[:50])
    (path.parent / ".1.json.99.tmp").write_text("half")
    # The scenario is not one that is known by name, so its rows are stale, too.
    assert "would remove 3 files" in text_of(
        "results", "prune", "--results", str(tmp_path), "--dry-run"
    )
    assert path.exists()
    text_of("results", "prune", "--results", str(tmp_path))
    assert not (tmp_path / "rows" / "short").exists()


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("scenarios", "friction_step"),
        ("methods", "slip_slope"),
        ("vehicles", "li2014"),
        ("signals", "wheel_speed_front"),
        ("suites", "longitudinal"),
    ],
)
def test_list_and_show_know_every_kind(kind, name):
    assert name in text_of("list", kind)
    assert json.loads(text_of("show", name))["kind"] == kind.removesuffix("s")


def test_show_gives_a_variant_with_its_settings():
    shown = json.loads(text_of("show", "proposed_observer:paper"))
    assert shown["variant"] == "paper"
    assert "wheel_acceleration_front" in shown["idealised"]


def test_the_table_of_methods_says_who_needs_gps():
    lines = text_of("methods", "table").splitlines()
    column = next(line.index("GPS receiver") for line in lines if "GPS receiver" in line)
    needs = {line.split()[0]: line[column : column + 1].strip() for line in lines[2:] if line}
    assert needs["slip_slope"] == "x"
    assert needs["proposed_observer"] == ""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run",), "nothing to run"),
        (("run", "--suite", "longitudinal", "--seeds", "none"), "seeds 'none'"),
        (("run", "--suite", "longitudinal", "--seeds", "5:5"), "at least one seed"),
        (("run", "--suite", "longitudinal", "--time-limit", "0"), "must be positive"),
        (("run", "--suite", "longitudinal", "--backend", "dsk"), "did you mean 'dask'"),
        (("run", "--suite", "longitudinal", "--scheduler", "tcp://x:1"), "needs a cluster"),
        (("show", "slip_slop"), "did you mean 'slip_slope'"),
        (("new", "method", "My-Filter"), "use lower case"),
    ],
)
def test_a_mistake_is_one_line(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = invoke(application(), list(arguments))
    assert isinstance(result.exception, GripbenchError)
    assert message in str(result.exception)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [False, True])
def test_new_method_writes_one_that_passes_and_runs(compiled, tmp_path, short_scenario):
    extra = ["--compiled"] if compiled else []
    text_of("new", "method", "my_filter", "--folder", str(tmp_path), *extra)
    path = f"{tmp_path}/my_filter.py:MyFilter"
    printed = text_of("check", path, "--scenario", "constant_mu")
    assert "of 16 checks" in printed
    assert "FAILED" not in printed
    printed = text_of("run", "--scenario", short_scenario, "--method", path, "--workers", "1",
                      "--results", str(tmp_path / "r"))  # fmt: skip
    assert "1 cells (1 ok)" in printed
    again = invoke(application(), ["new", "method", "my_filter", "--folder", str(tmp_path)])
    assert "exists already" in str(again.exception)


def test_check_ends_with_1_when_a_check_fails(plugins):
    arguments = ["check", f"{plugins}/faulty.py:Peeks", "--scenario", "constant_mu"]
    result = invoke(application(), [*arguments, "--check", "reads_only_its_channels"])
    assert result.exit_code == 1
    assert "speed_gps" in result.output


def test_an_error_is_printed_as_one_line_with_code_2(tmp_path):
    command = [sys.executable, "-m", "gripbench.bench.command_line", "show", "slip_slop"]
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=tmp_path, env=dict(os.environ), check=False
    )
    assert done.returncode == 2
    assert done.stderr == "gripbench: unknown name 'slip_slop': did you mean 'slip_slope'?\n"
