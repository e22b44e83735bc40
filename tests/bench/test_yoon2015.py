"""The reproduction of Yoon, Li & Ahn: its friction measures, and every claim on a single seed."""

import numpy as np
import pytest

from gripbench.bench.papers.claims import load_paper
from gripbench.bench.papers.yoon2015 import reproduction as yoon2015
from gripbench.bench.papers.yoon2015.reproduction import friction_error_and_delay
from gripbench.envs.vehicles import GRAVITY


def truth(excited_from=2.0, excited_until=8.0, mu=0.25):
    times = np.arange(0.0, 10.0, 0.01)
    run = np.zeros(len(times), [("time", float), ("mu", float), ("accel_y", float)])
    run["time"], run["mu"] = times, mu
    excited = (times >= excited_from) & (times <= excited_until)
    run["accel_y"] = np.where(excited, 0.8 * mu * GRAVITY, 0.0)
    return run


def test_friction_measures_of_a_known_response():
    """A first-order rise from twice the friction to 3 % above it."""
    run = truth()
    late = np.maximum(run["time"] - 2.0, 0.0)
    error, delay = friction_error_and_delay(run, 0.25 * (1.03 + 0.97 * np.exp(-late / 0.5)))
    assert error == pytest.approx(0.03, abs=0.001)
    assert delay == pytest.approx(0.5 * np.log(0.97 / 0.17), abs=0.011)


def test_friction_delay_needs_a_second_within_the_band():
    run = truth()
    mu = np.full(len(run), 0.25)
    mu[(run["time"] > 2.5) & (run["time"] < 3.0)] = 0.5  # leaves the band again after 0.5 s
    assert friction_error_and_delay(run, mu)[1] == pytest.approx(1.0, abs=0.011)
    assert friction_error_and_delay(run, np.full(len(run), 0.5))[1] == np.inf


def test_friction_measures_without_excitation_are_not_numbers():
    run = truth()
    run["accel_y"] = 0.0
    assert np.isnan(friction_error_and_delay(run, run["mu"])).all()


def test_every_item_has_its_figure_and_one_seed_shows_the_order():
    paper = load_paper("yoon2015")
    steps = []
    result = yoon2015.reproduce(lambda done, total: steps.append((done, total)), seeds=[4])
    assert steps[-1] == (10, 10)
    assert [claim.item for claim in result.claims] == [claim.item for claim in paper.claims]
    assert [figure.item for figure in result.figures] == [entry.item for entry in paper.figures]
    ours = {claim.item: claim.ours for claim in result.claims}
    ours |= {figure.item: figure.value for figure in result.figures}
    assert ours["track_sideslip"] < 1.3
    assert ours["track_sideslip"] < ours["track_no_delay_handling"]
    assert ours["track_sideslip"] < ours["track_no_bias_states"]
    assert ours["track_sideslip"] < ours["track_sideslip_as_printed"]
    assert ours["public_sideslip_pitch_aware"] < ours["public_sideslip_table_1"]
    assert ours["passing_with_rejection"] < ours["passing_no_rejection"]
    assert ours["single_delay_diverged"] == 1.0
    assert ours["separability"] < 1e-6
    assert ours["printed_12_angle"] > 45.0
    assert abs(ours["identified_mu"]) < 0.15
