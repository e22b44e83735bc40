"""Biases: found where they are known, with a scatter that holds, from training time only."""

import dataclasses

import numpy as np
import pytest

from gripbench.envs.recordings import Recording
from gripbench.envs.signals import record_type
from gripbench.errors import InputError
from gripbench.logs.vehicle.biases import identify_biases

GYRO, ALONG, ACROSS = 0.004, 0.12, -0.07


def _drive(still=10.0, seed=3):
    """A standstill, then a weave at changing speed; all of it known."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 70.0, 0.01)
    moving = time >= still
    speed = np.where(moving, 12.0 + 3.0 * np.sin(0.3 * (time - still)), 0.0)
    gain = np.where(moving, 0.9 * np.cos(0.3 * (time - still)), 0.0)
    rate = np.where(moving, 0.2 * np.sin(0.5 * time), 0.0)
    seen = np.zeros(
        len(time), record_type(["time", "yaw_rate", "accel_x", "accel_y", "speed_gps", "course"])
    )
    truth = np.zeros(len(time), record_type(["time", "yaw", "speed_x"]))
    seen["time"] = truth["time"] = time
    truth["yaw"] = np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1])) * 0.01)
    truth["speed_x"] = seen["speed_gps"] = speed
    seen["course"] = np.arctan2(np.sin(truth["yaw"]), np.cos(truth["yaw"]))
    seen["yaw_rate"] = rate + GYRO + 0.01 * rng.standard_normal(len(time))
    seen["accel_x"] = gain + ALONG + 0.1 * rng.standard_normal(len(time))
    seen["accel_y"] = rate * speed + ACROSS + 0.1 * rng.standard_normal(len(time))
    windows = {"train": ((20.0, 45.0),), "test": ((45.0, 70.0),)}
    return Recording("drive", 0, {}, seen, truth, windows=windows)


@pytest.mark.parametrize(("still", "kind"), [(10.0, "standstill"), (0.0, "motion")])
def test_biases_are_found_within_their_deviations(still, kind):
    found = {bias.channel: bias for bias in identify_biases([_drive(still)])}
    # In motion a_y is compared with the biased gyroscope times the speed.
    across = ACROSS - (GYRO * 12.0 if kind == "motion" else 0.0)
    for channel, value in (("yaw_rate", GYRO), ("accel_x", ALONG), ("accel_y", across)):
        bias = found[channel]
        assert bias.found_from == kind
        assert abs(bias.value - value) < 5.0 * bias.deviation + 1e-3
        assert bias.deviation < 0.02


def test_the_deviation_is_the_scatter_over_drives():
    values = [
        next(b for b in identify_biases([_drive(seed=s)]) if b.channel == "accel_x")
        for s in range(40)
    ]
    scatter = np.std([bias.value for bias in values], ddof=1)
    assert np.mean([bias.deviation for bias in values]) == pytest.approx(scatter, rel=0.4)


def test_test_windows_are_judged_and_not_fitted():
    drive = _drive(0.0)
    seen = drive.observations.copy()
    seen["yaw_rate"][drive.observations["time"] > 45.0] += 0.1
    spoilt = dataclasses.replace(drive, observations=seen)
    before, after = (identify_biases([r])[0] for r in (drive, spoilt))
    assert after.value == before.value
    assert after.test_rms == pytest.approx(0.1, rel=0.05)
    assert before.test_rms < 0.01


def test_reference_heading_before_gps_and_gps_where_there_is_no_reference():
    drive = _drive(0.0)
    truth = drive.truth[["time", "speed_x"]].copy()
    bare = dataclasses.replace(drive, truth=truth)
    assert identify_biases([bare])[0].value == pytest.approx(GYRO, abs=1e-3)


def test_a_log_that_cannot_tell_says_why():
    drive = dataclasses.replace(_drive(0.0), windows={})
    with pytest.raises(InputError, match=r"no standstill of 1\.5 s"):
        identify_biases([drive])
