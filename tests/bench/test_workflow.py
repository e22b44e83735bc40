"""The workflow that compares a pull request with the published leaderboard finds what became worse.

Its own steps are run, as the file has them, in a fresh repository with an origin.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from synthetic_rows import noisy_rows, row
from test_leaderboard import benchmark_file

from gripbench.bench.publishing.leaderboard import build, write
from gripbench.bench.publishing.timings import read_timings
from gripbench.bench.running.rows import frame_of
from gripbench.bench.running.store import Store

yaml = pytest.importorskip("yaml")
WORKFLOW = Path(__file__).parents[2] / ".github/workflows/benchmark.yml"
STEPS = ("Leaderboard", "Compare with the target branch")
FACTORS = {"a": 1.0, "b": 2.0}


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    """An origin whose main branch holds results/leaderboard.json with runtimes."""
    origin = tmp_path_factory.mktemp("origin")
    base, found = build(
        frame_of(noisy_rows(FACTORS)), read_timings(benchmark_file(origin / "timings.json"))
    )
    write(origin / "results", base, found)
    assert base.runtimes
    identity = ("-c", "user.name=a", "-c", "user.email=a@example.org")
    for command in (
        ("init", "-q", "-b", "main"),
        ("add", "results"),
        (*identity, "commit", "-qm", "Results"),
    ):
        subprocess.run(("git", *command), cwd=origin, check=True)
    return origin


def replay(published, folder, rows, slower=1.0):
    """Return exit status and summary of the workflow's steps over these rows and timings."""
    clone, out = folder / "clone", folder / "out"
    subprocess.run(("git", "clone", "-q", str(published), str(clone)), check=True)
    store = Store(out)
    for item in rows:
        store.write(item)
    # another machine: everything takes three times as long, the kernel too
    benchmark_file(out / "timings.json", speed=3.0, slower=slower)
    command = folder / "bin" / "gripbench"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec {sys.executable} -m gripbench.bench.command_line "$@"\n')
    command.chmod(0o755)
    environment = {
        **os.environ,
        "PATH": f"{command.parent}{os.pathsep}{os.environ['PATH']}",
        "OUT": str(out),
        "BASE_BRANCH": "main",
        "GITHUB_STEP_SUMMARY": str(folder / "summary.md"),
    }
    steps = yaml.safe_load(WORKFLOW.read_text())["jobs"]["leaderboard"]["steps"]
    status = 0
    for step in (step for step in steps if step.get("name") in STEPS):
        done = subprocess.run(
            ("bash", "-eo", "pipefail", "-c", step["run"]),
            env=environment, cwd=clone, capture_output=True, text=True, timeout=300,
        )  # fmt: skip
        assert "Traceback" not in done.stderr
        status = status or done.returncode
    return status, (folder / "summary.md").read_text()


@pytest.mark.slow
def test_a_clean_change_passes(published, tmp_path):
    status, summary = replay(published, tmp_path, noisy_rows(FACTORS))
    assert status == 0
    assert "No change." in summary


@pytest.mark.slow
def test_an_rms_and_a_runtime_that_became_worse_fail_and_are_named(published, tmp_path):
    worse = noisy_rows({"a": 1.0, "b": 2.1})
    status, summary = replay(published, tmp_path, worse, slower=58.0)
    assert status == 1
    lines = [line for line in summary.splitlines() if line.startswith("| ")]
    verdicts = {(line.split(" | ")[0].strip("| "), line.split(" | ")[1]) for line in lines}
    assert {("worse", "b"), ("slower", "a")} <= verdicts


@pytest.mark.slow
def test_a_runtime_alone_fails(published, tmp_path):
    status, summary = replay(published, tmp_path, noisy_rows(FACTORS), slower=2.0)
    assert status == 1
    assert "slower" in summary
    assert "worse" not in summary


@pytest.mark.slow
def test_an_rms_alone_fails(published, tmp_path):
    rows = noisy_rows(FACTORS)
    rows[-1] = row("b", 19, None, "hill")
    status, summary = replay(published, tmp_path, rows)
    assert status == 1
    assert "failed" in summary
