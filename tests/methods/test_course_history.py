"""Courses of the past: interpolation, and which samples may be used."""

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gripbench.methods.blocks.course_history import (
    HISTORY,
    change_since,
    is_usable,
    remember,
    wrapped,
)


@given(st.floats(-50.0, 50.0))
def test_wrapped_is_the_same_direction_within_a_half_turn(angle):
    result = wrapped(angle)
    assert -np.pi - 1e-12 <= result <= np.pi + 1e-12
    assert np.exp(1j * result) == pytest.approx(np.exp(1j * angle), abs=1e-9)


@numba.njit
def _fill(records, times, values):
    for i in range(len(times)):
        remember(records[0], times[i], values[i])


def filled(step, count):
    records = np.zeros(1, HISTORY)
    times = step * np.arange(count)
    _fill(records, times, np.sin(times))
    return records[0], times


@pytest.mark.parametrize(("step", "count"), [(0.01, 50), (0.01, 1000), (0.001, 3000)])
@pytest.mark.parametrize("late", [0.0, 0.013, 0.2, 0.4])
def test_change_is_that_of_the_interpolated_course(step, count, late):
    history, times = filled(step, count)
    now = times[-1]
    expected = np.sin(now) - np.sin(now - late)
    assert change_since(history, now - late) == pytest.approx(expected, abs=2e-5)


def test_a_sample_is_used_once_in_order_and_within_the_history():
    history, times = filled(0.01, 1000)
    now = times[-1]
    assert not is_usable(history, now + 0.01)  # from the future
    assert not is_usable(history, now - 5.0)  # forgotten
    assert is_usable(history, now - 0.4)
    assert not is_usable(history, now - 0.4)  # repeated
    assert not is_usable(history, now - 0.6)  # out of order
    assert is_usable(history, now - 0.2)


def test_nothing_can_be_compared_with_an_empty_history():
    assert not is_usable(np.zeros(1, HISTORY)[0], 0.0)
