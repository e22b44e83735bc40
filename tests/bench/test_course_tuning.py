"""Tuning on training drives: one budget for all, drives that no test meets, a named variant."""

import tomllib

import numpy as np
import pytest
from typer.testing import CliRunner

import gripbench
from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.catalogue.training import TRAINING_SEEDS
from gripbench.bench.command_line import application
from gripbench.bench.running.course_tuning import tune_on
from gripbench.bench.running.store import Store
from gripbench.configuration import CONFIGS
from gripbench.envs.worlds import load_scenario, record
from gripbench.errors import InputError

LEVEL = """
class Level:
    name = "level"
    sensors = ("accel_x",)
    estimates = ("mu_front",)
    ranges = {"level": (0.0, 2.0)}

    def __init__(self, level=1.5, other=3):
        self.level = level

    def reset(self, vehicle, dt):
        pass

    def update(self, obs):
        return {"mu_front": self.level if self.level > 0.1 else float("nan")}
"""
DRIVES = 3


@pytest.fixture
def brief(tmp_path):
    """Path of a scenario of a fifth of a second with a population."""
    text = (CONFIGS / "scenarios" / "constant_mu.toml").read_text(encoding="utf-8")
    for old, new in (('"constant_mu"', '"brief"'), ("horizon = 30.0", "horizon = 0.2")):
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "brief.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def level(tmp_path):
    path = tmp_path / "level.py"
    path.write_text(LEVEL)
    return str(path)


def truths(brief):
    scenario = load_scenario(f"{brief}@1")
    first = TRAINING_SEEDS.start + len(TRAINING_SEEDS) // 2
    return [record(scenario, first + k).truth["mu_front"] for k in range(DRIVES)]


def call(*words):
    return CliRunner().invoke(application(), [str(word) for word in words])


@pytest.mark.parametrize(("plug_in", "budget", "width"), [(False, 60, 0.02), (True, 12, 0.15)])
def test_the_best_constant_is_the_mean_friction_of_the_drives(brief, level, plug_in, budget, width):
    method, name = (level, "level") if plug_in else ("constant_friction", "friction")
    found = tune_on(method, [str(brief)], "mu_front", budget=budget, each=DRIVES)
    truth = np.concatenate(truths(brief))
    constant = found.settings[name]
    assert constant == pytest.approx(truth.mean(), abs=width)
    assert found.after == pytest.approx(np.sqrt(np.mean((truth - constant) ** 2)), rel=1e-9)
    assert found.before > found.after
    first = TRAINING_SEEDS.start + len(TRAINING_SEEDS) // 2
    assert found.training.seeds == (first, first + DRIVES)
    assert (found.training.drives, found.training.budget, found.training.how) == (
        3,
        budget,
        "tuned",
    )


def test_the_variant_runs_under_its_name_with_its_record(brief, level, tmp_path):
    out = tmp_path / "tuned.toml"
    done = call(
        "tune", level, "--scenario", brief, "--target", "mu_front", "--budget", 6,
        "--drives", DRIVES, "--out", out,
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    assert "6 trials, mu_front on 3 drives of brief@1, seeds 1500000000:1500000003" in done.output
    said = tomllib.loads(out.read_text())
    assert said["name"] == "tuned_brief_mu_front"
    assert said["record"]["training"]["how"] == "tuned"
    assert said["record"]["after"] < said["record"]["before"]
    frame = gripbench.run(
        scenarios=[f"{brief}@1"], methods=[str(out), level], seeds=1, workers=1,
        results=tmp_path / "results",
    ).set_index("label")  # fmt: skip
    assert frame.loc["level@tuned_brief_mu_front", "training"] == "tuned: 3 drives of brief@1"
    assert not frame.loc["level", "training"]
    row = next(row for row in Store(tmp_path / "results").read_all() if "@" in row.label)
    assert row.parameters["level"] == said["settings"]["level"]
    with pytest.raises(InputError, match="is a trained method, and seed 1500000000"):
        gripbench.run(
            scenarios=[f"{brief}@1"], methods=[str(out)], seeds="1500000000:1500000001",
            results=tmp_path / "results",
        )  # fmt: skip


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("tune", "constant_friction"), "give METHOD with --suite or --scenario, or RECORDING"),
        (("tune", "constant_friction", "--suite", "lateral_populatio"), "unknown suite"),
        (("tune", "constant_frictio", "--scenario", "BRIEF"), "unknown method"),
        (
            ("tune", "constant_friction", "--target", "mu_front", "--scenario", "BRIEF@2"),
            "training drives are of level 1",
        ),
        (("tune", "constant_friction", "--scenario", "BRIEF"), "does not estimate 'sideslip'"),
        (("tune", "bicycle_on_paper@lowest_speed=2.0", "--scenario", "BRIEF"), "no parameter with"),
        (
            ("tune", "constant_friction", "--target", "mu_front", "--scenario", "recording:nobody"),
            "recording:nobody",
        ),
        (("tune", "a", "b", "--scenario", "BRIEF"), "give METHOD with --suite"),
    ],
)
def test_what_cannot_be_tuned_is_one_line(brief, tmp_path, words, message):
    words = [word.replace("BRIEF", str(brief)) for word in words]
    out = tmp_path / "tuned.toml"
    done = call(*words, "--out", out)
    assert message in str(done.exception)
    assert isinstance(done.exception, InputError)
    assert "\n" not in str(done.exception)
    assert not out.exists()


def test_a_range_that_is_none_is_one_line(tmp_path, level):
    for old, new in (("(0.0, 2.0)", "(0.0, 'x')"), ('"level": (0.0', '"levels": (0.0')):
        (tmp_path / "odd.py").write_text(LEVEL.replace(old, new))
        with pytest.raises(InputError, match="'ranges' must give 'level"):
            choose_method(str(tmp_path / "odd.py"))
