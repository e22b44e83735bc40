"""The cascade: on a drive in closed form, online against batch, causal, and its variants."""

import numpy as np
import pytest
from kinematic_drive import VEHICLE, drive

from gripbench.errors import InputError
from gripbench.methods.heading_ekf import HeadingEkf
from gripbench.methods.magnetometer_gps_cascade import MagnetometerGpsCascade


@pytest.fixture(scope="module")
def case():
    obs, truth = drive()
    rng = np.random.default_rng(0)
    for channel, noise in (("accel_x", 0.02), ("accel_y", 0.02), ("yaw_rate", 1.4e-3)):
        obs[channel] += noise * rng.normal(size=len(obs))
    for axis in "xyz":
        obs[f"magnetic_field_{axis}"] += 5e-8 * rng.normal(size=len(obs))
    obs["accel_x"] += 0.15
    obs["accel_y"] -= 0.15
    return obs, truth


def rms(case, variant, name="sideslip"):
    obs, truth = case
    est = MagnetometerGpsCascade(variant).run(VEHICLE, obs)
    after = obs["time"] > 5.0
    return np.sqrt(np.mean((est[name] - truth[name])[after] ** 2))


@pytest.mark.parametrize("variant", ["corrected", "table_1_noise"])
def test_finds_sideslip_and_velocity(case, variant):
    assert np.degrees(rms(case, variant)) < 0.7
    assert rms(case, variant, "speed_x") < 0.1
    assert rms(case, variant, "speed_y") < 0.2


@pytest.mark.parametrize("variant", ["paper", "no_delay_handling", "no_bias_states"])
def test_what_is_left_out_is_missed(case, variant):
    assert rms(case, variant) > 2.0 * rms(case, "table_1_noise")


def test_single_delay_diverges(case):
    assert not rms(case, "single_delay", "speed_y") < 100.0


@pytest.mark.parametrize("method", [MagnetometerGpsCascade("pitch_aware"), HeadingEkf()])
def test_online_equals_batch(case, method):
    obs = case[0][:800]
    batch = method.run(VEHICLE, obs)
    method.reset(VEHICLE, 1.0 / 166.0)
    names = obs.dtype.names
    for row, expected in zip(obs, batch, strict=True):
        estimates = method.update(dict(zip(names, row.item(), strict=True)))
        assert tuple(estimates.values()) == expected.item()


def test_causal_and_variances_are_not_negative(case):
    obs, _ = case
    whole = MagnetometerGpsCascade().run(VEHICLE, obs)
    part = MagnetometerGpsCascade().run(VEHICLE, obs[:1700])
    assert part.tobytes() == whole[:1700].tobytes()
    for name in MagnetometerGpsCascade.variances:
        assert (whole[name + "_variance"] >= 0.0).all()


def test_missing_late_and_repeated_gps(case):
    """A receiver that drops out, then repeats an old sample: the cascade coasts on."""
    obs, truth = case
    dirty = obs.copy()
    gone = (obs["time"] > 10.0) & (obs["time"] < 12.0)
    dirty["velocity_north_new"][gone] = 0.0
    again = np.flatnonzero(obs["velocity_north_new"])[60:63]
    for name in ("velocity_north", "velocity_west", "velocity_up", "gps_time"):
        dirty[name][again] = dirty[name][again[0] - 200]
    est = MagnetometerGpsCascade().run(VEHICLE, dirty)
    assert np.isfinite(est["sideslip"]).all()
    error = np.degrees(np.abs(est["sideslip"] - truth["sideslip"]))
    assert error[obs["time"] > 5.0].max() < 3.0


def test_needs_the_tyres_stiffness():
    vehicle = {name: value for name, value in VEHICLE.items() if "stiffness" not in name}
    with pytest.raises(InputError, match="cornering_stiffness_front"):
        MagnetometerGpsCascade().run(vehicle, drive(duration=1.0)[0])
