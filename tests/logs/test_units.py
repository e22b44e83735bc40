import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gripbench.envs.signals import SIGNALS
from gripbench.errors import InputError
from gripbench.logs.mapping.units import UNITS, conversion, proposed_unit


def test_every_signal_has_an_accepted_unit():
    assert {signal.unit for signal in SIGNALS.values()} <= set(UNITS)


@pytest.mark.parametrize(
    ("unit", "target", "per", "value"),
    [
        ("km/h", "m/s", "", 1 / 3.6),
        ("deg/s", "rad/s", "", math.pi / 180),
        ("rpm", "rad/s", "", math.pi / 30),
        ("g", "m/s^2", "", 9.80665),
        ("mG", "T", "", 1e-7),
        ("mph", "m/s", "", 0.44704),
        ("m/s", "rad/s", "m", 1.0),
    ],
)
def test_known_conversions(unit, target, per, value):
    assert conversion(unit, target, per) == pytest.approx(value, rel=1e-12)


@given(st.sampled_from(sorted(UNITS)), st.sampled_from(sorted(UNITS)))
def test_conversion_is_reversible_or_refused_both_ways(one, other):
    if UNITS[one].dimension == UNITS[other].dimension:
        there = conversion(one, other)
        assert there * conversion(other, one) == pytest.approx(1.0, rel=1e-12)
    else:
        with pytest.raises(InputError, match="allowed are"):
            conversion(one, other)


def test_angle_is_no_bare_number():
    with pytest.raises(InputError, match="unit 'deg'"):
        conversion("deg", "-")


def test_unknown_unit_names_the_nearest():
    with pytest.raises(InputError, match="did you mean 'km/h'"):
        conversion("kmh", "m/s")


@pytest.mark.parametrize(
    ("text", "unit"), [("[°/s]", "deg/s"), ("km/h", "km/h"), ("mps2", "m/s^2"), ("apples", None)]
)
def test_spellings_of_logs(text, unit):
    assert proposed_unit(text) == unit
