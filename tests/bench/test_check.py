"""Every check finds the mistake that it is there for, and every built-in method passes all."""

import math
import time

import pytest

from gripbench.bench.catalogue.check import (
    CHECKS,
    EXPECTED,
    PASSED,
    SKIPPED,
    check_estimator,
    failures,
)
from gripbench.bench.catalogue.registry import built_in_methods
from gripbench.errors import InputError

SCENARIO = ("constant_mu",)


class Sound:
    """Passes everything; each faulty method below differs by one thing."""

    name = "sound"
    sensors = ("accel_x", "speed_gps")
    estimates = ("force_x_front",)
    variances = ("force_x_front",)

    def reset(self, vehicle, dt):
        self.last = 0.0

    def update(self, obs):
        self.last = 0.9 * self.last + 0.1 * obs["accel_x"]
        return {"force_x_front": self.last, "force_x_front_variance": 1.0}


class UnknownChannel(Sound):
    sensors = ("acel_x",)


class NoName(Sound):
    name = None


class Peeks(Sound):
    def update(self, obs):
        return {"force_x_front": obs["torque_front"], "force_x_front_variance": 1.0}


class Remembers(Sound):
    def __init__(self):
        self.last = 0.0

    def reset(self, vehicle, dt):
        pass


class Counts(Sound):
    runs = 0

    def reset(self, vehicle, dt):
        super().reset(vehicle, dt)
        Counts.runs += 1

    def update(self, obs):
        return {"force_x_front": float(Counts.runs), "force_x_front_variance": 1.0}


class LooksAhead(Sound):
    def run(self, vehicle, observations):
        import numpy as np

        estimates = np.zeros(
            len(observations), [("force_x_front", float), ("force_x_front_variance", float)]
        )
        estimates["force_x_front"] = observations["accel_x"] - observations["accel_x"].mean()
        return estimates


class KeepsTheBuffer(Sound):
    def reset(self, vehicle, dt):
        self.previous = None

    def update(self, obs):
        value = self.previous["accel_x"] if self.previous is not None else obs["accel_x"]
        self.previous = obs
        return {"force_x_front": value, "force_x_front_variance": 1.0}


class OneDictForAll(Sound):
    def reset(self, vehicle, dt):
        self.result = {"force_x_front": 0.0, "force_x_front_variance": 1.0}

    def update(self, obs):
        self.result["force_x_front"] = obs["accel_x"]
        return self.result


class ChangesTheBuffer(Sound):
    def update(self, obs):
        obs["accel_x"] = 0.0
        return {"force_x_front": 0.0, "force_x_front_variance": 1.0}


class Grows(Sound):
    def reset(self, vehicle, dt):
        self.last = 1.0

    def update(self, obs):
        self.last *= 1.1
        return {"force_x_front": self.last, "force_x_front_variance": 1.0}


class CountsSteps(Sound):
    def reset(self, vehicle, dt):
        self.time = -0.001

    def update(self, obs):
        on_time = abs(obs["time"] - self.time - 0.001) < 1e-6
        self.time = obs["time"]
        return {"force_x_front": 1.0 if on_time else math.nan, "force_x_front_variance": 1.0}


class NeedsChange(Sound):
    def reset(self, vehicle, dt):
        self.speed = -1.0

    def update(self, obs):
        change, self.speed = obs["speed_gps"] - self.speed, obs["speed_gps"]
        return {"force_x_front": 1.0 / change, "force_x_front_variance": 1.0}


class DividesBySpeed(Sound):
    def update(self, obs):
        return {"force_x_front": 1.0 / obs["speed_gps"], "force_x_front_variance": 1.0}


class DividesByTorque(Sound):
    sensors = ("torque_front",)

    def reset(self, vehicle, dt):
        self.without = 0

    def update(self, obs):
        self.without = self.without + 1 if obs["torque_front"] == 0.0 else 0
        value = math.inf if self.without > 100 else 1.0
        return {"force_x_front": value, "force_x_front_variance": 1.0}


class NegativeVariance(Sound):
    def update(self, obs):
        return {"force_x_front": 0.0, "force_x_front_variance": -obs["time"]}


class CrossingQuantiles(Sound):
    variances = ()
    quantiles = {"force_x_front": (0.05, 0.95)}

    def update(self, obs):
        return {"force_x_front": 0.0, "force_x_front_q05": 1.0, "force_x_front_q95": -1.0}


class TwoForms(Sound):
    def run(self, vehicle, observations):
        import numpy as np

        estimates = np.zeros(
            len(observations), [("force_x_front", float), ("force_x_front_variance", float)]
        )
        estimates["force_x_front"] = observations["accel_x"]
        return estimates


class NotPicklable(Sound):
    def reset(self, vehicle, dt):
        super().reset(vehicle, dt)
        self.law = lambda value: value


class Slow(Sound):
    def update(self, obs):
        time.sleep(0.0015)
        return {"force_x_front": 0.0, "force_x_front_variance": 1.0}


FAULTS = [
    (UnknownChannel, "declares_its_channels", "did you mean 'accel_x'"),
    (NoName, "declares_its_channels", "set the class attribute 'name'"),
    (Peeks, "reads_only_its_channels", "reads the channel 'torque_front'"),
    (Remembers, "reset_equals_fresh", "let reset set every attribute"),
    (Counts, "same_input_same_output", "two runs over the same data differ"),
    (LooksAhead, "causal", "estimates change when later samples are cut off"),
    (KeepsTheBuffer, "copy_safe", "when the observation's dict is used again"),
    (OneDictForAll, "copy_safe", "changes estimates that it returned before"),
    (ChangesTheBuffer, "copy_safe", "changes the observation"),
    (Grows, "finite_on_every_scenario", "force_x_front is inf at t = "),
    (CountsSteps, "survives_missing_samples", "after missing samples"),
    (NeedsChange, "survives_held_samples", "ZeroDivisionError"),
    (DividesBySpeed, "survives_standstill", "guard divisions by speed"),
    (DividesByTorque, "survives_zero_torque_start", "at or after a start without torque"),
    (NegativeVariance, "variance_not_negative", "keep the covariance positive"),
    (CrossingQuantiles, "quantiles_in_order", "force_x_front_q05 is above force_x_front_q95"),
    (TwoForms, "online_and_batch_agree", "run and update give force_x_front"),
    (NotPicklable, "picklable", "keep no lambdas"),
    (Slow, "step_within_sample_time", "a sample comes every 1 ms"),
]


def test_every_check_has_a_method_that_fails_it():
    # tests/plugins has the one whose step is compiled again with bounds checking
    assert {check for _, check, _ in FAULTS} == set(CHECKS) - {"reads_within_bounds"}


@pytest.mark.parametrize(("method", "check", "message"), FAULTS)
def test_a_mistake_is_found_and_named(method, check, message):
    found = check_estimator(method, SCENARIO, checks=[check])[check]
    assert message in found
    assert "\n" not in found
    assert failures({check: found})


def test_a_sound_plain_class_passes():
    results = check_estimator(Sound, SCENARIO)
    assert failures(results) == {}
    left = ["reads_within_bounds", "quantiles_in_order", "online_and_batch_agree"]
    assert [name for name, text in results.items() if text != PASSED] == left


QUICK = ("slip_slope", "single_track_kalman_filter")
EVERY = [
    pytest.param(name, marks=() if name in QUICK else pytest.mark.slow)  # each compiles its loops
    for name in built_in_methods()
]


@pytest.mark.parametrize("name", EVERY)
def test_every_built_in_method_passes(name):
    assert failures(check_estimator(name)) == {}


NUMERICAL = [name for name in CHECKS if name.startswith(("survives", "finite", "variance"))]


@pytest.mark.parametrize("name", EVERY)
def test_every_variant_passes_what_its_numbers_decide(name):
    method = built_in_methods()[name]
    found = {
        variant: failures(check_estimator(name, variant=variant, checks=NUMERICAL))
        for variant in method.variants
    }
    assert {variant: failed for variant, failed in found.items() if failed} == {}


class NegativeAtSpeed(Sound):
    def run(self, vehicle, observations):
        import numpy as np

        estimates = np.zeros(
            len(observations), [("force_x_front", float), ("force_x_front_variance", float)]
        )
        estimates["force_x_front_variance"] = 50.0 - observations["speed_gps"]
        return estimates


def test_a_variance_is_looked_at_in_every_scenario():
    check = "variance_not_negative"
    assert check_estimator(NegativeAtSpeed, SCENARIO, checks=[check]) == {check: PASSED}
    found = check_estimator(NegativeAtSpeed, (*SCENARIO, "large_torque"), checks=[check])[check]
    assert "in scenario large_torque" in found


@pytest.mark.slow
def test_a_variant_that_diverges_on_purpose_says_so():
    found = check_estimator("magnetometer_gps_cascade:single_delay", checks=NUMERICAL)
    assert found["variance_not_negative"].startswith(EXPECTED)
    assert failures(found) == {}


def test_an_expected_failure_is_told_with_its_reason():
    class Declared(NegativeVariance):
        expected_failures = {"variance_not_negative": "shows what goes wrong"}

    results = check_estimator(Declared, SCENARIO, checks=["variance_not_negative"])
    assert results["variance_not_negative"] == EXPECTED + "shows what goes wrong"
    assert failures(results) == {}


def test_an_expected_failure_that_passes_is_a_failure():
    class Declared(Sound):
        expected_failures = {"causal": "it is not, really"}

    found = check_estimator(Declared, SCENARIO, checks=["causal"])["causal"]
    assert "remove 'causal' from 'expected_failures'" in found


def test_an_expected_failure_of_no_check_is_a_failure():
    class Declared(Sound):
        expected_failures = {"causl": "misspelt"}

    results = check_estimator(Declared, SCENARIO, checks=["causal"])
    assert "did you mean 'causal'" in results["declares_its_channels"]
    assert results["causal"].startswith(SKIPPED)


def test_an_unknown_check_suggests_the_nearest():
    with pytest.raises(InputError, match="did you mean 'causal'"):
        check_estimator(Sound, checks=["causl"])
