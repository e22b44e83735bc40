"""Response of an estimate of the friction to excitation, against its definition."""

import numpy as np
import pytest
import synthetic_rows
from hypothesis import given
from hypothesis import strategies as st

from gripbench.bench.ranking.summary import summary
from gripbench.bench.running.rows import FrictionResponse, frame_of
from gripbench.bench.scoring.friction_response import (
    BAND,
    EXCITED,
    HOLD,
    friction_response,
    is_available_friction,
)
from gripbench.bench.scoring.scoring import score
from gripbench.envs.recordings import Recording
from gripbench.envs.signals import record_type
from gripbench.envs.vehicles import GRAVITY

MU = 0.3
TIMES = 0.01 * np.arange(2001)
CORNERING = np.where(TIMES >= 5.0, 1.1 * EXCITED * MU * GRAVITY, 0.0)
NO_JUMP = np.nan


def respond(estimate, truth=None, accel_y=CORNERING, score_from=0.0, jump=NO_JUMP):
    truth = np.full(len(TIMES), MU) if truth is None else truth
    return friction_response(TIMES, estimate, truth, accel_y, score_from, jump)


def test_delay_counts_from_the_first_excitation():
    found = respond(np.where(TIMES < 7.5, 0.5, MU))
    assert found.delay == pytest.approx(2.5)
    assert (found.jumped, found.jump_delay) == (False, None)


@pytest.mark.parametrize(("factor", "settles"), [(1.01, False), (0.99, True)])
def test_settled_is_within_the_band(factor, settles):
    assert (respond(np.full(len(TIMES), MU * (1.0 + factor * BAND))).delay == 0.0) is settles


@pytest.mark.parametrize(("stay", "delay"), [(HOLD - 0.02, 5.0), (HOLD + 0.02, 1.0)])
def test_settled_is_for_a_second(stay, delay):
    end = 6.0 + stay
    early = (TIMES >= 6.0) & (end >= TIMES)
    assert respond(np.where(early | (TIMES >= 10.0), MU, 0.5)).delay == pytest.approx(delay)


def test_a_guess_that_is_right_by_chance_before_the_excitation_earns_nothing():
    found = respond(np.where(TIMES < 5.0, MU, 0.6))
    assert found.delay is None
    assert found.count == np.sum(TIMES >= 5.0)
    assert found.sum_of_squares == pytest.approx(found.count * 0.3**2)


def test_left_turns_excite_like_right_turns_and_nothing_counts_before_the_scores():
    early = np.where(TIMES < 1.0, 9.0, -CORNERING)
    assert respond(np.where(TIMES < 7.5, 0.5, MU), None, early, 3.0).delay == pytest.approx(2.5)


def test_without_excitation_there_is_no_response():
    assert respond(np.full(len(TIMES), MU), None, 0.9 / 1.1 * CORNERING) is None


def test_a_jump_has_a_delay_of_its_own_and_ends_the_first():
    truth = np.where(TIMES < 10.0, MU, 0.2)
    found = respond(np.where(TIMES < 11.5, MU, 0.2), truth, jump=10.0)
    assert (found.delay, found.jumped) == (0.0, True)
    assert found.jump_delay == pytest.approx(1.5)
    late = respond(np.full(len(TIMES), 0.2), truth, jump=10.0)
    assert late.delay is None
    assert late.jump_delay == 0.0
    assert respond(np.full(len(TIMES), MU), truth, jump=10.0).jump_delay is None


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
    found = respond(estimate).delay
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
    assert found["mu"].friction.delay == 0.0
    assert found["mu"].friction.jumped
    assert found["mu_used"].friction is None


def test_a_summary_counts_who_settles_and_averages_their_delays():
    responses = [
        FrictionResponse(sum_of_squares=4.0, count=100, delay=1.0, jumped=True, jump_delay=2.0),
        FrictionResponse(sum_of_squares=0.0, count=300, delay=2.0, jumped=True),
        FrictionResponse(sum_of_squares=1.0, count=100, delay=None),
    ]
    rows = [
        synthetic_rows.row(
            "a", seed, None, target="mu", score=synthetic_rows.score(1.0, friction=response)
        )
        for seed, response in enumerate([*responses, None])
    ]
    line = summary(frame_of(rows)).iloc[0]
    assert line["excited_rms"] == pytest.approx(0.1)
    assert (line["excited"], line["settled"], line["jumps"], line["jump_settled"]) == (3, 2, 2, 1)
    assert (line["delay"], line["jump_delay"]) == (1.5, 2.0)
    assert 1.0 <= line["delay_low"] <= 1.5 <= line["delay_high"] <= 2.0
