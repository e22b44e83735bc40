import math

import numpy as np
import pytest
from synthetic_rows import noisy_rows, row

from gripbench.bench.publishing.leaderboard import Leaderboard, runs_of
from gripbench.bench.publishing.regressions import changes_table, compare
from gripbench.bench.publishing.timings import RelativeRuntime
from gripbench.bench.running.rows import frame_of
from gripbench.errors import InputError


def board(rows, timings=None):
    """What a comparison looks at; the boards themselves are not needed for it."""
    return Leaderboard(
        gripbench="0",
        confidence=0.95,
        boards=(),
        runtimes=timings or {},
        runs=runs_of(frame_of(rows)),
    )


def scaled(rows, label, factor, noise=0.0, scenario=None, seed=5):
    """The rows of one method with its RMS times a factor, and noise that is new to each run."""
    rng = np.random.default_rng(seed)
    changed = []
    for item in rows:
        draw = factor * math.exp(noise * rng.standard_normal())
        if item.label == label and scenario in (None, item.scenario):
            rms = item.scores["mu_front"]["rms"].value * draw
            item = row(item.label, item.seed, rms, item.scenario)
        changed.append(item)
    return changed


@pytest.fixture
def rows():
    return noisy_rows({"a": 1.0, "b": 2.0, "c": 3.0}, seeds=20)


def test_nothing_changed_is_no_change(rows):
    assert compare(board(rows), board(rows)) == []
    assert changes_table([]).caption == "No change."


def test_worsened_method_is_named_with_size_and_confidence(rows):
    changes = compare(board(rows), board(scaled(rows, "b", 1.05, noise=0.01, scenario="hill")))
    assert [(c.verdict, c.label, c.scenario) for c in changes] == [("worse", "b", "hill")]
    assert changes[0].ratio == pytest.approx(1.05, rel=0.01)
    assert changes[0].confidence > 0.99
    assert "over 20 common seeds" in changes[0].detail
    table = changes_table(changes)
    assert table.caption.startswith("Regressions: 1;")
    assert table.text(0, table.columns[5]) == "> 99.99 %"


def test_improved_method_is_no_regression(rows):
    changes = compare(board(rows), board(scaled(rows, "b", 0.9)))
    assert [(c.verdict, c.regression) for c in changes] == [("better", False)] * 2


def test_rounding_below_the_margin_is_no_change(rows):
    assert compare(board(rows), board(scaled(rows, "b", 1.0 + 5e-4))) == []
    assert len(compare(board(rows), board(scaled(rows, "b", 1.0 + 5e-4)), margin=1e-4)) == 2


@pytest.mark.slow
def test_noise_alone_hardly_ever_fails(rows):
    """Runs that all changed by chance: the chance of any regression is that which was stated."""
    base, alarms, trials = board(rows), 0, 60
    for trial in range(trials):
        noisy = rows
        for label in "abc":
            noisy = scaled(noisy, label, 1.0, noise=0.05, seed=[trial, ord(label)])
        alarms += any(change.regression for change in compare(base, board(noisy)))
    assert alarms <= 8  # 3 expected at 5 %; 9 or more have a chance below 0.4 %


def test_change_that_chance_explains_is_undecided(rows):
    few = [item for item in rows if item.seed < 3]
    changes = compare(board(few), board(scaled(few, "b", 1.02, noise=0.2)))
    assert changes
    assert {change.verdict for change in changes} == {"undecided"}
    one = [item for item in rows if item.seed == 0]
    changes = compare(board(one), board(scaled(one, "b", 2.0)))
    assert {(c.verdict, c.label, round(c.ratio, 6)) for c in changes} == {("undecided", "b", 2.0)}


def test_only_common_seeds_are_compared(rows):
    more = rows + [row("a", seed, 1e3, scenario) for seed in (30, 31)
                   for scenario in ("step", "hill")]  # fmt: skip
    fewer = [item for item in rows if item.seed >= 10]
    base = board(rows)
    assert compare(base, base.model_copy(update={"runs": board(fewer).runs})) == []
    added = compare(base, base.model_copy(update={"runs": board(more).runs}))
    assert added == []
    apart = noisy_rows({"a": 1.0, "b": 2.0, "c": 3.0}, seeds=5, shift=50)
    changes = compare(base, board(apart))
    assert {c.verdict for c in changes} == {"missing"}
    assert "no seed in common" in changes[0].detail


def test_new_failures_and_missing_methods_fail_the_comparison(rows):
    broken = [
        row("b", item.seed, None, item.scenario, status="diverged", reason="mu is nan")
        if (item.label, item.seed, item.scenario) in {("b", 4, "step"), ("b", 7, "step")}
        else item
        for item in rows
        if item.label != "c"
    ]
    changes = compare(board(rows), board(broken))
    assert [(c.verdict, c.label, c.scenario) for c in changes] == [
        ("failed", "b", "step"), ("missing", "c", "hill"), ("missing", "c", "step"),
    ]  # fmt: skip
    assert changes[0].detail == "2 runs that were ok, first seed 4: diverged: mu is nan"
    assert all(change.regression for change in changes)
    back = compare(board(broken), board(rows))
    assert {(c.verdict, c.label) for c in back} == {("new", "c")}


def runtime(relative, spread=0.02):
    ends = {"low": relative * (1 - spread), "high": relative * (1 + spread)}
    return {"a": {"batch": RelativeRuntime(relative=relative, step=1e-8, **ends)}}


def test_slower_step_is_judged_by_its_relative_runtime(rows):
    base = board(rows, runtime(2.0))
    assert compare(base, board(rows, runtime(2.8))) == []
    (slower,) = compare(base, board(rows, runtime(4.0)))
    assert (slower.verdict, slower.regression, slower.ratio) == ("slower", True, 2.0)
    assert slower.confidence == 0.95
    assert "batch step 2 -> 4 reference kernels" in slower.detail
    assert compare(base, board(rows, runtime(4.0)), factor=2.5) == []
    (unsure,) = compare(base, board(rows, runtime(4.0, spread=0.4)))
    assert (unsure.verdict, unsure.regression) == ("undecided", False)
    (faster,) = compare(base, board(rows, runtime(0.5)))
    assert (faster.verdict, faster.regression) == ("faster", False)
    assert compare(base, board(rows)) == []


def test_limits_that_make_no_sense_are_refused(rows):
    made = board(rows)
    for limits in ({"factor": 0.9}, {"margin": -0.1}, {"confidence": 95.0}):
        with pytest.raises(InputError, match="compare: factor"):
            compare(made, made, **limits)
