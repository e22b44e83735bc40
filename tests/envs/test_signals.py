"""The signal table."""

import numpy as np
import pytest

from gripbench.envs.signals import IDEALISED, SIGNALS, record_type, signal
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
