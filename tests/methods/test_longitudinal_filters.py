"""Observer of eq. 21 against scipy, extended Kalman filter against filterpy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from longitudinal_samples import (
    CAR,
    EACH_VARIANT,
    LOAD_FRONT,
    METHODS,
    recording,
    slip_ratios,
    unequal,
    weighted_least_squares,
)
from longitudinal_twins import FilterpyTwin
from scipy.linalg import expm
from scipy.signal import lsim

from gripbench.envs.signals import record_type
from gripbench.methods.extended_kalman_filter import ExtendedKalmanFilter
from gripbench.methods.individual_wheel_torque import IndividualWheelTorque, observer

RADIUS, INERTIA = CAR["wheel_radius"], CAR["wheel_inertia"]


def _params(wheel_gain=210.0, force_gain=15000.0):
    return np.rec.array(
        [(RADIUS, INERTIA, wheel_gain, force_gain)],
        names="wheel_radius,wheel_inertia,wheel_gain,force_gain",
    )[0]


def _system(params):
    """Return A and B of eq. 21 with the inputs measured wheel speed and torque."""
    damping = params.wheel_gain / INERTIA
    A = np.array([[-damping, -RADIUS / INERTIA], [params.force_gain, 0.0]])
    return A, np.array([[damping, 1.0 / INERTIA], [-params.force_gain, 0.0]])


def _trapezoid(times, measured, torque, params):
    w, force, path = measured[0], 0.0, [(measured[0], 0.0)]
    for k in range(1, len(times)):
        w, force = observer.py_func(
            w,
            force,
            0.5 * (measured[k - 1] + measured[k]),
            0.5 * (torque[k - 1] + torque[k]),
            times[k] - times[k - 1],
            params,
        )
        path.append((w, force))
    return np.array(path)


def test_wheel_observer_converges_to_lsim_with_order_2():
    params = _params()
    A, B = _system(params)
    errors = []
    for dt in (2e-3, 1e-3, 5e-4):
        times = np.arange(0.0, 1.0 + dt / 2, dt)
        measured, torque = 30.0 + 5.0 * np.sin(7.0 * times), 200.0 * np.cos(3.0 * times)
        inputs = np.column_stack([measured, torque])
        exact = lsim((A, B, np.eye(2), np.zeros((2, 2))), inputs, times, X0=[measured[0], 0.0])[1]
        errors.append(np.abs(_trapezoid(times, measured, torque, params) - exact).max(axis=0))
    errors = np.array(errors)
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 2.0, atol=0.1)
    assert errors[1, 1] < 2.0  # N, of some hundreds


def test_wheel_observer_step_is_the_pade_of_the_matrix_exponential():
    """Constant inputs: the trapezoid approaches x_e + expm(A h) (x - x_e)."""
    params = _params()
    A, B = _system(params)
    inputs, x = np.array([20.0, 150.0]), np.array([21.0, 300.0])
    rest = -np.linalg.solve(A, B @ inputs)
    h = 1e-4
    exact = rest + expm(A * h) @ (x - rest)
    step = observer.py_func(*x, *inputs, h, params)
    np.testing.assert_allclose(step, exact, rtol=1e-6)
    np.testing.assert_allclose(rest, [20.0, 150.0 / RADIUS], rtol=1e-12)  # eq. 21 at rest: R F = T


@given(
    st.floats(1e-4, 10.0),
    st.floats(0.0, 1e4),
    st.floats(1.0, 1e6),
    st.floats(-1e3, 1e3),
    st.floats(-1e4, 1e4),
)
def test_wheel_observer_is_stable_for_every_gain_and_step(elapsed, gain, force_gain, w, force):
    """In its own energy, I w^2 + (R/eta) F^2, the step without inputs never grows."""
    after = observer.py_func(w, force, 0.0, 0.0, elapsed, _params(gain, force_gain))

    def energy(x):
        return INERTIA * x[0] ** 2 + RADIUS / force_gain * x[1] ** 2

    assert energy(after) <= energy((w, force)) * (1.0 + 1e-6) + 1e-9


def test_wheel_observer_finds_the_force_of_the_plant():
    """Constant torque: after a second the estimate is the plant's force, without a_x or GPS."""
    run = recording("constant_mu", 6.0, noise=0.0)
    estimates = IndividualWheelTorque().run(CAR, run.observations)
    late = run.truth["time"] > 3.0
    for axle in ("front", "rear"):
        error = (estimates[f"force_x_{axle}"] - run.truth[f"force_x_{axle}"])[late]
        assert np.abs(error).max() < 1.0


def test_wheel_observer_in_the_method_is_the_observer():
    obs = unequal(recording("combined_traction_braking", 1.5).observations)
    method = IndividualWheelTorque("paper")
    estimates = method.run(CAR, obs)
    params = _params(method.settings["wheel_gain"], method.settings["force_gain"])
    path = _trapezoid(obs["time"], obs["wheel_speed_front"], obs["torque_front"], params)
    np.testing.assert_allclose(estimates["force_x_front"], path[:, 1], rtol=1e-9, atol=1e-9)
    slope = weighted_least_squares(
        LOAD_FRONT * slip_ratios(obs)[0], path[:, 1], np.full(len(obs), 0.9), 1.0
    )
    np.testing.assert_allclose(estimates["mu_front"], 0.03 * slope + 0.1, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("name", ["noisy_acceleration", "combined_traction_braking"])
def test_kalman_filter_agrees_with_filterpy(name):
    obs = unequal(recording(name, 1.5).observations)
    method, twin = ExtendedKalmanFilter(), FilterpyTwin()
    estimates = method.run(CAR, obs)
    twin.reset(CAR, 1e-3)
    names = obs.dtype.names
    for k, row in enumerate(obs):
        expected = twin.update(dict(zip(names, row.item(), strict=True)))
        for key, value in expected.items():
            assert estimates[key][k] == pytest.approx(value, rel=1e-9, abs=1e-7)
    P = twin.filter.P
    assert estimates["force_x_front_variance"][-1] == pytest.approx(P[3, 3], rel=1e-9)
    assert estimates["force_x_rear_variance"][-1] == pytest.approx(P[4, 4], rel=1e-9)


def test_printed_filter_is_fed_the_rate_of_change_of_speed():
    obs = recording("gradient", 1.0).observations
    printed = ExtendedKalmanFilter("paper")
    assert "accel_x" not in printed.sensors
    twin = FilterpyTwin(variant="paper")
    twin.reset(CAR, 1e-3)
    names = obs.dtype.names
    for row in obs:
        sample = dict(zip(names, row.item(), strict=True))
        last = twin.update(sample | {"accel_x": sample["speed_x_rate"]})
    estimate = printed.run(CAR, obs)["force_x_front"][-1]
    assert estimate == pytest.approx(last["force_x_front"], rel=1e-9)


def test_variance_covers_the_error():
    """With an unbiased accelerometer, the force error stays within three deviations."""
    run = recording("constant_mu", 3.0)
    estimates = ExtendedKalmanFilter().run(CAR, run.observations)
    error = estimates["force_x_front"] - run.truth["force_x_front"]
    inside = np.abs(error) < 3.0 * np.sqrt(estimates["force_x_front_variance"])
    assert inside.mean() > 0.9


CHANNELS = (
    "time",
    "wheel_speed_front",
    "wheel_speed_rear",
    "torque_front",
    "torque_rear",
    "accel_x",
    "speed_gps",
    "road_grade",
    "speed_x_rate",
    "wheel_acceleration_front",
    "wheel_acceleration_rear",
)
SPEEDS = ("wheel_speed_front", "wheel_speed_rear", "speed_gps")


@pytest.mark.parametrize(("kind", "variant"), EACH_VARIANT)
@given(seed=st.integers(0, 2**32 - 1), size=st.sampled_from([0.0, 1e-9, 1.0, 1e4]))
def test_estimates_stay_finite(kind, variant, seed, size):
    """Whatever finite numbers the sensors give, standstill and reversed wheels included."""
    rng = np.random.default_rng(seed)
    obs = np.zeros(200, record_type(CHANNELS))
    for name in CHANNELS[1:]:
        obs[name] = size * rng.normal(size=200)
    obs["road_grade"] = np.clip(obs["road_grade"], -0.5, 0.5)
    obs["speed_gps"] = np.abs(obs["speed_gps"])
    obs["time"] = np.cumsum(rng.uniform(0.0, 0.1, 200))
    estimates = kind(variant).run(CAR, obs)
    for name in estimates.dtype.names:
        assert np.isfinite(estimates[name]).all()


@pytest.mark.parametrize(("kind", "variant"), EACH_VARIANT)
def test_a_long_stop_leaves_the_estimates_finite(kind, variant):
    """Nothing excites the regression for ten seconds; its covariance must not overflow."""
    obs = np.zeros(10_000, record_type(CHANNELS))
    obs["time"] = np.arange(10_000) * 1e-3
    estimates = kind(variant).run(CAR, obs)
    for name in estimates.dtype.names:
        assert np.isfinite(estimates[name]).all()


SCALED_WITH_MASS = {
    "wheel_gain": 1,
    "force_gain": 1,
    "excitation_force": 1,
    "covariance": -2,
    "force_density": 2,
    "force_variance": 2,
}


@pytest.mark.parametrize("kind", METHODS)
@pytest.mark.parametrize("variant", ["corrected", "paper"])
@pytest.mark.parametrize("factor", [0.01, 30.0])
def test_a_heavier_vehicle_has_heavier_forces_and_the_same_friction(kind, variant, factor):
    """Scale mass, inertia, drag, torques and gains alike: the same motion, the same friction."""
    obs = recording("noisy_acceleration", 1.5).observations
    plain = kind(variant)
    gains = {
        name: plain.settings[name] * factor**power
        for name, power in SCALED_WITH_MASS.items()
        if name in plain.settings
    }
    car = dict(CAR)
    for name in ("mass", "wheel_inertia", "drag", "longitudinal_stiffness"):
        car[name] *= factor
    heavy = obs.copy()
    heavy["torque_front"] *= factor
    heavy["torque_rear"] *= factor
    expected, scaled = plain.run(CAR, obs), kind(variant, **gains).run(car, heavy)
    for name in plain.estimates:
        power = factor if name.startswith("force") else 1.0
        np.testing.assert_allclose(scaled[name], power * expected[name], rtol=1e-6, atol=1e-6)
