"""Orders of methods on recordings and in populations: Kendall's tau, its interval, turned pairs."""

import itertools

import numpy as np
import pytest
from scipy.stats import kendalltau
from synthetic_rows import noisy_rows
from typer.testing import CliRunner

from gripbench.bench.command_line import application
from gripbench.bench.ranking.agreement import agreements
from gripbench.bench.running.rows import frame_of
from gripbench.bench.running.store import Store
from gripbench.errors import InputError

RECORDING, POPULATION = "recording:mine", ("slalom_ice@1", "slalom_snow@1")


def rows_of(recorded, drawn, spread=0.05, windows=8):
    names = {"target": "sideslip"}
    here = {label: dict(names) for label in recorded}
    there = {label: dict(names) for label in drawn}
    return [
        *noisy_rows(recorded, windows, (RECORDING,), spread, **here),
        *noisy_rows(drawn, 10, POPULATION, spread, **there),
    ]


def only(rows):
    (found,) = agreements(frame_of(rows), ["sideslip"], resamples=300)
    return found


def test_the_same_order_is_one_and_the_other_way_round_minus_one():
    factors = {"a": 1.0, "b": 1.5, "c": 2.0, "d": 3.0}
    found = only(rows_of(factors, factors))
    assert (found.tau, found.low, found.high, found.turned) == (1.0, 1.0, 1.0, ())
    assert found.p == pytest.approx(1.0 / 24.0)  # one order of four methods
    turned = only(rows_of(factors, dict(zip(factors, (3.0, 2.0, 1.5, 1.0), strict=True))))
    assert turned.tau == -1.0
    assert set(turned.turned) == set(itertools.combinations("abcd", 2))


def test_tau_is_that_of_the_scores_and_noise_widens_its_interval():
    recorded = {"a": 1.0, "b": 1.5, "c": 2.0, "d": 3.0, "alone": 0.1}
    drawn = {"a": 1.0, "b": 2.0, "c": 1.5, "d": 3.0, "other": 0.1}
    found = only(rows_of(recorded, drawn))
    assert list(found.methods["label"]) == ["a", "b", "c", "d"]
    expected = kendalltau(found.methods["recording"], found.methods["population"]).statistic
    assert found.tau == pytest.approx(expected) == pytest.approx(2.0 / 3.0)
    assert found.turned == (("b", "c"),)
    noisy = only(rows_of(recorded, drawn, spread=0.5))
    assert noisy.high - noisy.low > found.high - found.low
    assert noisy.low <= noisy.tau <= noisy.high
    alone = only(rows_of(recorded, drawn, windows=1))  # one window: the order without its scatter
    assert np.isnan(alone.low)


def test_what_is_missing_is_said():
    factors = {"a": 1.0, "b": 1.5}
    assert agreements(frame_of(rows_of(factors, factors)), ["sideslip"]) == []
    for scenarios, said in (((RECORDING,), "lateral_population"), (POPULATION, "recordings")):
        with pytest.raises(InputError, match=said):
            agreements(frame_of(noisy_rows(factors, 2, scenarios)))


def test_the_command_prints_it(tmp_path):
    store = Store(tmp_path)
    factors = {"a": 1.0, "b": 1.5, "c": 2.0}
    for row in rows_of(factors, factors):
        store.write(row)
    words = ["agreement", "--target", "sideslip", "--results", str(tmp_path)]
    done = CliRunner().invoke(application(), words)
    assert done.exit_code == 0, done.output
    assert "1.00 to 1.00" in done.output
    assert "sideslip: mine beside lateral_population" in done.output
