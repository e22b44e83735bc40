"""The longitudinal tyre against its closed form, its symmetry and finite differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gripbench.envs.tyres.longitudinal import (
    CRAWL_SPEED,
    magic_formula,
    magic_formula_slope,
    slip_ratio,
    slip_ratio_slopes,
)

B, C, E = 20.0, 1.5, -0.5

slips = st.floats(-1.0, 1.0)
speeds = st.floats(-60.0, 60.0)


@given(slips)
def test_magic_formula_is_the_printed_one(slip):
    printed = np.sin(C * np.arctan(B * slip - E * (B * slip - np.arctan(B * slip))))
    assert magic_formula.py_func(slip, B, C, E) == pytest.approx(printed, abs=1e-15)
    assert magic_formula(slip, B, C, E) == pytest.approx(printed, abs=1e-15)


def test_slope_at_zero_slip_is_b_times_c():
    value, slope = magic_formula_slope(0.0, B, C, E)
    assert value == 0.0
    assert slope == pytest.approx(B * C, rel=1e-14)


def test_peak_is_one_and_falls_beyond():
    slip = np.linspace(0.0, 1.0, 20001)
    force = np.array([magic_formula(s, B, C, E) for s in slip])
    peak = force.argmax()
    assert force[peak] == pytest.approx(1.0, abs=1e-6)
    assert 0.05 < slip[peak] < 0.2
    assert np.all(np.diff(force[: peak + 1]) > 0.0)
    assert np.all(np.diff(force[peak + 1 :]) < 0.0)
    # the limit for infinite slip: sin(C pi/2)
    assert magic_formula(1e12, B, C, E) == pytest.approx(np.sin(C * np.pi / 2), abs=1e-6)


@given(slips)
def test_force_is_odd_in_slip(slip):
    assert magic_formula.py_func(-slip, B, C, E) == -magic_formula.py_func(slip, B, C, E)


@given(slips, st.floats(5.0, 30.0), st.floats(1.0, 1.9), st.floats(-2.0, 0.9))
def test_slope_is_the_derivative(slip, b, c, e):
    value, slope = magic_formula_slope.py_func(slip, b, c, e)
    step = 1e-6
    ahead, behind = (magic_formula.py_func(slip + d, b, c, e) for d in (step, -step))
    assert value == magic_formula.py_func(slip, b, c, e)
    assert slope == pytest.approx((ahead - behind) / (2 * step), rel=1e-5, abs=1e-5)


@given(st.floats(0.2, 60.0), st.floats(0.2, 60.0))
def test_slip_ratio_is_5a_when_driving_and_5b_when_braking(rolling, speed):
    expected = (rolling - speed) / (rolling if rolling >= speed else speed)
    assert slip_ratio.py_func(rolling, speed) == expected
    assert -1.0 <= expected <= 1.0


@given(speeds, speeds)
def test_slip_ratio_turns_with_the_direction_of_travel(rolling, speed):
    forward = slip_ratio.py_func(rolling, speed)
    assert slip_ratio.py_func(-rolling, -speed) == -forward
    assert abs(forward) <= 2.0


@given(speeds, speeds)
def test_slip_ratio_slopes_are_its_derivatives(rolling, speed):
    step = 1e-7
    sizes = sorted((abs(rolling), abs(speed), CRAWL_SPEED))
    if sizes[2] - sizes[1] < 1e-5 or min(abs(rolling), abs(speed)) < 1e-5:
        return  # a corner of the denominator
    to_rolling, to_speed = slip_ratio_slopes.py_func(rolling, speed)

    def slip(r, v):
        return slip_ratio.py_func(r, v)

    numeric_rolling = (slip(rolling + step, speed) - slip(rolling - step, speed)) / (2 * step)
    numeric_speed = (slip(rolling, speed + step) - slip(rolling, speed - step)) / (2 * step)
    assert to_rolling == pytest.approx(numeric_rolling, rel=1e-5, abs=1e-6)
    assert to_speed == pytest.approx(numeric_speed, rel=1e-5, abs=1e-6)


def test_crawling_keeps_the_denominator():
    assert slip_ratio(0.0, 0.0) == 0.0
    assert slip_ratio(0.01, 0.0) == pytest.approx(0.1)
    assert slip_ratio_slopes(0.01, 0.0) == (1.0 / CRAWL_SPEED, -1.0 / CRAWL_SPEED)
