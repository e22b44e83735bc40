"""Missing samples and bad clocks: what a step is given, and that every method stands it."""

from functools import cache

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gripbench.bench.catalogue.registry import built_in_methods
from gripbench.bench.running.execution import missing
from gripbench.envs.signals import NEW, VARIANCE
from gripbench.envs.worlds import load_scenario, record
from gripbench.methods.contract import CompiledMethod, compiled
from gripbench.methods.samples import LATE, admit, layout_of, memory_of, select_channels

NAMES = ("accel_x", "course", "course_new", "speed_gps", "gps_time", "time")
NAN = np.nan


def admitted(rows, names=NAMES):
    """Return the rows as a step would be given them, and which of them it is."""
    rows = np.hstack([np.array(rows, float), np.zeros((len(rows), 2))])
    memory, layout = memory_of(names[:-1]), layout_of(names[:-1])
    taken = [bool(admit(row, memory, layout)) for row in rows]
    return rows[:, :-2], taken


def test_whole_samples_in_order_pass_as_they_are():
    rows = np.random.default_rng(0).standard_normal((20, 6))
    rows[:, -1] = np.arange(20.0)
    passed, taken = admitted(rows.copy())
    assert all(taken)
    assert np.array_equal(passed, rows)


def test_a_missing_channel_holds_its_last_value_and_is_not_new():
    passed, taken = admitted([[1, 2, 1, 3, 0, 0], [NAN, 4, 1, NAN, 0, 1]])
    assert taken == [True, True]
    assert passed[1].tolist() == [1, 4, 0, 3, 0, 1]  # part of a GPS reading is none


def test_nothing_is_taken_before_each_sensor_without_a_flag_has_spoken():
    passed, taken = admitted(
        [[NAN, 2, 1, 3, 0, 0], [1, NAN, NAN, NAN, NAN, 1], [1, 2, 1, 3, 0, 2]], NAMES
    )
    assert taken == [False, True, True]
    assert passed[1].tolist() == [1, 2, 0, 3, 0, 1]
    passed, taken = admitted([[1, NAN, NAN, NAN, NAN, 1]])
    assert taken == [True]
    assert passed[0].tolist() == [1, 0, 0, 0, 0, 1]


def test_a_clock_that_stands_or_steps_back_is_waited_for():
    times = [0.0, 1.0, 1.0, 0.5, 1.5, NAN, 2.0]
    _, taken = admitted([[t, t] for t in times], ("accel_x", "time"))
    assert taken == [True, True, False, False, True, False, True]


def test_a_clock_that_is_set_back_goes_on_from_where_it_was():
    times = np.array([100.0, 101.0, 5.0, 6.0, 8.0])
    rows = [[0.0, 0.0, 1.0, 0.0, t - 0.1, t] for t in times]
    passed, taken = admitted(rows)
    assert taken == [True, True, False, True, True]
    assert passed[3:, -1].tolist() == [102.0, 104.0]
    assert passed[3:, -2] == pytest.approx([101.9, 103.9])
    assert LATE < 101.0 - 5.0


@compiled
def _counts(state, obs, params, est):
    state.count += obs.accel_x_new
    est.accel_x = state.count


class _Counts(CompiledMethod):
    name = "counts"
    title = "Counts"
    reference = "none"
    sensors = ("accel_x", "accel_x_new")
    estimates = ("accel_x",)
    state = np.dtype([("count", np.float64)])
    step = staticmethod(_counts)


def test_the_flag_of_a_fast_sensor_is_one_wherever_it_has_a_value():
    observations = np.zeros(5, [("time", float), ("accel_x", float)])
    observations["time"] = np.arange(5)
    observations["accel_x"][2] = NAN
    given = select_channels(observations, _Counts.sensors)
    assert given["accel_x_new"].tolist() == [1, 1, 0, 1, 1]
    assert _Counts().run({}, observations)["accel_x"].tolist() == [1, 2, 2, 3, 4]
    method = _Counts()
    method.reset({}, 1.0)
    seen = [method.update({"time": k, "accel_x": 1.0})["accel_x"] for k in range(3)]
    assert seen == [1, 2, 3]


DRIVES = ("constant_mu", "double_lane_change_snow")


@cache
def drive(name):
    """Return the first second of a drive, with every channel that its world can give."""
    scenario = load_scenario(name)
    return record(scenario.model_copy(update={"horizon": 1.0, "score_from": 0.0}), 0)


@cache
def drive_of(method):
    """Return a drive that gives all that a method reads."""
    for name in DRIVES:
        run = drive(name)
        if not missing(method, run.vehicle, run.observations.dtype.names):
            return run
    raise AssertionError(f"{method.name}: no drive of {DRIVES} gives its sensors")


@st.composite
def faults(draw):
    """Return one to three faults: kind, which channel, where, how many samples, value."""
    kinds = ("channel", "instrument", "still", "back", "ahead", "no time", "not new")
    return [
        (draw(st.sampled_from(kinds)), draw(st.floats(0, 1)), draw(st.floats(0, 1)),
         draw(st.sampled_from((1, 2, 50, 10_000))), draw(st.sampled_from((NAN, np.inf, -np.inf))))
        for _ in range(draw(st.integers(1, 3)))
    ]  # fmt: skip


def spoil(observations, channels, spoils):
    out = observations.copy()
    present = [name for name in channels if name in out.dtype.names and not name.endswith(NEW)]
    for kind, which, where, length, value in spoils:
        first = int(where * (len(out) - 1))
        part = out[first : first + length]
        if kind == "channel" and present:
            part[present[int(which * (len(present) - 1))]] = value
        elif kind == "instrument":
            for name in present:
                part[name] = value
        elif kind == "still":
            part["time"] = part["time"][0]
        elif kind == "back":
            out["time"][first:] -= 10.0 ** (6.0 * which - 3.0)
        elif kind == "ahead":
            out["time"][first:] += 10.0 ** (4.0 * which - 3.0)
        elif kind == "no time":
            part["time"] = value
        elif kind == "not new":
            for name in out.dtype.names:
                if name.endswith(NEW):
                    part[name] = value
    return out


def online(method, vehicle, observations):
    method.reset(vehicle, 1e-3)
    names = observations.dtype.names
    rows = [
        tuple(method.update(dict(zip(names, row.item(), strict=True))).values())
        for row in observations
    ]
    return np.array(rows, [(name, float) for name in method.outputs])


LONGEST = [("instrument", 0.0, 0.0, 50, NAN), ("back", 0.3, 0.5, 1, NAN)]


QUICK = ("dugoff_ekf", "extended_kalman_filter", "kinematic_kalman_filter")
EVERY = [
    pytest.param(name, marks=() if name in QUICK else pytest.mark.slow)  # each compiles a loop
    for name in built_in_methods()
]


@pytest.mark.parametrize("name", EVERY)
@settings(max_examples=20)
@given(spoils=faults())
@example(spoils=LONGEST)
@example(spoils=[("channel", 0.0, 0.4, 1, NAN)])
@example(spoils=[("back", 0.45, 0.5, 1, NAN)])
@example(spoils=[("ahead", 1.0, 0.5, 1, NAN), ("instrument", 0.0, 0.6, 50, np.inf)])
def test_every_method_stays_finite_and_its_variances_positive(name, spoils):
    method = built_in_methods()[name]()
    run = drive_of(method)
    spoilt = spoil(run.observations, method.sensors, spoils)
    estimates = method.run(run.vehicle, spoilt)
    for field in estimates.dtype.names:
        assert np.isfinite(estimates[field]).all(), field
        if field.endswith(VARIANCE):
            assert (estimates[field] >= 0.0).all(), field


@pytest.mark.parametrize("name", ["kinematic_kalman_filter", "slip_slope"])
@settings(max_examples=5)
@given(spoils=faults())
def test_both_drivers_treat_a_bad_sample_alike(name, spoils):
    method = built_in_methods()[name]()
    run = drive_of(method)
    spoilt = spoil(run.observations[:200], method.sensors, spoils)
    batch = method.run(run.vehicle, spoilt)
    assert np.array_equal(batch, online(built_in_methods()[name](), run.vehicle, spoilt))
