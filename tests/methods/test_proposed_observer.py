"""The proposed observer: eq. 24 against scipy, its error dynamics, the stiffness law."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from longitudinal_samples import CAR, GRAVITY, LOAD_FRONT, LOAD_REAR, recording
from scipy.integrate import solve_ivp

from gripbench.methods.proposed_observer import (
    ProposedObserver,
    adapted_stiffness,
    observed_speed,
)

MASS, RADIUS, INERTIA, DRAG = (
    CAR[name] for name in ("mass", "wheel_radius", "wheel_inertia", "drag")
)
ROLLING = CAR["rolling_resistance"] * GRAVITY


def _params(velocity_gain=8e5, stiffness_gain=8e4, normalised=0.0):
    names = ("mass", "wheel_radius", "wheel_inertia", "drag", "rolling_resistance")
    row = (*(CAR[name] for name in names), velocity_gain, stiffness_gain, normalised)
    return np.rec.array([row], names=[*names, "velocity_gain", "stiffness_gain", "normalised"])[0]


def _balanced_torque(speed, accel_x):
    """Return the torque at which drag, rolling resistance and acceleration balance at a speed."""
    return (accel_x + ROLLING + DRAG * speed**2 / MASS) * MASS * RADIUS


def _slope(v, torque, wheel_acceleration, accel_x, grade, gain):
    """Return v_hat_dot of eq. 24 with the corrected argument of Sat."""
    balance = (torque - INERTIA * wheel_acceleration) / (MASS * RADIUS) - ROLLING
    return (
        accel_x
        + GRAVITY * np.sin(grade)
        + (1.0 + gain) * (balance - DRAG * v * abs(v) / MASS - accel_x)
    )


@pytest.mark.parametrize("gain", [0.0, 100.0, 8e5])
def test_velocity_observer_converges_to_solve_ivp(gain):
    """Backward Euler: order 1 towards the solution of the corrected eq. 24."""
    params = _params(velocity_gain=gain)
    inputs = {"torque": 310.0, "wheel_acceleration": 1.3, "accel_x": 0.4, "grade": 0.02}
    end = 0.5 if gain < 1e3 else 1e-3
    exact = solve_ivp(
        lambda t, v: _slope(v[0], *inputs.values(), gain) * np.ones(1),
        (0.0, end),
        [12.0],
        method="Radau",
        rtol=1e-11,
        atol=1e-12,
    ).y[0, -1]
    errors = []
    for steps in (200, 400):
        v = 12.0
        for _ in range(steps):
            v = observed_speed.py_func(
                v,
                inputs["torque"],
                inputs["wheel_acceleration"],
                inputs["accel_x"],
                inputs["accel_x"],
                inputs["grade"],
                end / steps,
                params,
            )
        errors.append(abs(v - exact))
    assert errors[0] < 0.02 * abs(exact - 12.0) + 1e-9
    assert errors[0] / max(errors[1], 1e-15) == pytest.approx(2.0, rel=0.1)


@given(st.floats(2.0, 40.0), st.floats(-0.5, 1.0), st.floats(-0.1, 0.1))
def test_the_true_speed_is_an_equilibrium(speed, accel_x, elapsed_share):
    """Exact inputs and v_hat = v: the observer follows the vehicle and adds nothing."""
    params = _params()
    elapsed = 1e-3 * (1.0 + elapsed_share)
    after = speed + elapsed * accel_x
    estimate = observed_speed.py_func(
        speed, _balanced_torque(after, accel_x), 0.0, accel_x, accel_x, 0.0, elapsed, params
    )
    assert estimate == pytest.approx(after, abs=1e-9)


@pytest.mark.parametrize("gain", [50.0, 1e4, 8e5])
@pytest.mark.parametrize("speed", [3.0, 10.0, 25.0])
def test_error_dynamics_pole(gain, speed):
    """Only drag makes v_hat converge, with the rate 2 (1 + K_a) D_a v/m."""
    params = _params(velocity_gain=gain)
    pole = 2.0 * (1.0 + gain) * DRAG * speed / MASS
    elapsed = 1e-4 / pole
    error = 1e-4
    estimate = observed_speed.py_func(
        speed + error, _balanced_torque(speed, 0.0), 0.0, 0.0, 0.0, 0.0, elapsed, params
    )
    assert (error - (estimate - speed)) / (error * elapsed) == pytest.approx(pole, rel=1e-3)


@pytest.mark.parametrize("bias", [0.1, -0.2])
def test_accelerometer_bias_shifts_the_square_of_the_speed(bias):
    """v_hat^2 = v^2 - b m/D_a once K_a is large: 311 m^2/s^2 for 0.1 m/s^2."""
    speed = 30.0
    estimate = speed
    for _ in range(3000):
        estimate = observed_speed.py_func(
            estimate, _balanced_torque(speed, 0.0), 0.0, bias, bias, 0.0, 1e-3, _params()
        )
    assert speed**2 - estimate**2 == pytest.approx(bias * MASS / DRAG, rel=1e-4)
    shift = 0.1 * MASS / DRAG
    assert shift == pytest.approx(311.0, abs=0.1)


def test_a_wrong_balance_can_stop_the_estimate_but_not_reverse_it():
    assert observed_speed.py_func(1.0, -1e4, 0.0, 0.0, 0.0, 0.0, 1e-3, _params()) == 0.0
    assert observed_speed.py_func(0.0, 1e3, 0.0, 0.0, 0.0, 0.0, 1e-3, _params()) > 0.0


def _settle(slip, stiffness, steps=4000, **settings):
    params = _params(**settings)
    for _ in range(steps):
        stiffness = adapted_stiffness.py_func(stiffness, slip, 9e4 * slip, 1e-3, params)
    return stiffness


@pytest.mark.parametrize("slip", [0.004, -0.004, 0.05, -0.05])
@pytest.mark.parametrize("normalised", [0.0, 1.0])
def test_stiffness_settles_at_force_over_slip(slip, normalised):
    gain = 140.0 if normalised else 8e4
    found = _settle(slip, 50_000.0, stiffness_gain=gain, normalised=normalised)
    assert found == pytest.approx(9e4, rel=1e-4)


def test_the_printed_law_is_unstable_for_negative_slip():
    """Figure 19, k_dot = -K_e (k s - F): its pole is -K_e s. Ours is -K_e |s|."""
    gain, stiffness, k0 = 50.0, 9e4, 5e4
    for slip in (0.02, -0.02):
        printed = solve_ivp(
            lambda t, k, slip=slip: -gain * (k * slip - stiffness * slip),
            (0.0, 2.0),
            [k0],
            rtol=1e-10,
        ).y[0, -1]
        growth = (printed - stiffness) / (k0 - stiffness)
        assert growth == pytest.approx(np.exp(-gain * slip * 2.0), rel=1e-4)
        ours = _settle(slip, k0, 2000, stiffness_gain=gain)
        assert (ours - stiffness) / (k0 - stiffness) == pytest.approx(
            np.exp(-gain * 0.02 * 2.0), rel=2e-3
        )


@pytest.mark.parametrize("slip", [0.002, 0.02, -0.02])
def test_normalised_law_settles_at_its_gain_whatever_the_slip(slip):
    k = _settle(slip, 5e4, 500, stiffness_gain=4.0, normalised=1.0)
    assert (k - 9e4) / (5e4 - 9e4) == pytest.approx(np.exp(-4.0 * 0.5), rel=2e-2)


@given(
    st.floats(-1.0, 1.0),
    st.floats(-2e4, 2e4),
    st.floats(1e3, 1e6),
    st.floats(0.0, 0.1),
    st.sampled_from([0.0, 1.0]),
)
def test_stiffness_never_overshoots(slip, force, stiffness, elapsed, normalised):
    """A step moves k towards F/s and stops there at the latest, for any gain and length."""
    after = adapted_stiffness.py_func(
        stiffness, slip, force, elapsed, _params(normalised=normalised)
    )
    assert np.isfinite(after)
    if abs(slip) > 1e-3:
        low, high = sorted((stiffness, force / slip))
        assert low - 1e-6 * abs(low) - 1e-3 <= after <= high + 1e-6 * abs(high) + 1e-3


def test_no_slip_no_news_for_the_normalised_law():
    after = adapted_stiffness.py_func(5e4, 0.0, 500.0, 1e-3, _params(normalised=1.0))
    assert after == 5e4


@pytest.mark.parametrize("name", ["constant_mu", "gradient"])
def test_idealised_observer_follows_speed_and_force(name):
    """Clean world, the model's own wheel accelerations: velocity and force come out."""
    run = recording(name, 6.0, noise=0.0)
    estimates = ProposedObserver("idealised").run(CAR, run.observations)
    late = run.truth["time"] > 2.0
    assert np.abs(estimates["speed_x"] - run.truth["speed_x"])[late].max() < 2e-3
    force = estimates["force_x_front"] + estimates["force_x_rear"]
    truth = run.truth["force_x_front"] + run.truth["force_x_rear"]
    assert np.sqrt(np.mean((force - truth)[late] ** 2)) < 5.0


def test_rear_force_is_the_front_one_by_load():
    run = recording("constant_mu", 3.0)
    method = ProposedObserver("paper")
    estimates = method.run(CAR, run.observations)
    v = estimates["speed_x"]
    slips = []
    for axle in ("front", "rear"):
        rolling = RADIUS * run.observations[f"wheel_speed_{axle}"]
        slips.append((rolling - v) / np.maximum(np.maximum(rolling, v), 0.1))
    front = estimates["force_x_front"] * slips[1] * LOAD_REAR
    rear = estimates["force_x_rear"] * slips[0] * LOAD_FRONT
    np.testing.assert_allclose(rear, front, rtol=1e-9, atol=1e-12)
    assert np.abs(front).max() > 0.0


def test_noise_remark_takes_the_slip_from_gps():
    run = recording("li2014_noisy_acceleration", 3.0)
    method = ProposedObserver("paper_noise")
    assert "speed_gps" in method.sensors
    first = method.run(CAR, run.observations)
    spoilt = run.observations.copy()
    spoilt["speed_gps"] += 0.5
    assert not np.array_equal(method.run(CAR, spoilt)["mu_front"], first["mu_front"])
    plain = ProposedObserver("paper")
    assert np.array_equal(
        plain.run(CAR, spoilt)["mu_front"], plain.run(CAR, run.observations)["mu_front"]
    )
