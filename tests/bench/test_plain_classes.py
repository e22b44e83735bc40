"""Plain classes of every habit: whole recordings, slower outputs, typed parameters."""

import numpy as np
import pytest

import gripbench
from gripbench.bench.catalogue.check import check_estimator, failures
from gripbench.bench.catalogue.making import make
from gripbench.bench.publishing.board_tables import board_table
from gripbench.bench.ranking.ranking import boards
from gripbench.bench.running.isolation.prefixes import (
    LooksAheadError,
    check_beginning,
    run_over_prefixes,
)
from gripbench.bench.scoring.scoring import MISSING, missing_at_first
from gripbench.errors import InputError

FORMS = '''
import numpy as np
from scipy.signal import lfilter


class Base:
    sensors, estimates = ("accel_x",), ("mu_front",)


class OneByOne(Base):
    name = "one_by_one"

    def reset(self, vehicle, dt):
        self.value = 0.0

    def update(self, obs):
        self.value = 0.9 * self.value + 0.1 * abs(obs["accel_x"])
        return {"mu_front": self.value}


class Whole(Base):
    name = "whole"

    def run(self, vehicle, observations):
        return {"mu_front": lfilter([0.1], [1.0, -0.9], np.abs(observations["accel_x"]))}


class Ahead(Base):
    """Smooths to and fro: each estimate knows the samples behind it."""

    name = "ahead"

    def run(self, vehicle, observations):
        once = lfilter([0.1], [1.0, -0.9], np.abs(observations["accel_x"]))
        return {"mu_front": lfilter([0.1], [1.0, -0.9], once[::-1])[::-1]}


class OneSampleAhead(Base):
    name = "one_sample_ahead"

    def run(self, vehicle, observations):
        values = np.abs(observations["accel_x"])
        return {"mu_front": np.append(values[1:], values[-1])}


class KnowsTheLength(Base):
    """Is causal over all beginnings, and looks ahead where it is given all of the recording."""

    name = "knows_the_length"

    def run(self, vehicle, observations):
        values = np.abs(observations["accel_x"])
        mean = values.mean() if len(values) == 201 else 0.0
        return {"mu_front": values + mean}


class Short(Base):
    name = "short"

    def run(self, vehicle, observations):
        return {"mu_front": np.zeros(3)}


class Text(Base):
    name = "text"

    def run(self, vehicle, observations):
        return {"mu_front": ["0.5"] * len(observations)}


class Slow(OneByOne):
    """Gives one estimate in ten samples, the first at the tenth."""

    name = "slow"
    first = 9

    def reset(self, vehicle, dt):
        super().reset(vehicle, dt)
        self.sample = -1

    def update(self, obs):
        self.sample += 1
        value = super().update(obs)
        return value if self.sample % 10 == self.first else None


class SlowFromTheStart(Slow):
    name = "slow_from_the_start"
    first = 0


class HalfSlow(Slow):
    """One of its two estimates is slow."""

    name = "half_slow"
    estimates = ("mu_front", "mu_rear")

    def update(self, obs):
        return {"mu_rear": 0.5, "mu_front": (super().update(obs) or {}).get("mu_front")}


class Holds(OneByOne):
    """What `SlowFromTheStart` comes to."""

    name = "holds"

    def reset(self, vehicle, dt):
        super().reset(vehicle, dt)
        self.sample = -1

    def update(self, obs):
        self.sample += 1
        value = super().update(obs)
        if self.sample % 10 == 0:
            self.held = value
        return self.held


class Never(OneByOne):
    name = "never"

    def update(self, obs):
        super().update(obs)


class Late(OneByOne):
    name = "late"

    def update(self, obs):
        return super().update(obs) if obs["time"] > 1.5 else None


class NotANumberFirst(OneByOne):
    name = "not_a_number_first"

    def update(self, obs):
        value = super().update(obs)
        return {"mu_front": float("nan")} if obs["time"] < 0.01 else value
'''


@pytest.fixture(scope="module")
def forms(tmp_path_factory):
    path = tmp_path_factory.mktemp("forms") / "forms.py"
    path.write_text(FORMS)
    return path


def _run(forms, folder, *names, horizon=0.2):
    scenario = gripbench.load_scenario("constant_mu").model_copy(update={"horizon": horizon})
    rows = gripbench.run(
        scenarios=[scenario], methods=[f"{forms}:{name}" for name in names], results=folder,
        workers=1,
    )  # fmt: skip
    return rows[rows["target"] == "mu_front"].set_index("label")


@pytest.mark.slow
def test_whole_recordings_are_enough_and_looking_ahead_is_found(forms, tmp_path):
    names = ("OneByOne", "Whole", "Ahead", "OneSampleAhead", "KnowsTheLength", "Short", "Text")
    rows = _run(forms, tmp_path, *names)
    ok = rows[rows["status"] == "ok"]
    assert sorted(ok.index) == ["one_by_one", "whole"]
    assert rows.loc["whole", "rms"] == pytest.approx(rows.loc["one_by_one", "rms"], rel=1e-12)
    assert ok["over_prefixes"].to_dict() == {"one_by_one": False, "whole": True}
    assert rows.loc["whole", "step_batch"] > 0.0
    assert rows.loc["whole", "step_p50"] != rows.loc["whole", "step_p50"]  # no single calls
    for label in ("ahead", "one_sample_ahead", "knows_the_length"):
        assert rows.loc[label, "status"] == "failed"
        assert rows.loc[label, "reason"].startswith("not causal: its estimate 'mu_front' of sample")
    assert "has shape (3,); it should be (201,)" in rows.loc["short", "reason"]
    assert "'mu_front' is list of no real numbers" in rows.loc["text", "reason"]
    (board,) = boards(gripbench.read_rows(tmp_path), "mu_front", "any")
    names = {row["name"].split()[0] for row in board_table(board).rows}
    assert "whole¶" in names
    assert "one_by_one" in names
    assert "¶ takes whole recordings: causality checked at random cuts." in board_table(board).notes


@pytest.mark.slow
def test_none_holds_the_last_estimate(forms, tmp_path):
    names = ("Slow", "SlowFromTheStart", "Holds", "OneByOne", "HalfSlow", "Never")
    rows = _run(forms, tmp_path, *names, "NotANumberFirst")
    assert rows.loc["slow_from_the_start", "rms"] == rows.loc["holds", "rms"]
    assert rows.loc["slow", "rms"] != rows.loc["one_by_one", "rms"]
    assert rows.loc["half_slow", "rms"] == rows.loc["slow", "rms"]
    # what was not said does not count; what is said as NaN is no number
    assert rows.loc["one_by_one", "count"] - rows.loc["slow", "count"] == 9
    assert rows.loc["never", "status"] == "failed"
    assert rows.loc["never", "reason"].startswith("update never returned the estimate 'mu_front'")
    assert rows.loc["not_a_number_first", "status"] == "diverged"


def test_the_first_estimate_has_to_come_soon(forms, tmp_path):
    rows = _run(forms, tmp_path, "Late", horizon=2.0)
    assert rows.loc["late", "status"] == "failed"
    assert rows.loc["late", "reason"] == (
        "the first estimate of 'mu_front' comes at t = 1.501 s; give one, a guess, by t = 1 s"
    )


@pytest.mark.slow
def test_checks_of_one_that_takes_whole_recordings(forms):
    found = check_estimator(f"{forms}:Whole", ("constant_mu",))
    assert failures(found) == {}
    assert found["causal"] == "PASSED"
    assert found["copy_safe"] == "SKIPPED: it has no update: it takes whole recordings"
    found = failures(check_estimator(f"{forms}:OneSampleAhead", ("constant_mu",)))
    assert "estimates change when later samples are cut off" in found["causal"]


def test_missing_is_a_nan_of_its_own():
    values = np.array([MISSING, MISSING, np.nan, 1.0, MISSING])
    assert np.isnan(values).sum() == 4
    assert missing_at_first(values) == 2
    assert missing_at_first(np.full(3, MISSING)) == 3
    assert missing_at_first(np.array([float("nan")])) == 0


def test_looking_ahead_in_a_share_of_the_samples_passes_as_often_as_stated():
    """(1 - f)^CUTS of the cells, f the share of the samples behind which a cut is seen."""
    from gripbench.bench.running.isolation.prefixes import CUTS

    length, share, cells = 1000, 0.2, 2000
    samples = np.zeros(length, [("time", float)])
    spots = np.random.default_rng(0).random(length) < share

    def perform(form, vehicle, observations, period):
        found = np.zeros(len(observations), [("mu", float)])
        last = len(observations) - 1  # is wrong where it has not the sample behind it
        found["mu"][last] = 1.0 if spots[last] and len(observations) < length else 0.0
        return [found, found[:1]]

    passed = 0
    for _ in range(cells):
        try:
            run_over_prefixes(perform, {}, samples, 1e-3)
        except LooksAheadError:
            continue
        passed += 1
    expected = (1.0 - spots.mean()) ** CUTS
    assert abs(passed / cells - expected) < 4.0 * np.sqrt(expected * (1.0 - expected) / cells)


def test_rounding_is_not_looking_ahead():
    whole = np.zeros(4, [("mu", float)])
    whole["mu"] = (1.0, np.nan, np.inf, 3.0)
    part = whole[:3].copy()
    check_beginning(whole, part)
    part["mu"][0] += 1e-12
    part["mu"][2] = np.inf
    check_beginning(whole[[0, 1]], part[:2])
    part["mu"][0] += 1e-3
    with pytest.raises(LooksAheadError, match="of sample 0 changes when the samples from 2 on"):
        check_beginning(whole[[0, 1]], part[:2])


class Typed:
    def __init__(self, window=100, share=0.5, robust=False, form: "Form" = "short", free=None):
        self.given = (window, share, robust, form, free)


Form = __import__("typing").Literal["short", "long"]


class Listed:
    parameters = (
        gripbench.Parameter("window", 100, "-", "Samples", 1, 1000),
        gripbench.Parameter("form", "short", "-", "Form", choices=("short", "long")),
    )
    variants = {"fast": {"window": 10}}

    def __init__(self, share=0.5):
        self.share = share


@pytest.mark.parametrize(
    ("parameters", "given"),
    [
        ({}, (100, 0.5, False, "short", None)),
        ({"window": 7.0, "share": 1, "robust": 1}, (7, 1.0, True, "short", None)),
        ({"form": "long", "free": "anything"}, (100, 0.5, False, "long", "anything")),
    ],
)
def test_a_plain_class_gets_its_parameters_in_their_types(parameters, given):
    found = make(Typed, "", parameters, "typed").given
    assert found == given
    assert [*map(type, found)] == [*map(type, given)]


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"window": 2.5}, "parameter 'window' is 2.5; it is a whole number"),
        ({"window": "many"}, "parameter 'window' is 'many'; give a number"),
        ({"window": True}, "parameter 'window' is True; give a number"),
        ({"share": "half"}, "parameter 'share' is 'half'; give a number"),
        ({"robust": 0.5}, r"parameter 'robust' is 0.5; it is a switch"),
        ({"form": "tall"}, "parameter 'form' is 'tall'; allowed is one of short, long"),
        ({"windw": 3}, "it takes no parameter 'windw': did you mean 'window'"),
    ],
)
def test_a_value_of_another_type_is_refused(parameters, words):
    with pytest.raises(InputError, match=words):
        make(Typed, "", parameters, "typed")


def test_a_plain_class_may_list_parameters_as_a_compiled_one_does():
    method = make(Listed, "fast", {"form": "long", "share": 1}, "listed")
    assert (method.window, method.form, method.share) == (10, "long", 1.0)
    assert (make(Listed, "", {}, "listed").window) == 100
    with pytest.raises(InputError, match="parameter 'window' is 5000; allowed is 1 to 1000"):
        make(Listed, "", {"window": 5000}, "listed")
    with pytest.raises(InputError, match="allowed is one of short, long"):
        make(Listed, "", {"form": "tall"}, "listed")


TALKS = """
import os, sys

print("loading")

class Talks:
    name, sensors, estimates = "talks", ("accel_x",), ("mu_front",)

    def reset(self, vehicle, dt):
        print("reset", dt)
        print("\\x1b[31mred", file=sys.stderr)

    def update(self, obs):
        if obs["time"] > 0.1:
            print("so far")
            os._exit(3)
        return {"mu_front": 0.5}
"""


@pytest.mark.parametrize("forks", [True, False])
def test_what_a_method_prints_is_shown_on_request(tmp_path, capfd, monkeypatch, forks):
    from gripbench.bench.running.isolation import processes

    monkeypatch.setattr(processes, "FORKS", forks and processes.FORKS)
    path = tmp_path / "talks.py"
    path.write_text(TALKS)
    scenario = gripbench.load_scenario("constant_mu").model_copy(update={"horizon": 0.2})
    for show in (False, True):
        rows = gripbench.run(
            scenarios=[scenario], methods=[str(path)], results=tmp_path / f"r{show}", workers=1,
            show_output=show,
        )  # fmt: skip
        assert (rows["reason"] == "its process exited with code 3").all()
        shown = capfd.readouterr().err.splitlines()
        said = [line for line in shown if line.startswith("talks.py: ")]
        expected = ["loading", "reset 0.001", r"\x1b[31mred", "so far"] if show else []
        assert [line.removeprefix("talks.py: ") for line in said] == expected
