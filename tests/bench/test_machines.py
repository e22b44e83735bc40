"""The same cell on processors with other instructions: equal to a tolerance, not to the byte."""

import json
import os
import subprocess
import sys

import pytest

PROGRAM = """
import json, sys
import gripbench
rows = gripbench.run(
    scenarios=json.loads(sys.argv[1]), methods=json.loads(sys.argv[2]), seeds=2, workers=1,
    results=sys.argv[3],
)
names = ["scenario", "label", "target", "seed", "rms", "bias"]
print(rows[rows["status"] == "ok"][names].to_json(orient="split"))
"""
TOLERANCE = 1e-6
"""Relative difference of scores between processors: what docs/reliability.md promises."""


def scores(tmp_path, scenarios, methods, **environment):
    told = [json.dumps(scenarios), json.dumps(methods), str(tmp_path / "-".join(environment))]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *told],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "numba"), **environment},
        capture_output=True, check=True, text=True,
    )  # fmt: skip
    return json.loads(done.stdout)["data"]


@pytest.mark.slow
def test_scores_of_two_processors_agree(tmp_path):
    scenarios = ["friction_step", "double_lane_change_snow"]
    methods = ["slip_slope", "individual_wheel_torque", "kinematic_kalman_filter", "dugoff_ekf"]
    here = scores(tmp_path, scenarios, methods, GRIPBENCH_TEST="here")
    plain = scores(tmp_path, scenarios, methods, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="")
    assert [row[:4] for row in here] == [row[:4] for row in plain]
    worst = max(
        abs(a - b) / max(abs(a), 1e-9)
        for one, other in zip(here, plain, strict=True)
        for a, b in zip(one[4:5], other[4:5], strict=True)
    )
    print(f"{len(here)} rows, largest relative difference of an RMS: {worst:.1e}")
    assert len(here) >= 8
    assert worst < TOLERANCE
