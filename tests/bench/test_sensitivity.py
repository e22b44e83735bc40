"""One cause at a time: paired runs, breaking points, and what the command prints and refuses."""

import math

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.command_line import application
from gripbench.bench.ranking import sensitivity as study
from gripbench.envs.worlds import record

SHORT = find_scenario("constant_mu").model_copy(update={"horizon": 4.0})
TARGET = "mu_front"


@pytest.fixture(scope="module")
def frame():
    methods = [choose_method("slip_slope:magic_formula")]
    chosen = ("paper.wheel_radius", "paper.drag", "tyre.radius")
    ranges = study.ranges_of([SHORT], methods, chosen)
    return study.sensitivity([SHORT], methods, TARGET, ranges, workers=1)


def test_a_wrong_radius_on_paper_is_a_right_one_on_another_road(frame):
    """To first order only the ratio of the radii counts: +1 % on paper is -1 % on the road."""
    own = frame[frame["label"] == "slip_slope:magic_formula"].set_index(["cause", "deviation"])
    paper = own.loc[("paper.wheel_radius", 0.002), "rms"]
    nominal = own.loc[("paper.wheel_radius", 0.0), "rms"]
    assert paper > 3.0 * nominal
    assert own.loc[("tyre.radius", 0.0), "rms"] == nominal


def test_constants_do_not_feel_what_is_wrong_on_paper(frame):
    constant = frame[
        (frame["label"] == "constant_friction") & frame["cause"].eq("paper.wheel_radius")
    ]
    assert constant["rms"].nunique() == 1
    mu = record(SHORT, 0).truth[TARGET]
    assert constant["rms"].iloc[0] == pytest.approx(math.sqrt(np.mean((0.8 - mu) ** 2)))


def test_a_cause_without_effect_is_not_tried_further(frame):
    own = frame[(frame["label"] == "slip_slope:magic_formula") & frame["cause"].eq("paper.drag")]
    tried = own[own["rms"].notna()]["multiple"].tolist()
    assert tried == [-1.0, 0.0, 1.0]


def curve(method, baseline, deviations):
    """Return a frame of one method and one baseline, RMS as functions of the deviation."""
    lines = []
    for label, is_baseline, rms in (("m", False, method), ("b", True, baseline)):
        for multiple in (0.0, *study.MULTIPLES):
            size = deviations * multiple
            common = {"label": label, "baseline": is_baseline, "sensors": "", "cause": "c"}
            lines.append(
                {
                    **common,
                    "unit": "relative",
                    "multiple": multiple,
                    "deviation": size,
                    "rms": rms(size),
                }
            )
    return pd.DataFrame(lines).sort_values("multiple", kind="stable")


def test_the_breaking_point_is_where_the_curves_cross():
    table = study.summary_of(curve(lambda x: math.exp(10.0 * abs(x)), lambda x: math.e, 0.1), "m")
    line = table.iloc[0]
    assert line["breaking_high"] == pytest.approx(0.1)
    assert line["breaking_low"] == pytest.approx(-0.1)
    assert line["rms_high"] == pytest.approx(math.e)


def test_a_method_that_is_behind_already_breaks_at_nothing():
    table = study.summary_of(curve(lambda x: 2.0, lambda x: 1.0, 0.1), "m")
    assert table.iloc[0]["breaking_high"] == 0.0
    assert study.breaking_table(curve(lambda x: 2.0, lambda x: 1.0, 0.1)).loc["m", "c"] == 0.0


def test_one_that_is_never_overtaken_does_not_break():
    never = curve(lambda x: 1.0, lambda x: 2.0, 0.1)
    assert math.isnan(study.summary_of(never, "m").iloc[0]["breaking_high"])
    assert study.breaking_table(never).loc["m", "c"] == math.inf


def test_a_baseline_that_reads_more_is_no_rival():
    frame = curve(lambda x: 2.0, lambda x: 1.0, 0.1)
    frame.loc[frame["label"] == "b", "sensors"] = "speed_x"
    assert math.isnan(study.summary_of(frame, "m").iloc[0]["rms_baseline"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["slip_slope", "--cause", "tyre.radios"], "did you mean 'tyre.radius'"),
        (["slip_slope", "--target", "sideslip"], "does not estimate 'sideslip'"),
        (["slip_slope", "--scenario", "constant_my"], "constant_mu"),
        (["slip_slop"], "did you mean 'slip_slope'"),
        (["slip_slope", "--seeds", "0"], "at least one seed"),
    ],
)
def test_bad_input_is_refused_in_one_line(words, said):
    done = CliRunner().invoke(application(), ["sensitivity", *words])
    assert done.exit_code != 0
    assert said in f"{done.output} {done.exception}"
