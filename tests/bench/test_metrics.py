"""Metrics are plug-ins: one from outside is scored, stored, ranked and shown."""

import importlib.metadata
import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest

from gripbench.bench.scoring import metrics as registry
from gripbench.bench.scoring.metric import Context, Metric, MetricError, Value

CONTEXT = Context("mu_front", 0.0, {}, None, {}.get)
SAMPLES = np.arange(4.0)

PLUGIN = """
import numpy as np
from gripbench.bench.scoring.metric import Metric

def late(time, estimate, truth, context):
    error = (estimate - truth)[time >= time[-1] - 1.0]
    return float(np.sum(error**2)), len(error)

METRICS = (Metric("rms_at_the_end", "RMS at the end", "Of the last second", late, "root_mean"),)
"""

CLIENT = """
import json, sys, gripbench
rows = gripbench.run(
    scenarios=["friction_step"], methods=["slip_slope"], seeds=2, results=sys.argv[1], workers=1
)
board = gripbench.rank(gripbench.read_rows(sys.argv[1]), target="mu_front")
rows = rows[rows["target"] == "mu_front"]
print(json.dumps([rows["rms_at_the_end"].tolist(), board["rms_at_the_end"].tolist(),
                  rows["key"].tolist()]))
"""


@pytest.fixture
def outside(tmp_path):
    """A folder on the path with an installed package that adds a metric."""
    site = tmp_path / "site"
    info = site / "late_error-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: late-error\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[gripbench.metrics]\nlate = late_error:METRICS\n")
    (site / "late_error.py").write_text(PLUGIN)
    return site


@pytest.mark.slow
def test_a_metric_from_outside_is_scored_stored_ranked_and_shown(outside, tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(outside)}

    def python(*arguments):
        done = subprocess.run(
            [sys.executable, *arguments], env=environment, capture_output=True, text=True,
            cwd=tmp_path, timeout=300, check=True,
        )  # fmt: skip
        return done.stdout

    results = str(tmp_path / "results")
    runs, pooled, keys = json.loads(python("-c", CLIENT, results))
    assert len(runs) == len(set(keys)) == 2
    assert all(value > 0.0 for value in runs)
    assert pooled == [pytest.approx(math.sqrt(np.mean(np.square(runs))))]
    stored = next((tmp_path / "results/rows/friction_step/slip_slope").glob("0.json"))
    values = json.loads(stored.read_text())["row"]["scores"]["mu_front"]
    assert values["rms_at_the_end"]["value"] == runs[0]
    shown = python(
        "-m", "gripbench.bench.command_line", "rank", "--results", results, "--wide",
        "--format", "csv",
    )  # fmt: skip
    assert "RMS at the end" in shown
    (outside / "late_error.py").write_text(PLUGIN.replace("1.0 ", "2.0 ").replace("- 1.0", "- 2.0"))
    assert not set(json.loads(python("-c", CLIENT, results))[2]) & set(keys)


def of(compute, pooling="mean"):
    return Metric("own", "Own", "", compute, pooling).of_run(SAMPLES, SAMPLES, SAMPLES, CONTEXT)


@pytest.mark.parametrize(
    ("compute", "pooling", "value"),
    [
        (lambda *_: (6.0, 3), "mean", Value(value=2.0, total=6.0, count=3)),
        (lambda *_: (12.0, 3), "root_mean", Value(value=2.0, total=12.0, count=3)),
        (lambda *_: (0.0, 0), "root_mean", None),
        (lambda *_: None, "mean", None),
        (lambda *_: np.float64(3.0), "maximum", Value(value=3.0)),
        (lambda *_: math.inf, "median", Value(value=None)),
    ],
)
def test_what_a_metric_gives_becomes_a_value(compute, pooling, value):
    assert of(compute, pooling) == value


@pytest.mark.parametrize(
    ("compute", "pooling", "message"),
    [
        (lambda *_: 1 / 0, "mean", "metric 'own' of mu_front: ZeroDivisionError"),
        (lambda *_: 1.0, "mean", r"is 1.0, not a pair \(total, count\)"),
        (lambda *_: "x", "maximum", "is 'x', not a number"),
        (lambda *_: (math.nan, 3), "mean", "is nan"),
        (lambda *_: math.inf, "maximum", "is inf"),
    ],
)
def test_a_metric_that_fails_is_named(compute, pooling, message):
    with pytest.raises(MetricError, match=message):
        of(compute, pooling)


def test_runs_are_pooled_by_totals_and_not_by_their_values():
    metric = registry.metrics()["rms"]
    assert metric.pooled([1.0, 3.0], [10.0, 270.0], [10, 30]) == math.sqrt(280.0 / 40.0)
    assert math.isnan(metric.pooled([math.nan], [math.nan], [math.nan]))
    assert registry.metrics()["peak"].pooled([1.0, math.nan, 3.0]) == 3.0
    assert registry.metrics()["convergence_time"].pooled([1.0, math.inf, 2.0]) == 2.0


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("nowhere:METRICS", "ModuleNotFoundError"),
        ("math:pi", "3.14.* is no gripbench metric"),
        ("gripbench.bench.scoring.metrics.accuracy:METRICS", "has the column 'rms' of metric"),
    ],
)
def test_an_entry_point_that_is_no_metric_is_one_line(monkeypatch, entry, message):
    point = importlib.metadata.EntryPoint("own", entry, registry.GROUP)
    monkeypatch.setattr(registry, "entry_points", lambda group: {"own": point})
    registry.metrics.cache_clear()
    try:
        with pytest.raises(registry.InputError, match=message) as caught:
            registry.metrics()
        assert "\n" not in str(caught.value)
    finally:
        registry.metrics.cache_clear()


@pytest.mark.parametrize("name", ["", "two words", "Upper", "a-b"])
def test_a_name_of_a_metric_is_plain(name):
    with pytest.raises(registry.InputError, match="lower case"):
        Metric(name, "", "", lambda *_: None)
