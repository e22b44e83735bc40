"""Windows of a map: the log's own clock, outside of the log, and with too little in them."""

import numpy as np
import pandas as pd
import pytest

from gripbench.errors import InputError
from gripbench.logs.importing import import_frame

START = 1_700_000_000.0
MAP = {
    "name": "my_drive",
    "time": {"column": "t", "unit": "s"},
    "channels": {"yaw_rate": {"column": "r", "unit": "rad/s"}},
    "reference": {"sideslip": {"column": "beta", "unit": "rad"}},
}


def _import(windows, blank=(0.0, 0.0), start=START, **more):
    time = np.arange(0.0, 40.0, 0.02)
    beta = np.where((time > blank[0]) & (time < blank[1]), np.nan, 0.01 * np.sin(time))
    frame = pd.DataFrame({"t": start + time, "r": np.cos(time), "beta": beta})
    return import_frame(frame, {**MAP, "windows": windows, **more}).recordings


def test_windows_and_bounds_are_on_the_clock_of_the_log_unless_the_map_says_otherwise():
    bound = {"low": 0.5, "high": 0.8, "start": START + 20.0, "end": START + 27.0, "source": "x"}
    (own,) = _import({"test": [[START + 15.0, START + 39.98]]}, bounds={"mu": [bound]})
    bound |= {"start": 20.0, "end": 27.0}
    (counted,) = _import({"from_start": True, "test": [[15.0, 39.98]]}, bounds={"mu": [bound]})
    for one in (own, counted):
        ((start, end),) = one.windows["test"]
        assert (start, end) == pytest.approx((15.0, 39.98), abs=1e-6)
        assert (one.bounds[0].start, one.bounds[0].end) == pytest.approx((20.0, 27.0), abs=1e-6)


@pytest.mark.parametrize(
    ("windows", "says"),
    [
        ({"test": [[15.0, 39.0]]}, r"windows.test\[0\].*outside the log.*set windows.from_start"),
        ({"test": [[START + 50.0, START + 60.0]]}, "outside the log, which covers 1700000000"),
        ({"test": [[START + 30.0, START + 60.0]]}, r"windows.test\[0\].*outside"),
        ({"train": [[START - 9.0, START + 9.0]]}, r"windows.train\[0\].*outside"),
        ({"from_start": True, "test": [[30.0, 45.0]]}, "covers 0.000 to 39.980 s counted from the"),
        ({"test": [[START + 5.0, START + 4.0]]}, "must start before it ends"),
    ],
)
def test_a_window_outside_the_log_is_refused(windows, says):
    with pytest.raises(InputError, match=says):
        _import(windows)


def test_a_window_with_fewer_samples_than_asked_for_is_refused_unless_that_is_asked_for():
    windows = {"from_start": True, "test": [[10.0, 20.0]]}
    with pytest.raises(InputError, match=r"samples with a reference 'sideslip', 50 % of its time"):
        _import(windows, blank=(12.0, 17.0))
    with pytest.raises(InputError, match=r"score_from leaves out the first 15 s"):
        _import(windows, score_from=15.0)
    (kept,) = _import({**windows, "covered": 0.45}, blank=(12.0, 17.0))
    assert kept.windows["test"] == ((10.0, 20.0),)
    with pytest.raises(InputError, match="has 0 samples"):
        _import({**windows, "covered": 0.0}, blank=(9.0, 21.0))


def test_a_bound_outside_the_log_is_refused():
    bound = {"low": 0.5, "high": 0.8, "start": 20.0, "end": 27.0, "source": "plate"}
    with pytest.raises(InputError, match=r"bounds.mu\[0\].*outside the log"):
        _import({}, bounds={"mu": [bound]})


def test_windows_of_runs_belong_to_the_run_that_holds_them():
    time = np.arange(0.0, 40.0, 0.02)
    frame = pd.DataFrame({"t": time, "r": 0.0, "beta": 0.0, "run": time // 20.0})
    windows = {"train": [[1.0, 9.0]], "test": [[25.0, 35.0]]}
    first, second = import_frame(frame, {**MAP, "runs": "run", "windows": windows}).recordings
    assert first.windows == {"train": ((1.0, 9.0),), "test": ()}
    assert second.windows["test"][0] == pytest.approx((5.0, 15.0))
    with pytest.raises(InputError, match=r"windows.test\[0\].*outside"):
        import_frame(frame, {**MAP, "runs": "run", "windows": {"test": [[15.0, 25.0]]}})
