"""The heading filter: rotations against scipy, a filterpy twin, the gate, the errata."""

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st
from kinematic_drive import FIELD, VEHICLE, drive
from scipy.spatial.transform import Rotation

from gripbench.compilation import replacing
from gripbench.methods.heading_ekf import (
    HeadingEkf,
    field_in_vehicle,
    heading_predict,
    heading_step,
    heading_update_field,
    wrapped,
)
from gripbench.methods.printed.yoon2015 import EQ_6

angles = st.floats(-3.0, 3.0)
tilts = st.floats(-0.5, 0.5)


@given(angles, tilts, tilts)
@settings(max_examples=50, deadline=None)
def test_field_is_the_rotation_of_the_earths_field(yaw, roll, pitch):
    turned = Rotation.from_euler("ZYX", [yaw, pitch, roll]).inv().apply([FIELD[0], 0.0, FIELD[1]])
    ours = field_in_vehicle(yaw, roll, pitch, *FIELD)
    np.testing.assert_allclose(ours, turned, rtol=1e-12, atol=1e-19)


def test_printed_field_has_the_wrong_length():
    """A rotation keeps the length of the field; eq. 6 as printed does not."""
    right = np.linalg.norm(field_in_vehicle(1.0, 0.0, 0.0, *FIELD))
    printed_field = replacing(field_in_vehicle, EQ_6, "test")
    printed = np.linalg.norm(printed_field(1.0, 0.0, 0.0, *FIELD))
    assert right == pytest.approx(np.hypot(*FIELD), rel=1e-12)
    assert abs(printed / right - 1.0) > 0.1


def _records(method):
    records = method._fresh({"roll_gradient": 0.01}, 1)
    return records.state["heading"], records.params


def test_predict_and_update_agree_with_filterpy():
    """The twin takes the Jacobian by central differences of the measurement model."""
    method = HeadingEkf(gate=1e300)
    heading, params = _records(method)
    twin = ExtendedKalmanFilter(dim_x=2, dim_z=3)
    twin.x = np.array([0.4, 0.01])
    twin.P = np.array([[0.01, 0.001], [0.001, 0.002]])
    heading["filter"]["x"][0] = twin.x
    heading["filter"]["P"][0] = twin.P
    rng = np.random.default_rng(1)
    settings_ = method.settings
    yaw_walk, roll_std = settings_["yaw_walk"], settings_["roll_std"]
    micro = 1e6  # the twin counts in microtesla, which conditions its inverse

    def h(x, pitch=0.0):
        return micro * np.array(field_in_vehicle(x[0], x[1], pitch, *FIELD))

    def slope(f, x, i):  # five-point stencil: exact to 1e-11 for these sines
        e = 2e-3 * np.eye(len(x))[i]
        return (8 * (f(x + e) - f(x - e)) - (f(x + 2 * e) - f(x - 2 * e))) / (12 * 2e-3)

    def jacobian(x):
        return np.column_stack([slope(h, x, 0), slope(h, x, 1)])

    dt = 0.01
    decay = np.exp(-dt / settings_["roll_time"])
    for _ in range(100):
        yaw_rate, roll_rate = rng.normal(size=2) * 0.2
        accel_y = rng.normal()
        field = np.array(field_in_vehicle(*(twin.x + rng.normal(size=2) * 0.01), 0.0, *FIELD))
        field += rng.normal(size=3) * 2e-7
        roll = twin.x[1]
        twin.F = np.array([[1.0, dt * yaw_rate * np.sin(roll) / np.cos(roll) ** 2], [0.0, decay]])
        twin.x = np.array(
            [
                twin.x[0] + dt * yaw_rate / np.cos(roll),
                decay * roll + (1.0 - decay) * 0.01 * accel_y + dt * roll_rate,
            ]
        )
        twin.Q = np.diag([yaw_walk**2 * dt, roll_std**2 * (1.0 - decay**2)])
        twin.P = twin.F @ twin.P @ twin.F.T + twin.Q
        by_pitch = slope(lambda p: h(twin.x, p[0]), np.zeros(1), 0)
        twin.R = np.eye(3) * (micro * settings_["magnetometer_std"]) ** 2
        twin.R += settings_["pitch_std"] ** 2 * np.outer(by_pitch, by_pitch)
        twin.update(micro * field, jacobian, h)
        heading_predict(heading[0], yaw_rate, roll_rate, accel_y, dt, params[0])
        assert heading_update_field(heading[0], *field, params[0])
        np.testing.assert_allclose(heading["filter"]["x"][0], twin.x, rtol=0, atol=1e-9)
        np.testing.assert_allclose(heading["filter"]["P"][0], twin.P, rtol=0, atol=1e-9)


def test_the_first_covariance_is_that_of_the_first_errors():
    """An unknown roll tilts the steep field: it errs in yaw and roll together."""
    method = HeadingEkf(alignment_time=0.0)
    set_ = method.settings
    rng = np.random.default_rng(2)
    sample = drive(duration=0.1)[0][:1].copy()
    errors = []
    for _ in range(2000):
        roll = set_["roll_std"] * rng.normal()
        pitch = set_["alignment_pitch_std"] * rng.normal()
        field = np.array(field_in_vehicle(0.7, roll, pitch, *FIELD))
        field += set_["magnetometer_std"] * rng.normal(size=3)
        for axis, value in zip("xyz", field, strict=True):
            sample[f"magnetic_field_{axis}"] = value
        heading, params = _records(method)
        heading_step(heading[0], sample[0], params[0])
        errors.append(heading["filter"]["x"][0] - [0.7 + set_["declination"], roll])
    spread = np.cov(np.transpose(errors))
    stated = heading["filter"]["P"][0]
    np.testing.assert_allclose(np.diag(stated), np.diag(spread), rtol=0.15)
    assert stated[0, 1] == pytest.approx(spread[0, 1], rel=0.15)
    assert abs(spread[0, 1]) > 0.2 * np.sqrt(spread[0, 0] * spread[1, 1])


def test_follows_a_weaving_drive():
    obs, truth = drive(delay=0.0)
    est = HeadingEkf("table_1_noise").run(VEHICLE, obs)
    after = obs["time"] > 3.0
    assert np.degrees(np.abs(wrapped(est["yaw"] - truth["yaw"])))[after].max() < 0.1
    assert np.degrees(np.abs(est["roll"] - truth["roll"]))[after].max() < 0.1
    assert (est["yaw_variance"] >= 0.0).all()
    assert (est["roll_variance"] >= 0.0).all()


@pytest.mark.parametrize("yaw_start", np.linspace(-3.0, 3.0, 5))
def test_every_heading_is_as_good(yaw_start):
    obs, truth = drive(yaw_start=yaw_start)
    est = HeadingEkf().run(VEHICLE, obs)
    after = obs["time"] > 3.0
    error = np.degrees([wrapped(e) for e in est["yaw"] - truth["yaw"]])[after]
    assert np.sqrt(np.mean(error**2)) < 1.5


def _passing_lorry(obs, size=8e-6):
    pulse = size * np.exp(-(((obs["time"] - 10.0) / 0.3) ** 2))
    disturbed = obs.copy()
    disturbed["magnetic_field_y"] += pulse
    disturbed["magnetic_field_z"] -= 0.5 * pulse
    return disturbed


def test_gate_rejects_a_passing_lorry():
    """The change of the heading by the pulse, with the gate and without."""
    obs, _ = drive(roll_size=0.0)
    clean = HeadingEkf().run(VEHICLE, obs)["yaw"]
    gated = HeadingEkf().run(VEHICLE, _passing_lorry(obs))["yaw"]
    open_gate = HeadingEkf("no_rejection").run(VEHICLE, _passing_lorry(obs))["yaw"]
    assert np.degrees(np.abs(gated - clean).max()) < 2.0
    assert np.abs(open_gate - clean).max() > 2.0 * np.abs(gated - clean).max()


def test_a_measurement_that_is_not_a_number_is_rejected():
    obs, _ = drive()
    obs["magnetic_field_x"][1000] = np.nan
    est = HeadingEkf().run(VEHICLE, obs)
    assert np.isfinite(est["yaw"]).all()


def test_printed_equation_6_rejects_nearly_everything():
    obs, _ = drive()

    def rejected(variant):
        method = HeadingEkf(variant)
        method.reset(VEHICLE, 0.01)
        for row in obs[:1500]:
            method.update(dict(zip(obs.dtype.names, row.item(), strict=True)))
        heading = method._records.state["heading"]
        return heading["rejected"][0] / (heading["rejected"][0] + heading["taken"][0])

    assert rejected("paper") > 0.9
    assert rejected("table_1_noise") < 0.05


def _climb(grade):
    obs, truth = drive(roll_size=0.0)
    pitch = grade * np.sin(0.5 * obs["time"])
    field = (
        Rotation.from_euler("ZYX", np.column_stack([truth["yaw"], pitch, np.zeros(len(pitch))]))
        .inv()
        .apply([FIELD[0], 0.0, FIELD[1]])
    )
    for axis, column in zip("xyz", field.T, strict=True):
        obs[f"magnetic_field_{axis}"] = column
    obs["pitch_rate"] = 0.5 * grade * np.cos(0.5 * obs["time"])
    true_at = obs["gps_time"]
    level = np.hypot(obs["velocity_north"], obs["velocity_west"])
    obs["velocity_up"] = -level * np.tan(grade * np.sin(0.5 * true_at))
    obs["accel_y"] = 0.0  # an accelerometer that contradicts nothing: no roll, no curve
    return obs, truth


def test_pitch_aware_variant_follows_the_grade():
    obs, truth = _climb(np.radians(3.0))
    after = obs["time"] > 3.0

    def rms(variant, **overrides):
        est = HeadingEkf(variant, **overrides).run(VEHICLE, obs)
        error = np.array([wrapped(e) for e in est["yaw"] - truth["yaw"]])[after]
        return np.degrees(np.sqrt(np.mean(error**2)))

    aware = rms("pitch_aware", accelerometer_roll_std=0.0)
    assert aware < 0.4
    assert rms("table_1_noise", gate=1e300) > 4.0 * aware
