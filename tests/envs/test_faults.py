"""Faults of instruments: what each does to a reading, pairing, Gymnasium, names, bad input."""

import gymnasium
import numpy as np
import pytest

from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.envs.gym.environment import VehicleEnvironment
from gripbench.envs.gym.vector_environment import VehicleVectorEnvironment
from gripbench.envs.instruments.fault_injection import Faults
from gripbench.envs.instruments.faults import (
    choose_fault,
    fault_files,
    load_fault,
    split_faults,
)
from gripbench.envs.signals import record_type
from gripbench.envs.worlds import load_scenario, record
from gripbench.errors import InputError

STEP, HORIZON = 0.01, 20.0
PLAIN = record_type(("time", "yaw_rate"))
HELD = record_type(("time", "yaw_rate", "yaw_rate_new"))


def ramp(kind=PLAIN):
    """Return observations whose yaw rate is their time; new at every fifth where it is held."""
    given = np.zeros(round(HORIZON / STEP) + 1, kind)
    given["time"] = given["yaw_rate"] = np.arange(len(given)) * STEP
    if kind is HELD:
        fresh = np.arange(len(given)) % 5 == 0
        given["yaw_rate_new"] = fresh
        given["yaw_rate"] = given["time"][np.arange(len(given)) // 5 * 5]
    return given


def faulty(name, kind=PLAIN, seed=0, pieces=1):
    found = ramp(kind)
    faults = Faults([choose_fault(name)], kind, STEP, HORIZON, seed)
    for part in np.array_split(found, pieces):
        faults.apply(part)
    inside = (ramp()["time"] >= faults.window[0]) & (ramp()["time"] < faults.window[1])
    return found, inside, faults.window


@pytest.mark.parametrize("name", fault_files())
@pytest.mark.parametrize("kind", [PLAIN, HELD])
def test_sample_by_sample_is_as_in_one_call_and_outside_nothing_happens(name, kind):
    fault = load_fault(name)
    if fault.kind not in ("jitter", "disorder") and not fault.acts_on(kind.names):
        pytest.skip("acts on other channels")
    for severity in (1, 5):
        whole, inside, _ = faulty(f"{name}:{severity}", kind)
        single, *_ = faulty(f"{name}:{severity}", kind, pieces=len(whole))
        assert whole.tobytes() == single.tobytes()
        before = slice(0, int(inside.argmax()))
        assert whole[before].tobytes() == ramp(kind)[before].tobytes()
        assert whole[-200:].tobytes() == ramp(kind)[-200:].tobytes()
    assert faulty(f"{name}:5", kind)[0].tobytes() != ramp(kind).tobytes()


def test_dropout_loses_the_share_that_it_says():
    shares = [np.isnan(faulty("dropout:4", seed=seed)[0]["yaw_rate"]) for seed in range(30)]
    inside = faulty("dropout:4")[1].mean()
    assert np.mean(shares) / inside == pytest.approx(0.3, abs=0.04)


def test_what_is_lost_of_a_held_channel_is_not_new():
    found, inside, _ = faulty("dropout:5", HELD)
    assert np.isfinite(found["yaw_rate"]).all()
    assert found["yaw_rate_new"][inside].mean() < 0.6 * ramp(HELD)["yaw_rate_new"][inside].mean()


def test_a_frozen_reading_stays():
    found, inside, window = faulty("freeze:4")
    assert window[1] - window[0] == pytest.approx(2.0)
    assert len(np.unique(found["yaw_rate"][inside])) == 1


def test_bias_and_drift_have_the_sizes_of_their_files():
    found, inside, window = faulty("bias_step:3")
    error = found["yaw_rate"] - ramp()["yaw_rate"]
    assert np.abs(error[inside]) == pytest.approx(8.73e-3)
    found, inside, window = faulty("drift:3")
    error = np.abs(found["yaw_rate"] - ramp()["yaw_rate"])
    assert error[inside] == pytest.approx(1.75e-3 * (ramp()["time"][inside] - window[0]))


def test_a_late_reading_is_an_earlier_one():
    found, inside, _ = faulty("delay:5")
    assert found["yaw_rate"][inside] == pytest.approx(ramp()["yaw_rate"][inside] - 0.4)


def test_saturation_and_quantisation():
    found, inside, _ = faulty("saturation:2")
    assert found["yaw_rate"][inside].max() == pytest.approx(1.745)
    found, inside, _ = faulty("quantisation:5")
    step = choose_fault("quantisation:5").strength.size["rad/s"]
    assert np.abs(found["yaw_rate"] - ramp()["yaw_rate"])[inside].max() <= 0.5 * step + 1e-9
    assert found["yaw_rate"][inside] / step == pytest.approx(
        np.round(found["yaw_rate"][inside] / step)
    )


def test_spikes_come_as_often_as_they_say():
    found = [faulty("spikes:5", seed=seed) for seed in range(20)]
    count = [np.sum(np.abs(each["yaw_rate"] - ramp()["yaw_rate"]) > 1.0) for each, _, _ in found]
    assert np.mean(count) == pytest.approx(5.0 * 0.3 * HORIZON, rel=0.15)


def test_samples_overtake_and_none_is_invented():
    found, inside, _ = faulty("out_of_order:5")
    steps = np.diff(found["time"][inside])
    assert (steps < 0.0).any()
    assert (found["time"] == found["yaw_rate"]).all()  # a sample stays whole


def test_clock_jitter_changes_time_alone():
    found, inside, _ = faulty("clock_jitter:3")
    assert np.std((found["time"] - ramp()["time"])[inside]) == pytest.approx(2e-3, rel=0.15)
    assert (found["yaw_rate"] == ramp()["yaw_rate"]).all()


def test_faults_compose_in_their_order():
    chosen = [choose_fault("bias_step:5"), choose_fault("freeze:5")]
    found = ramp()
    faults = Faults(chosen, PLAIN, STEP, HORIZON, 0)
    faults.apply(found)
    inside = (ramp()["time"] >= faults.window[0]) & (ramp()["time"] < faults.window[0] + 5.0)
    assert len(np.unique(found["yaw_rate"][inside])) == 1


@pytest.mark.parametrize("name", ["slalom_snow@1", "split_mu_braking"])
def test_a_faulty_run_and_its_clean_twin_differ_by_the_fault_alone(name):
    clean = record(find_scenario(name), 2)
    run = record(find_scenario(f"{name}+bias_step:3:yaw_rate"), 2)
    assert run.truth.tobytes() == clean.truth.tobytes()
    assert run.clean.tobytes() == clean.observations.tobytes()
    for channel in clean.observations.dtype.names:
        same = np.array_equal(run.observations[channel], clean.observations[channel])
        assert same == (channel != "yaw_rate")


def test_a_wheel_sensor_is_lost_on_one_wheel_only():
    run = record(find_scenario("split_mu_braking+wheel_sensor:5"), 0)
    changed = [n for n in run.clean.dtype.names if (run.observations[n] != run.clean[n]).any()]
    assert changed == ["wheel_speed_front_left"]
    assert record(find_scenario("friction_step+wheel_sensor:5"), 0).notes["fault_begin"] > 0.0


def test_environments_have_the_faults_of_the_recording():
    name = "split_mu_braking@1+freeze:5+out_of_order:5"
    recording = record(load_scenario(name), 5)
    environment = VehicleEnvironment(name)
    lanes = VehicleVectorEnvironment(2, name)
    observation, _ = environment.reset(seed=5)
    together, _ = lanes.reset(seed=4)
    for row in recording.observations[:700]:
        assert tuple(map(float, observation.values())) == row.item()
        assert tuple(value[1] for value in together.values()) == row.item()
        observation, *_ = environment.step(environment.driver_action())
        together, *_ = lanes.step(lanes.driver_actions())


def test_a_registered_environment_takes_a_faulty_scenario():
    made = gymnasium.make("gripbench/SlalomSnow-v0", scenario="slalom_snow+gps_outage:2")
    assert made.unwrapped.scenario.faults == ("gps_outage:2",)


def test_names_split_and_levels_keep_faults():
    assert split_faults("a/b+c.toml") == ("a/b+c.toml", ())
    scenario = find_scenario("slalom_snow@1+dropout:3+freeze:1:yaw_rate")
    assert scenario.name == "slalom_snow@1+dropout:3+freeze:1:yaw_rate"
    assert scenario.faults == ("dropout:3", "freeze:1:yaw_rate")
    assert find_scenario("slalom_snow+dropout:3").level == 0


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("slalom_snow+dropuot:3", "did you mean 'dropout'"),
        ("slalom_snow+dropout:6", "severity from 1 to 5"),
        ("slalom_snow+dropout:0", "severity from 1 to 5"),
        ("slalom_snow+dropout", "severity from 1 to 5"),
        ("friction_step+magnetic_disturbance:3", "give none of magnetometer"),
        ("friction_step+freeze:3:yaw_rate", "give no 'yaw_rate'"),
        ("slalom_snow+freeze:3:yaw_rat", "yaw_rate"),
        ("slalom_snow+bias_step:3:steer_angle", "no size in rad"),
        ("slalom_snow+clock_jitter:3:yaw_rate", "acts on the clock"),
        ("li2014_constant_mu+dropout:3", "equally spaced"),
        ("slalom_sno+dropout:3", "did you mean 'slalom_snow'"),
    ],
)
def test_bad_names_are_refused(name, said):
    with pytest.raises(InputError, match=said):
        find_scenario(name)


@pytest.mark.parametrize("name", fault_files())
def test_every_severity_has_a_source(name):
    for severity in load_fault(name).severities:
        assert len(severity.source) > 10
