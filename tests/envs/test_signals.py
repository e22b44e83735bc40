"""The signal table."""

import math

import numpy as np
import pytest

from gripbench.envs.signals import (
    IDEALISED,
    SIGNALS,
    difference,
    record_type,
    signal,
    wrapped,
)
from gripbench.errors import InputError


def test_every_signal_says_what_it_is():
    for name, entry in SIGNALS.items():
        assert entry.name == name
        assert name.isidentifier()
        assert name == name.lower()
        for text in (entry.unit, entry.frame, entry.sign, entry.description):
            assert text
        assert entry.shape == ()


def test_the_channels_that_no_sensor_gives_are_marked():
    for name in ("wheel_acceleration_front", "wheel_acceleration_rear", "speed_x_rate"):
        assert signal(name).idealised
        assert signal(name).instrument == IDEALISED
    for name in ("accel_x", "wheel_speed_front", "speed_gps", "mu_front"):
        assert not signal(name).idealised


def test_derived_signals():
    variance = signal("force_x_front_variance")
    assert variance.unit == "(N)^2"
    assert signal("mu_front_variance").unit == "-"
    assert "new sample" in signal("speed_gps_new").sign


def test_unknown_signal_names_the_nearest():
    with pytest.raises(InputError, match="unknown signal 'acel_x': did you mean 'accel_x'"):
        signal("acel_x")


def test_record_type():
    kind = record_type(("time", "accel_x", "accel_x_new"))
    assert kind.names == ("time", "accel_x", "accel_x_new")
    assert all(kind[name] == np.float64 for name in kind.names)
    with pytest.raises(InputError):
        record_type(("time", "nothing_like_it"))


@pytest.mark.parametrize(
    ("name", "unit", "factor"),
    [
        ("sideslip", "deg", 180.0 / math.pi),
        ("slip_angle_front_left", "deg", 180.0 / math.pi),
        ("yaw_rate", "deg/s", 180.0 / math.pi),
        ("sideslip_variance", "deg^2", (180.0 / math.pi) ** 2),
        ("wheel_speed_front", "rad/s", 1.0),
        ("cornering_stiffness_front", "N/rad", 1.0),
        ("mu", "-", 1.0),
    ],
)
def test_each_signal_has_one_unit_that_people_see(name, unit, factor):
    shown = signal(name)
    assert (shown.display_unit, shown.display_factor) == (unit, factor)


def test_what_turns_is_an_angle_and_what_does_not_is_none():
    for name in ("yaw", "course", "roll", "road_grade", "steer_angle", "slip_angle_rear_left"):
        assert signal(name).angle, name
    for name in ("yaw_rate", "slip_ratio_front", "cornering_stiffness_front", "yaw_variance"):
        assert not signal(name).angle, name


def test_a_wrap_keeps_the_bits_of_what_lies_within_and_takes_off_whole_turns():
    angles = np.random.default_rng(0).uniform(-math.pi, math.pi, 1000)
    assert np.array_equal(wrapped(angles), angles)
    for turns in (-3, -1, 1, 7):
        assert np.abs(wrapped(angles + turns * 2.0 * math.pi) - angles).max() < 1e-13
    assert np.isnan(wrapped(float("nan")))


def test_the_difference_of_an_angle_is_the_shorter_way_round():
    assert difference("yaw", 3.1, -3.1) == pytest.approx(6.2 - 2.0 * math.pi)
    assert difference("yaw_rate", 3.1, -3.1) == pytest.approx(6.2)
