"""The friction filter: the brush tyre against its contact patch, a filterpy twin, convergence."""

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st
from kinematic_drive import VEHICLE
from scipy.integrate import quad

from gripbench.compilation import replacing
from gripbench.envs.vehicles import GRAVITY
from gripbench.methods.friction_ekf import (
    FRICTION_PARAMETERS,
    FRICTION_STATE,
    brush_force,
    friction_predict,
    friction_step,
    friction_update,
    lateral_acceleration,
    slip_angles,
)
from gripbench.methods.printed.yoon2015 import EQ_15


def parameters(**overrides):
    values = {p.name: p.default for p in FRICTION_PARAMETERS} | VEHICLE | overrides
    record = np.zeros(1, [(name, float) for name in values])
    for name, value in values.items():
        record[name] = value
    return record[0]


def contact_patch(slip_angle, mu, load, tread, half_length):
    """Force of bristles of stiffness `tread` [N/m^2] under a parabolic pressure."""

    def bristle(x):  # from the leading edge at +l to the trailing one at -l
        grip = mu * 3.0 * load / (4.0 * half_length) * (1.0 - (x / half_length) ** 2)
        return min(tread * (half_length - x) * np.tan(slip_angle), grip)

    stuck_until = half_length * (4.0 * tread * half_length**2 * np.tan(slip_angle))
    stuck_until = stuck_until / (3.0 * mu * load) - half_length
    edge = [float(np.clip(stuck_until, -half_length, half_length))]
    return quad(bristle, -half_length, half_length, points=edge)[0]


@given(st.floats(0.001, 0.5), st.floats(0.05, 1.0), st.floats(1e3, 8e3), st.floats(0.05, 0.12))
@settings(max_examples=50, deadline=None)
def test_brush_force_is_the_integral_over_the_contact_patch(angle, mu, load, half_length):
    tread = 3e6
    stiffness = 2.0 * tread * half_length**2
    force, _ = brush_force(angle, mu, load, stiffness)
    expected = contact_patch(angle, mu, load, tread, half_length)
    assert force == pytest.approx(expected, rel=1e-6)


@given(st.floats(-0.4, 0.4), st.floats(0.05, 1.2))
@settings(max_examples=50, deadline=None)
def test_brush_force_is_odd_bounded_and_its_slope_right(angle, mu):
    load, stiffness = 6e3, 5e4
    force, slope = brush_force(angle, mu, load, stiffness)
    assert force == -brush_force(-angle, mu, load, stiffness)[0]
    assert abs(force) <= mu * load * (1.0 + 1e-12)
    e = 1e-6
    above = brush_force(angle, mu + e, load, stiffness)[0]
    below = brush_force(angle, mu - e, load, stiffness)[0]
    assert slope == pytest.approx((above - below) / (2.0 * e), rel=1e-4, abs=1e-2)


def test_printed_condition_exceeds_the_friction_to_the_left():
    """At theta sigma = -2 the force of eq. 15 as printed is -2 mu F_z."""
    mu, load, stiffness = 0.3, 5e3, 5e4
    angle = -np.arctan(2.0 * 3.0 * mu * load / stiffness)
    printed = replacing(brush_force, EQ_15, "test")
    assert printed(angle, mu, load, stiffness)[0] == pytest.approx(-2.0 * mu * load)
    assert brush_force(angle, mu, load, stiffness)[0] == pytest.approx(-mu * load)
    assert printed(-angle, mu, load, stiffness)[0] == pytest.approx(mu * load)


def test_slip_angles_agree_with_equation_14_when_small():
    params = parameters()
    front, rear = slip_angles(15.0, 0.15, 0.05, 0.01, params)
    beta = 0.15 / 15.0
    assert front == pytest.approx(0.01 - (beta + 1.573 * 0.05 / 15.0), abs=1e-5)
    assert rear == pytest.approx(-(beta - 2.085 * 0.05 / 15.0), abs=1e-5)


def test_sliding_vehicle_has_all_its_friction():
    accel, slope = lateral_acceleration(0.2, 0.5, 0.5, 0.0, parameters())
    assert accel == pytest.approx(0.2 * GRAVITY)
    assert slope == pytest.approx(GRAVITY)


def test_agrees_with_filterpy():
    params = parameters()
    ours = np.zeros(1, FRICTION_STATE)
    ours["mu"], ours["variance"] = 0.5, 0.09
    twin = ExtendedKalmanFilter(dim_x=1, dim_z=1)
    twin.x, twin.P = np.array([[0.5]]), np.array([[0.09]])
    rng = np.random.default_rng(5)
    dt, variance, used = 0.01, 0.25, 0
    twin.Q = np.array([[params["mu_walk"] ** 2 * dt]])
    twin.R = np.array([[variance]])
    for _ in range(300):
        slips = rng.normal(size=2) * 0.1
        accel = lateral_acceleration(0.3, *slips, 0.02, params)[0] + 0.1 * rng.normal()
        friction_predict(ours[0], dt, params)
        twin.predict()
        if friction_update(ours[0], accel, *slips, 0.02, variance, params):
            used += 1

            def h(x, slips=slips):
                return np.array([[lateral_acceleration(x[0, 0], *slips, 0.02, params)[0]]])

            def jacobian(x, slips=slips):
                return np.array([[lateral_acceleration(x[0, 0], *slips, 0.02, params)[1]]])

            twin.update(np.array([[accel]]), jacobian, h)
        assert ours["mu"][0] == pytest.approx(twin.x[0, 0], rel=1e-9)
        assert ours["variance"][0] == pytest.approx(twin.P[0, 0], rel=1e-9)
    assert 100 < used < 300
    assert ours["mu"][0] == pytest.approx(0.3, abs=0.02)


def weave(mu, amplitude=0.25, duration=8.0):
    """Samples of a vehicle that slides left and right at 13 m/s, forces exactly a brush tyre's."""
    params = parameters()
    samples = []
    for t in np.arange(0.0, duration, 0.01):
        speed_y = 13.0 * np.tan(amplitude * np.sin(1.5 * t))
        motion = (13.0, speed_y, 0.2 * np.cos(1.5 * t), 0.05 * np.sin(1.5 * t))
        slips = slip_angles(*motion, params)
        accel = lateral_acceleration(mu(t), *slips, motion[3], params)[0]
        samples.append((t, *motion, accel))
    return params, samples


def test_finds_the_friction_and_a_jump_of_it():
    params, samples = weave(lambda t: 0.25 if t < 4.0 else 0.15)
    state = np.zeros(1, FRICTION_STATE)
    found = {}
    for sample in samples:
        friction_step(state[0], *sample, params)
        found[round(sample[0], 2)] = state["mu"][0]
        assert state["variance"][0] >= 0.0
    assert found[3.99] == pytest.approx(0.25, rel=0.02)
    assert found[7.99] == pytest.approx(0.15, rel=0.1)


def test_without_excitation_the_friction_stays():
    params, samples = weave(lambda t: 0.25, amplitude=0.0)
    state = np.zeros(1, FRICTION_STATE)
    for t, *motion, _ in samples:
        motion[2:] = [0.0, 0.0]
        friction_step(state[0], t, *motion, 0.3, params)
    assert state["mu"][0] == 0.5
    assert state["taken"][0] == 0


def test_friction_stays_within_its_limits():
    params, samples = weave(lambda t: 0.25)
    state = np.zeros(1, FRICTION_STATE)
    for t, *motion, accel in samples:
        friction_step(state[0], t, *motion, -10.0 * accel, params)
        assert 0.03 <= state["mu"][0] <= 1.2
