"""The lateral papers run again on a few of their test seeds: verdicts, and figures of our own."""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from gripbench.bench.papers.anderson2004 import reproduction as anderson2004
from gripbench.bench.papers.dakhlallah2008 import reproduction as dakhlallah2008
from gripbench.envs.worlds import load_scenario, record

BOUNDS = tomllib.loads((Path(__file__).parent / "own_figures.toml").read_text())


def within(value, low=-math.inf, high=math.inf, outside=False):
    return (low <= value <= high) != outside


@pytest.mark.slow
@pytest.mark.parametrize("module", [anderson2004, dakhlallah2008])
def test_every_claim_keeps_its_verdict_and_every_figure_its_bounds(module):
    calls = []
    result = module.reproduce(lambda done, total: calls.append((done, total)), seeds=[0, 1, 2])
    assert result.changed == []
    assert calls[-1][0] == calls[-1][1]
    values = {figure.item: figure.value for figure in result.figures}
    for item, bounds in BOUNDS[module.NAME].items():
        assert within(values[item], **bounds), (item, values[item], bounds)


def test_the_gyroscopes_scale_changes_nothing_else():
    scenario = load_scenario("two_turns").model_copy(update={"horizon": 20.0})
    clean = record(scenario, 1).observations
    scaled = record(anderson2004.with_gyro_scale(scenario), 1).observations
    for name in clean.dtype.names:
        assert np.array_equal(clean[name], scaled[name]) == (name != "yaw_rate")


def test_identified_stiffness_is_the_vehicles_own_in_the_linear_range():
    run = record(load_scenario("two_turns"), 1000)
    identified = anderson2004.identify([run])
    for axle in ("front", "rear"):
        name = f"cornering_stiffness_{axle}"
        assert identified[name] == pytest.approx(run.vehicle[name], rel=0.02)
