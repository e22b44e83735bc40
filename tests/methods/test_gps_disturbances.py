"""GPS samples that are late, missing, repeated or out of order, for every method that reads GPS."""

import numpy as np
import pytest

from gripbench.envs.worlds import load_scenario, record
from gripbench.methods.kinematic_kalman_filter import KinematicKalmanFilter
from gripbench.methods.magnetometer_gps_cascade import MagnetometerGpsCascade
from gripbench.methods.model_based_kalman_filter import ModelBasedKalmanFilter
from gripbench.methods.stiffness_update import StiffnessUpdate

METHODS = [
    KinematicKalmanFilter(),
    ModelBasedKalmanFilter(),
    StiffnessUpdate(),
    MagnetometerGpsCascade(),
]
by_name = pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
GPS = ("velocity_north", "velocity_west", "velocity_up", "course", "gps_time")
FLAGS = tuple(f"{name}_new" for name in GPS)


@pytest.fixture(scope="module")
def run():
    """A lane change on snow, its GPS 400 ms late with 5 Hz: two samples are always in flight."""
    scenario = load_scenario("double_lane_change_snow").model_copy(update={"horizon": 12.0})
    return record(scenario, 4)


def estimate(method, run, observations):
    found = method.run(run.vehicle, observations)
    assert all(np.isfinite(found[name]).all() for name in method.outputs)
    return found


def announced(observations):
    """Return the indices at which a GPS sample is announced."""
    return np.flatnonzero(observations["gps_time_new"])


def error(run, found):
    return np.degrees(np.abs(found["sideslip"] - run.truth["sideslip"]))


@by_name
def test_a_repeated_sample_changes_nothing(method, run):
    dirty = run.observations.copy()
    for flag in FLAGS:
        dirty[flag][announced(dirty)[:-1] + 7] = 1.0  # the held reading once more
    clean = estimate(method, run, run.observations)
    np.testing.assert_array_equal(estimate(method, run, dirty), clean)


@by_name
def test_a_sample_that_is_overtaken_is_left_out(method, run):
    """Every fifth sample comes after its successor: that alone is used."""
    dirty, without = run.observations.copy(), run.observations.copy()
    at = announced(dirty)
    for k in range(10, len(at) - 2, 5):
        first, second, third = at[k], at[k + 1], at[k + 2]
        for name in GPS:
            early, late = dirty[name][first], dirty[name][second]
            dirty[name][first:second] = without[name][first:second] = late
            dirty[name][second:third] = early
            without[name][second:third] = late
        for flag in FLAGS:
            without[flag][second] = 0.0
    clean, found = estimate(method, run, without), estimate(method, run, dirty)
    np.testing.assert_array_equal(found["yaw"], clean["yaw"])
    assert error(run, found)[run.truth["time"] > 3.0].max() < 20.0


@by_name
def test_missing_samples_are_bridged(method, run):
    """Two seconds without GPS in the manoeuvre, then it comes back."""
    dirty = run.observations.copy()
    gone = (dirty["time"] > 8.0) & (dirty["time"] < 10.0)
    for flag in FLAGS:
        dirty[flag][gone] = 0.0
    clean = estimate(method, run, run.observations)
    found = estimate(method, run, dirty)
    before, after = run.truth["time"] < 8.0, run.truth["time"] > 11.5
    np.testing.assert_array_equal(found[before], clean[before])
    assert error(run, found)[after].max() < error(run, clean)[after].max() + 1.0


@by_name
def test_a_sample_from_the_future_is_left_out(method, run):
    dirty, without = run.observations.copy(), run.observations.copy()
    for k in announced(dirty)[20::10]:
        dirty["gps_time"][k] = dirty["time"][k] + 0.5
        for flag in FLAGS:
            without[flag][k] = 0.0
    np.testing.assert_array_equal(
        estimate(method, run, dirty)["yaw"], estimate(method, run, without)["yaw"]
    )
