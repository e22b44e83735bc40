"""Recursive least squares against its closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from longitudinal_samples import (
    CAR,
    LOAD_FRONT,
    LOAD_REAR,
    recording,
    slip_ratios,
    unequal,
    weighted_least_squares,
)

from gripbench.methods.blocks.axle_friction import forgetting_factor, rls
from gripbench.methods.individual_wheel_acceleration import IndividualWheelAcceleration
from gripbench.methods.slip_slope import SlipSlope


def _run(regressor, output, forgetting, covariance):
    theta, path = 0.0, []
    for phi, y, factor in zip(regressor, output, forgetting, strict=True):
        theta, covariance = rls.py_func(theta, covariance, phi, y, factor)
        path.append(theta)
    return np.array(path)


@given(st.integers(0, 2**32 - 1), st.floats(0.8, 1.0), st.floats(1e-3, 1e3))
def test_recursion_is_weighted_least_squares(seed, forgetting, covariance):
    rng = np.random.default_rng(seed)
    regressor = rng.normal(size=30)
    output = 2.5 * regressor + 0.3 * rng.normal(size=30)
    factors = np.full(30, forgetting)
    expected = weighted_least_squares(regressor, output, factors, covariance)
    np.testing.assert_allclose(_run(regressor, output, factors, covariance), expected, rtol=1e-7)


def test_changing_factors_too():
    rng = np.random.default_rng(2)
    regressor, output, factors = rng.normal(size=25), rng.normal(size=25), rng.uniform(0.7, 1, 25)
    expected = weighted_least_squares(regressor, output, factors, 2.0)
    np.testing.assert_allclose(_run(regressor, output, factors, 2.0), expected, rtol=1e-9)


@given(st.floats(1e-3, 1e3), st.floats(-100.0, 100.0))
def test_scaling(scale, slope):
    """Scaling regressor and output leaves the slope, if P0 is scaled against it."""
    regressor = np.linspace(0.1, 1.0, 20)
    factors = np.full(20, 0.9)
    plain = _run(regressor, slope * regressor, factors, 1.0)
    scaled = _run(scale * regressor, scale * slope * regressor, factors, 1.0 / scale**2)
    np.testing.assert_allclose(scaled, plain, rtol=1e-8, atol=1e-12)


@given(st.floats(-100.0, 100.0))
def test_exact_data_give_the_exact_slope(slope):
    theta = _run(np.ones(200), np.full(200, slope), np.full(200, 0.9), 1.0)
    assert theta[-1] == pytest.approx(slope, rel=1e-6, abs=1e-9)


def test_memory_time_does_not_depend_on_the_spacing():
    params = np.rec.array([(0.5, 0.9)], names="memory_time,forgetting")[0]
    assert forgetting_factor.py_func(params, 1e-3) ** 10 == pytest.approx(
        forgetting_factor.py_func(params, 1e-2)
    )
    params = np.rec.array([(0.0, 0.9)], names="memory_time,forgetting")[0]
    assert forgetting_factor.py_func(params, 1e-3) == 0.9


def _total_force(obs):
    resistance = CAR["rolling_resistance"] * CAR["mass"] * 9.81
    return CAR["mass"] * obs["accel_x"] + resistance + CAR["drag"] * obs["speed_gps"] ** 2


def test_slip_slope_is_least_squares_of_force_on_slip():
    """Method 1 in full: eq. 8 for the force, eq. 5 for the slip, one regression over both axles."""
    obs = unequal(recording("constant_mu", 0.6).observations)
    method = SlipSlope("paper", forgetting=0.98, covariance=1e-3)
    estimates = method.run(CAR, obs)
    front, rear = slip_ratios(obs)
    regressor = LOAD_FRONT * front + LOAD_REAR * rear
    factors = np.full(len(obs), 0.98)
    slope = weighted_least_squares(regressor, _total_force(obs), factors, 1e-3)
    np.testing.assert_allclose(estimates["force_x_front"], 0.5 * _total_force(obs), rtol=1e-12)
    np.testing.assert_allclose(estimates["mu_front"], 0.03 * slope + 0.1, rtol=1e-6)


def test_memory_and_excitation_gate_in_a_method():
    obs = unequal(recording("constant_mu", 0.9).observations)
    estimates = SlipSlope(memory_time=0.2, excitation_force=60.0, tyre_shape=False).run(CAR, obs)
    force = _total_force(obs)
    used = np.abs(0.5 * force) >= 60.0
    front, rear = slip_ratios(obs)
    regressor = (LOAD_FRONT * front + LOAD_REAR * rear)[used]
    factors = np.exp(-np.diff(obs["time"], prepend=obs["time"][0]) / 0.2)[used]
    settings = SlipSlope().settings
    slope = weighted_least_squares(regressor, force[used], factors, settings["covariance"])
    gain = 1.0 / (CAR["magic_b"] * CAR["magic_c"])
    expected = gain * slope + settings["slope_offset"]
    np.testing.assert_allclose(estimates["mu_front"][used], expected, rtol=1e-6)
    assert 0 < used.sum() < len(obs)
    idle = np.flatnonzero(~used)
    idle = idle[idle > 0]
    assert np.array_equal(estimates["mu_front"][idle], estimates["mu_front"][idle - 1])


def test_nonlinear_region_takes_the_force_over_the_load():
    obs = recording("large_torque", 3.0).observations
    method = SlipSlope("nonlinear_region", nonlinear_slip=0.002)
    estimates = method.run(CAR, obs)
    front, rear = slip_ratios(obs)
    weight = LOAD_FRONT + LOAD_REAR
    beyond = np.abs((LOAD_FRONT * front + LOAD_REAR * rear) / weight) > 0.002
    assert 100 < beyond.sum() < len(obs)
    expected = np.abs(_total_force(obs)[beyond]) / weight
    np.testing.assert_allclose(estimates["mu_front"][beyond], expected, rtol=1e-12)


def test_magic_formula_regressor_tells_friction_at_large_slip():
    """The force is linear in D = mu F_z whatever the slip, if the tyre's shape is known."""
    whole = recording("large_torque", 14.0, noise=0.0)
    estimates = SlipSlope("magic_formula").run(CAR, whole.observations)
    linear = SlipSlope().run(CAR, whole.observations)
    late = whole.truth["time"] > 12.0
    assert np.abs(estimates["mu_front"][late] - 0.9).max() < 0.01
    assert np.abs(linear["mu_front"][late] - 0.9).max() > 0.05


def test_method_3_is_eq_22():
    obs = unequal(recording("constant_mu", 0.6).observations)
    estimates = IndividualWheelAcceleration("paper").run(CAR, obs)
    elapsed = np.diff(obs["time"])
    rates = [np.diff(obs[f"wheel_speed_{axle}"]) / elapsed for axle in ("front", "rear")]
    difference = CAR["wheel_inertia"] * (rates[1] - rates[0]) / CAR["wheel_radius"]
    total = _total_force(obs)[1:]
    np.testing.assert_allclose(estimates["force_x_front"][1:], (total + difference) / 2, rtol=1e-9)
    np.testing.assert_allclose(estimates["force_x_rear"][1:], (total - difference) / 2, rtol=1e-9)
    slope = weighted_least_squares(
        LOAD_FRONT * slip_ratios(obs)[0], estimates["force_x_front"], np.full(len(obs), 0.9), 1.0
    )
    np.testing.assert_allclose(estimates["mu_front"], 0.03 * slope + 0.1, rtol=1e-5, atol=1e-7)
