"""Methods that know their errors, that do not, and that say nothing: verdicts, boards, commands."""

import math
from typing import ClassVar
from xml.etree import ElementTree

import numpy as np
import pytest
from typer.testing import CliRunner

import gripbench
from gripbench.bench.catalogue.check import check_estimator
from gripbench.bench.catalogue.declarations import declaration_from
from gripbench.bench.command_line import application
from gripbench.bench.publishing.leaderboard import build, read, uncertainty_boards, write
from gripbench.bench.publishing.report.reliability import reliability_diagram
from gripbench.bench.ranking.consistency import consistency
from gripbench.bench.ranking.ranking import boards
from gripbench.bench.scoring.consistency import CONSISTENT, SILENT
from gripbench.errors import InputError
from gripbench.methods.contract import CompiledMethod, compiled

SEEDS = 10


@pytest.fixture(scope="module")
def drives(tmp_path_factory, plugins):
    """Stored rows of plug-ins over a quarter of a second of many cars."""
    folder = tmp_path_factory.mktemp("drives")
    text = (gripbench.configuration.CONFIGS / "scenarios" / "constant_mu.toml").read_text("utf-8")
    text = text.replace('name = "constant_mu"', 'name = "short"', 1)
    path = folder / "short.toml"
    path.write_text(text.replace("horizon = 30.0", "horizon = 0.25", 1), encoding="utf-8")
    file = plugins / "priors.py"
    names = [
        f"{file}:Prior", f"{file}:Prior:overconfident", f"{file}:Prior:cautious",
        *(f"{file}:{name}" for name in ("InQuantiles", "Crossing", "Negative", "Certain",
                                        "Silent", "Watched")),
    ]  # fmt: skip
    gripbench.run(
        scenarios=[f"{path}@1"], methods=["constant_friction:prior", *names], seeds=SEEDS,
        results=folder / "results", workers=1,
    )  # fmt: skip
    return folder / "results"


@pytest.fixture(scope="module")
def rows(drives):
    return gripbench.read_rows(drives)


def lines_of(rows):
    return consistency(rows, ["mu_front"]).set_index("label")


def test_the_verdict_says_who_is_over_and_who_is_underconfident_and_by_how_much(rows):
    lines = lines_of(rows)
    assert lines.loc["prior", "verdict"] == CONSISTENT
    assert lines.loc["prior:overconfident", "verdict"].startswith("overconfident by a factor")
    assert lines.loc["prior:cautious", "verdict"].startswith("cautious by a factor")
    honest = lines.loc["prior", "factor"]
    assert lines.loc["prior:overconfident", "factor"] == pytest.approx(5.0 * honest)
    assert lines.loc["prior:cautious", "factor"] == pytest.approx(0.2 * honest)
    for label, factor in (("prior:overconfident", 5.0), ("prior:cautious", 0.2)):
        low, high = lines.loc[label, ["factor_from", "factor_to"]]
        assert low < factor < high


def test_quantiles_and_a_variance_that_say_the_same_are_judged_the_same(rows):
    lines = lines_of(rows)
    for name in ("verdict", "runs"):
        assert lines.loc["in_quantiles", name] == lines.loc["prior", name]
    for name in ("nees", "coverage_50", "coverage_90", "sharpness"):
        assert lines.loc["in_quantiles", name] == pytest.approx(lines.loc["prior", name], rel=1e-3)
    assert lines.loc["in_quantiles", "crps"] == pytest.approx(lines.loc["prior", "crps"], rel=0.1)
    assert math.isnan(lines.loc["in_quantiles", "coverage_95"])


def test_who_says_nothing_does_not_pass(rows):
    lines = lines_of(rows)
    for label in ("silent", "certain"):
        assert lines.loc[label, "verdict"] == SILENT
        assert lines.loc[label, ["factor", "nees", "crps", "coverage_90", "nis"]].isna().all()
    for label in ("crossing", "negative"):
        assert lines.loc[label, "verdict"] == "n/a"


def test_cells_that_state_what_cannot_be_are_marked_with_the_reason(rows):
    for label, message in (
        ("crossing", "mu_front_q75 is above mu_front_q95 at t = 0.10"),
        ("negative", "mu_front_variance is -0.00"),
    ):
        part = rows[rows["label"] == label]
        assert set(part["status"]) == {"failed"}
        assert part["reason"].str.startswith(message).all()


def test_innovations_are_tested_against_their_own_variance(rows):
    lines = lines_of(rows)
    line = lines.loc["watched"]
    assert line["nis_verdict"].startswith("overconfident")
    assert line["innovation_correlation"] > 0.5
    assert line["white_innovations"] < 0.3
    assert lines.drop(index="watched")["nis"].isna().all()


def test_a_board_of_uncertainty_ranks_by_crps_against_the_prior(rows):
    (board,) = boards(rows, "mu_front", "any", by="crps")
    lines = board.lines.set_index("label")
    assert board.guess == "constant_friction:prior"
    assert lines.loc["prior", "skill"] == pytest.approx(0.0, abs=1e-9)
    assert lines.loc["prior:overconfident", "skill"] < 0.0
    assert lines.loc["prior:cautious", "skill"] < 0.0
    ranked = lines["score"].notna()
    assert set(lines.index[~ranked]) == {"silent", "certain", "crossing", "negative"}
    assert lines["rank"][~ranked].min() > lines["rank"][ranked].max()
    assert board.runs["prior"].mean() == pytest.approx(lines.loc["prior", "crps"])
    ratio = lines.loc["prior:cautious", "crps"] / lines.loc["prior", "crps"]
    assert lines.loc["prior:cautious", "score"] / lines.loc["prior", "score"] == pytest.approx(
        ratio, rel=1e-6
    )
    by_rms = gripbench.rank(rows, "mu_front", "any").set_index("label")
    assert by_rms.loc["silent", "rank"] == by_rms.loc["prior", "rank"]
    assert by_rms.loc["silent", "uncertainty"] == SILENT


def test_the_leaderboard_keeps_the_boards_of_uncertainty_apart(rows, tmp_path):
    made, found = build(rows)
    write(tmp_path, made, found)
    again = read(tmp_path)
    assert {board["title"] for board in again.uncertainty} == {
        "Uncertainty of mu_front with any sensors (level 1)"
    }
    assert not any("Uncertainty" in board["title"] for board in again.boards)
    text = (tmp_path / "leaderboard.md").read_text()
    assert "overconfident by a factor" in text
    assert "Without a word on their errors" in text


def test_the_report_draws_stated_against_observed_shares(rows):
    (board,) = uncertainty_boards(rows)
    drawing = ElementTree.fromstring(reliability_diagram(board))
    curves = {line[0].text: line.attrib["points"] for line in drawing.iter("polyline")}
    assert set(curves) == {
        "constant_friction:prior", "prior", "prior:overconfident", "prior:cautious",
        "in_quantiles", "watched",
    }  # fmt: skip
    points = [[float(x) for x in pair.split(",")] for pair in curves["prior"].split()]
    (left, bottom), side = points[0], 280.0
    line = board.lines.set_index("label").loc["prior"]
    for (x, y), level in zip(points[1:], (50, 90, 95), strict=True):
        assert (x - left) / side == pytest.approx(level / 100.0, abs=1e-3)
        assert (bottom - y) / side == pytest.approx(line[f"coverage_{level}"], abs=1e-3)
    assert uncertainty_boards(rows[rows["label"] == "silent"]) == []


def command(*arguments):
    return CliRunner().invoke(application(), [str(word) for word in arguments])


def test_the_commands_print_verdicts_and_boards(drives):
    shown = command("consistency", "--results", drives, "--target", "mu_front").output
    assert "overconfident by a factor" in shown
    assert "says nothing" in shown
    each = command("consistency", "--results", drives, "--by-scenario", "--format", "csv").output
    assert "short@1" in each
    shown = command("rank", "--results", drives, "--by", "crps", "--sensors", "any").output
    assert "Uncertainty of mu_front" in shown
    assert "n/a" in shown
    assert "n/a" not in command("rank", "--results", drives).output


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("rank", "--by", "crsp"), "measure to rank by 'crsp'"),
        (("consistency", "--target", "mu_frnt"), "target 'mu_frnt'"),
        (("consistency", "--method", "nobody"), "method 'nobody'"),
        (("consistency", "--scenario", "nowhere"), "scenario 'nowhere'"),
        (("consistency", "--confidence", "1.5"), "confidence is 1.5"),
        (("consistency", "--format", "yaml"), "table format 'yaml'"),
    ],
)
def test_wrong_options_are_one_line(drives, arguments, message):
    failed = command(*arguments, "--results", drives)
    assert isinstance(failed.exception, InputError)
    assert message in str(failed.exception)
    assert "\n" not in str(failed.exception)


GIVEN = {
    "name": "own", "sensors": ("accel_x",), "estimates": ("mu", "mu_front"), "settings": {},
    "variant": "",
}  # fmt: skip


@pytest.mark.parametrize(
    ("quantiles", "message"),
    [
        ({"mu": (0.0, 0.5)}, "holds the level 0.0; it must lie between 0 and 1"),
        ({"mu": (0.5, 1.0)}, "holds the level 1.0; it must lie between 0 and 1"),
        ({"mu": (-0.1,)}, "holds the level -0.1"),
        ({"mu": (math.nan,)}, "holds the level nan"),
        ({"mu": ("0.5",)}, "holds the level '0.5'"),
        ({"mu": (True,)}, "holds the level True"),
        ({"mu": (0.5, 0.5)}, "the levels must rise"),
        ({"mu": (0.9, 0.1)}, "the levels must rise"),
        ({"mu": (1.0 / 3.0,)}, "at most 6 digits"),
        ({"mu": ()}, "give levels such as"),
        ({"mu": 0.5}, "give levels such as"),
        ({"sideslip": (0.5,)}, "names 'sideslip', which it does not estimate"),
        ({"mu_front": (0.5,)}, "has a variance: state one of the two"),
        (((0.5,),), "set it to a table of levels"),
    ],
)
def test_quantiles_that_cannot_be_are_refused_in_one_line(quantiles, message):
    with pytest.raises(InputError) as caught:
        declaration_from({**GIVEN, "variances": ("mu_front",), "quantiles": quantiles})
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)

    def made():
        attributes = {**GIVEN, "variances": ("mu_front",), "quantiles": quantiles}
        return type("Own", (CompiledMethod,), {**attributes, "state": np.dtype([("x", float)]),
                                               "step": None})()  # fmt: skip

    with pytest.raises(InputError) as caught:
        made()
    assert message in str(caught.value)


def test_an_innovation_of_no_signal_is_refused():
    with pytest.raises(InputError, match="'innovations' names the unknown signal 'acel_x'"):
        declaration_from({**GIVEN, "innovations": ("acel_x",)})


@compiled
def _say(state, obs, params, est):
    state.count += 1.0
    est.mu_front = 0.5
    est.mu_front_q05 = 0.5 - 0.1 * state.count
    est.mu_front_q95 = 0.5 + 0.1 * state.count
    est.accel_x_innovation = obs.accel_x
    est.accel_x_innovation_variance = 2.0


class Compiled(CompiledMethod):
    name = "compiled"
    title = "Quantiles and innovations of a compiled step"
    reference = "-"
    sensors = ("accel_x",)
    estimates = ("mu_front",)
    quantiles: ClassVar = {"mu_front": (0.05, 0.95)}
    innovations = ("accel_x",)
    state = np.dtype([("count", float)])
    step = staticmethod(_say)


def test_a_compiled_step_writes_quantiles_and_innovations_online_and_in_one_loop():
    samples = np.array([(0.5, 0.0), (0.7, 0.01)], [("accel_x", float), ("time", float)])
    batch = Compiled().run({}, samples)
    online = Compiled()
    online.reset({}, 0.01)
    for sample, expected in zip(samples, batch, strict=True):
        assert online.update({name: sample[name] for name in samples.dtype.names}) == {
            name: expected[name] for name in batch.dtype.names
        }
    assert batch.dtype.names == (
        "mu_front", "mu_front_q05", "mu_front_q95", "accel_x_innovation",
        "accel_x_innovation_variance",
    )  # fmt: skip
    assert batch[1].item() == pytest.approx((0.5, 0.3, 0.7, 0.7, 2.0))


class Crossed(Compiled):
    name = "crossed"
    quantiles: ClassVar = {"mu_front": (0.05, 0.95)}

    def reset(self, vehicle, dt):
        pass

    def run(self, vehicle, observations):
        made = np.zeros(len(observations), self.record_types.est)
        made["mu_front_q05"] = 1.0
        return made


def test_a_check_finds_quantiles_that_cross(short_scenario):
    found = check_estimator(Crossed, [short_scenario], checks=["quantiles_in_order"])
    assert "mu_front_q05 is above mu_front_q95 at t = 0 s" in found["quantiles_in_order"]
    found = check_estimator(Compiled, [short_scenario], checks=["quantiles_in_order"])
    assert found["quantiles_in_order"] == "PASSED"
    found = check_estimator("slip_slope", [short_scenario], checks=["quantiles_in_order"])
    assert found["quantiles_in_order"] == "SKIPPED: it declares no quantiles"
