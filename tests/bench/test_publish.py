from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gripbench.bench.catalogue.suites import load_suite
from gripbench.bench.command_line import application
from gripbench.bench.commands.publish import publish_paper
from gripbench.bench.publishing import leaderboard

pytest.importorskip("plotly", reason="the report needs the extra 'report'")

PUBLISHED = Path(__file__).parents[2] / "results"

SUITE = """
name = "small"
description = "One short scenario"
scenarios = ["li2014_gradient"]
methods = ["slip_slope", "individual_wheel_torque"]
seeds = 2
targets = ["mu_front"]
"""


def published_tables():
    return sorted(PUBLISHED.glob("li2014/table_*.csv")) + sorted(PUBLISHED.glob("li2014/order.csv"))


def cells(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file))


@pytest.mark.slow
def test_a_suite_is_published_with_leaderboard_report_and_manifest(tmp_path):
    suite = tmp_path / "small.toml"
    suite.write_text(SUITE)
    results = tmp_path / "results"
    arguments = ["publish", "--suite", str(suite), "--no-papers", "--seeds", "2", "--workers", "1"]
    for computed in (4, 0):  # the second time nothing is run again
        done = CliRunner().invoke(application(), [*arguments, "--results", str(results)])
        assert done.exit_code == 0, done.output
        assert f"{computed} cells run, {4 - computed} stored already" in done.stderr
    board = leaderboard.read(results)
    assert {run.label for run in board.runs} == {"slip_slope", "individual_wheel_torque"}
    assert {run.target for run in board.runs} == {"mu_front"}
    manifest = json.loads((results / "manifest.json").read_text())
    assert manifest["seeds"] == {str(suite): 2}
    expected = load_suite(str(suite)).model_dump(mode="json")
    assert manifest["configuration"][str(suite)] == expected
    assert "mu_front with any sensors" in (results / "report.html").read_text()


def test_an_unknown_paper_is_refused_before_anything_runs(tmp_path):
    done = CliRunner().invoke(
        application(), ["publish", "--paper", "li2041", "--results", str(tmp_path)]
    )
    assert done.exit_code != 0
    assert "did you mean 'li2014'" in str(done.exception)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not published_tables(), reason="no tables of li2014 are published in results/")
def test_published_tables_are_what_the_code_gives(tmp_path):
    _, changed = publish_paper("li2014", tmp_path, figures=False)
    assert changed == []
    for path in published_tables():
        made, stored = cells(tmp_path / "li2014" / path.name), cells(path)
        assert made[0] == stored[0]
        for ours, theirs in zip(made[1:], stored[1:], strict=True):
            for new, old in zip(ours, theirs, strict=True):
                try:
                    assert float(new) == pytest.approx(float(old), rel=1e-3), path.name
                except ValueError:
                    assert new == old
