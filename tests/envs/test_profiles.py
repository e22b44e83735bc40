"""Profiles against what their pieces say."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gripbench.configuration import parse
from gripbench.envs.drivers.profiles import Segment, breakpoints, profile_value, segment_records
from gripbench.errors import InputError

RAMP = Segment(start=1.0, end=3.0, first=10.0, last=50.0)
HOLD = Segment(start=3.0, end=4.0, first=-5.0, last=-5.0)
SINE = Segment(start=5.0, end=30.0, amplitude=2150.0, period=50.0)


@given(st.floats(1.0, 3.0, exclude_max=True))
def test_line(time):
    value = profile_value(time, segment_records((RAMP, HOLD)))
    assert value == pytest.approx(10.0 + 20.0 * (time - 1.0))


@given(st.floats(5.0, 30.0, exclude_max=True))
def test_sine_starts_with_its_piece(time):
    value = profile_value(time, segment_records((SINE,)))
    assert value == pytest.approx(2150.0 * np.sin(2.0 * np.pi * (time - 5.0) / 50.0), abs=1e-9)


def test_nothing_where_no_piece_is():
    records = segment_records((RAMP, HOLD, SINE))
    for time in (0.0, 0.999, 4.0, 4.5, 30.0, 100.0):
        assert profile_value(time, records) == 0.0


def test_value_after_a_jump():
    assert profile_value(3.0, segment_records((RAMP, HOLD))) == -5.0


def test_overlapping_pieces_add():
    both = segment_records((RAMP, Segment(start=0.0, end=10.0, first=1.0, last=1.0)))
    assert profile_value(2.0, both) == pytest.approx(31.0)


def test_breakpoints():
    assert breakpoints((RAMP, HOLD, SINE)) == {1.0, 3.0, 4.0, 5.0, 30.0}


@pytest.mark.parametrize(
    ("piece", "message"),
    [
        ({"start": 2.0, "end": 2.0}, "not after start"),
        ({"start": 2.0, "end": 1.0}, "not after start"),
        ({"start": -1.0, "end": 1.0}, "key 'start'"),
        ({"start": 0.0, "end": 1.0, "first": float("nan")}, "key 'first'.*finite"),
        ({"start": 0.0, "end": 1.0, "amplitude": float("inf")}, "key 'amplitude'.*finite"),
        ({"start": 0.0, "end": 1.0, "period": 0.0}, "key 'period'"),
        ({"start": 0.0, "end": 1.0, "lst": 1.0}, "unknown key 'lst': did you mean 'last'"),
        ({"start": 0.0}, "missing key 'end'"),
    ],
)
def test_mistakes_are_named(piece, message):
    with pytest.raises(InputError, match=message):
        parse(Segment, piece, "file.toml")
