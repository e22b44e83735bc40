"""Response of an estimate of the friction to excitation, against its definition."""

import numpy as np
import pytest
import synthetic_rows
from hypothesis import given
from hypothesis import strategies as st

from gripbench.bench.ranking.summary import summary
from gripbench.bench.running.rows import frame_of
from gripbench.bench.scoring.metric import Context
from gripbench.bench.scoring.metrics import metrics
from gripbench.bench.scoring.metrics.excitation import BAND, EXCITED, HOLD, is_available_friction
from gripbench.bench.scoring.scoring import score
from gripbench.envs.recordings import Recording
from gripbench.envs.signals import record_type
from gripbench.envs.vehicles import GRAVITY

MU = 0.3
TIMES = 0.01 * np.arange(2001)
CORNERING = np.where(TIMES >= 5.0, 1.1 * EXCITED * MU * GRAVITY, 0.0)
NO_JUMP = np.nan


def respond(estimate, truth=None, accel_y=CORNERING, score_from=0.0, jump=NO_JUMP):
    """Values of the metrics of excitation by name, without those that say nothing."""
    truth = np.full(len(TIMES), MU) if truth is None else truth
    kept = score_from <= TIMES
    channels = {"accel_y": accel_y[kept]}
    context = Context("mu", score_from, {"mu_jump_time": jump}, None, channels.get)
    found = {
        name: metrics()[name].of_run(TIMES[kept], estimate[kept], truth[kept], context)
        for name in ("excited_rms", "friction_delay", "jump_delay")
    }
    return {name: value for name, value in found.items() if value is not None}


def test_delay_counts_from_the_first_excitation():
    found = respond(np.where(TIMES < 7.5, 0.5, MU))
    assert found["friction_delay"].value == pytest.approx(2.5)
    assert "jump_delay" not in found


@pytest.mark.parametrize(("factor", "settles"), [(1.01, False), (0.99, True)])
def test_settled_is_within_the_band(factor, settles):
    found = respond(np.full(len(TIMES), MU * (1.0 + factor * BAND)))
    assert (found["friction_delay"].value == 0.0) is settles


@pytest.mark.parametrize(("stay", "delay"), [(HOLD - 0.02, 5.0), (HOLD + 0.02, 1.0)])
def test_settled_is_for_a_second(stay, delay):
    end = 6.0 + stay
    early = (TIMES >= 6.0) & (end >= TIMES)
    found = respond(np.where(early | (TIMES >= 10.0), MU, 0.5))
    assert found["friction_delay"].value == pytest.approx(delay)


def test_a_guess_that_is_right_by_chance_before_the_excitation_earns_nothing():
    found = respond(np.where(TIMES < 5.0, MU, 0.6))
    assert found["friction_delay"].value is None
    assert found["excited_rms"].count == np.sum(TIMES >= 5.0)
    assert found["excited_rms"].value == pytest.approx(0.3)


def test_left_turns_excite_like_right_turns_and_nothing_counts_before_the_scores():
    early = np.where(TIMES < 1.0, 9.0, -CORNERING)
    found = respond(np.where(TIMES < 7.5, 0.5, MU), None, early, 3.0)
    assert found["friction_delay"].value == pytest.approx(2.5)


def test_without_excitation_there_is_no_response():
    assert respond(np.full(len(TIMES), MU), None, 0.9 / 1.1 * CORNERING) == {}


def test_a_jump_has_a_delay_of_its_own_and_ends_the_first():
    truth = np.where(TIMES < 10.0, MU, 0.2)
    found = respond(np.where(TIMES < 11.5, MU, 0.2), truth, jump=10.0)
    assert found["friction_delay"].value == 0.0
    assert found["jump_delay"].value == pytest.approx(1.5)
    late = respond(np.full(len(TIMES), 0.2), truth, jump=10.0)
    assert late["friction_delay"].value is None
    assert late["jump_delay"].value == 0.0
    assert respond(np.full(len(TIMES), MU), truth, jump=10.0)["jump_delay"].value is None


@given(st.integers(0, 10**6), st.floats(0.02, 0.5))
def test_agrees_with_its_definition(seed, length):
    """First sample after which a whole second lies within the band, found by brute force."""
    generator = np.random.default_rng(seed)
    parts = generator.choice([1.0, 1.0, 1.0, 1.3], int(20.0 / length) + 1)
    estimate = MU * parts[np.minimum((TIMES / length).astype(int), len(parts) - 1)]
    within = np.abs(estimate - MU) <= BAND * MU
    starts = range(500, len(TIMES) - round(HOLD / 0.01))
    stays = (k for k in starts if within[k : k + round(HOLD / 0.01) + 1].all())
    expected = next(stays, None)
    found = respond(estimate)["friction_delay"].value
    if expected is None:
        assert found is None
    else:
        assert found == pytest.approx(TIMES[expected] - 5.0)


def test_only_the_available_friction_responds():
    assert is_available_friction("mu")
    assert is_available_friction("mu_front")
    assert not is_available_friction("mu_used")
    assert not is_available_friction("mu_used_rear_left")
    names = ("mu", "mu_used")
    truth = np.zeros(len(TIMES), record_type(("time", "accel_y", *names)))
    truth["time"], truth["accel_y"] = TIMES, CORNERING
    truth["mu"], truth["mu_used"] = MU, 0.1
    estimates = np.zeros(len(TIMES), record_type(names))
    estimates["mu"], estimates["mu_used"] = MU, 0.1
    recording = Recording("s", 0, {}, truth, truth, notes={"mu_jump_time": 8.0})
    found = score(estimates, names, names, recording)
    assert found["mu"]["friction_delay"].value == 0.0
    assert "jump_delay" in found["mu"]
    assert not {"friction_delay", "jump_delay", "excited_rms"} & set(found["mu_used"])


def test_a_summary_counts_who_settles_and_averages_their_delays():
    responses = [
        synthetic_rows.response(4.0, 100, 1.0, jump_delay=2.0),
        synthetic_rows.response(0.0, 300, 2.0, jump_delay=None),
        synthetic_rows.response(1.0, 100),
    ]
    rows = [
        synthetic_rows.row(
            "a", seed, None, target="mu", score=synthetic_rows.score(1.0, **response)
        )
        for seed, response in enumerate([*responses, {}])
    ]
    line = summary(frame_of(rows)).iloc[0]
    assert line["excited_rms"] == pytest.approx(0.1)
    assert (line["excited"], line["settled"], line["jumps"], line["jump_settled"]) == (3, 2, 2, 1)
    assert (line["delay"], line["jump_delay"]) == (1.5, 2.0)
    assert 1.0 <= line["delay_low"] <= 1.5 <= line["delay_high"] <= 2.0
