"""The plant against an independent implementation, finite differences and conservation laws."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from longitudinal_drive import GRAVITY, clean, custom, printed_derivatives

from gripbench.envs.plants.longitudinal.plant import (
    HOLD_SPEED,
    INPUT_TYPE,
    PLANT_PARAMETERS,
    TYRE_TYPE,
    derivatives,
    evaluate_tyres,
    jacobian,
    plant_record,
)
from gripbench.envs.vehicles import load_vehicle
from gripbench.envs.worlds import record
from gripbench.errors import InputError

CAR = load_vehicle("li2014").values()
PLANT = plant_record(CAR)
RADIUS = CAR["wheel_radius"]

moving = st.floats(0.5, 50.0)
slipping = st.floats(0.8, 1.25)
torque = st.floats(-500.0, 2500.0)
friction = st.floats(0.05, 1.2)
grade = st.floats(-0.2, 0.2)


def _inputs(torques, mu, grade):
    inputs = np.zeros(1, INPUT_TYPE)
    inputs[0] = (*torques, *mu, grade, 0.0)
    return inputs[0]


def _derivatives(x, inputs):
    dx = np.zeros(3)
    derivatives(x, inputs, PLANT[0], dx)
    return dx


@given(moving, slipping, slipping, torque, torque, friction, friction, grade)
def test_derivatives_are_the_printed_equations(v, front, rear, tf, tr, mf, mr, theta):
    x = np.array([v, front * v / RADIUS, rear * v / RADIUS])
    expected, _ = printed_derivatives(x, (tf, tr), (mf, mr), theta, CAR)
    given_ = _derivatives(x, _inputs((tf, tr), (mf, mr), theta))
    np.testing.assert_allclose(given_, expected, rtol=1e-11, atol=1e-9)


@given(moving, slipping, slipping, torque, torque, friction, grade)
def test_power_balance(v, front, rear, tf, tr, mu, theta):
    """Change of kinetic energy is torque power less friction, resistance and gravity's work."""
    x = np.array([v, front * v / RADIUS, rear * v / RADIUS])
    dx = _derivatives(x, _inputs((tf, tr), (mu, mu), theta))
    _, forces = printed_derivatives(x, (tf, tr), (mu, mu), theta, CAR)
    stored = CAR["mass"] * x[0] * dx[0] + CAR["wheel_inertia"] * (x[1] * dx[1] + x[2] * dx[2])
    lost = forces @ (RADIUS * x[1:] - v)
    assert lost >= 0.0  # a tyre never gives energy
    resisted = CAR["rolling_resistance"] * CAR["mass"] * GRAVITY * v + CAR["drag"] * v**3
    fallen = CAR["mass"] * GRAVITY * np.sin(theta) * v
    assert stored == pytest.approx(
        tf * x[1] + tr * x[2] - lost - resisted + fallen, rel=1e-9, abs=1e-5
    )


STATES = [
    (10.0, 1.01, 1.005, 150.0),
    (10.0, 0.97, 0.99, -300.0),
    (1.0, 1.2, 1.1, 900.0),
    (40.0, 1.5, 1.02, 2000.0),
    (5.0, 0.2, 0.95, -800.0),
    (0.06, 1.3, 1.2, 50.0),
    (0.03, 0.7, 1.1, -40.0),
    (-3.0, 1.02, 0.97, 100.0),
]


def _jacobian(x, inputs):
    jac = np.zeros((3, 3))
    tyres = np.zeros(1, TYRE_TYPE)
    evaluate_tyres(x, PLANT[0], tyres[0])
    (
        jac[0, 0], jac[0, 1], jac[0, 2], jac[1, 0], jac[1, 1], jac[2, 0], jac[2, 2],
    ) = jacobian(*x, inputs, PLANT[0], tyres[0])  # fmt: skip
    return jac


@pytest.mark.parametrize(("v", "front", "rear", "tf"), STATES)
def test_jacobian_is_the_derivative(v, front, rear, tf):
    x = np.array([v, front * v / RADIUS, rear * v / RADIUS])
    inputs = _inputs((tf, 0.7 * tf), (0.9, 0.6), 0.02)
    analytic = _jacobian(x, inputs)
    numeric = np.zeros((3, 3))
    for i in range(3):
        step = np.zeros(3)
        step[i] = 1e-7 * max(1.0, abs(x[i]))
        ahead, behind = _derivatives(x + step, inputs), _derivatives(x - step, inputs)
        numeric[:, i] = (ahead - behind) / (2.0 * step[i])
    np.testing.assert_allclose(analytic, numeric, rtol=2e-5, atol=2e-4)


def test_loads_share_the_weight_about_the_centre_of_gravity():
    plant = PLANT[0]
    weight = CAR["mass"] * GRAVITY
    assert plant["load_front"] + plant["load_rear"] == pytest.approx(weight)
    front_moment = plant["load_front"] * CAR["cg_to_front"]
    assert front_moment == pytest.approx(plant["load_rear"] * CAR["cg_to_rear"])


def test_missing_vehicle_parameter_is_named():
    with pytest.raises(InputError, match="'drag'"):
        plant_record({k: v for k, v in CAR.items() if k != "drag"})
    assert set(PLANT_PARAMETERS) <= set(CAR)


def test_momentum_over_a_run():
    truth = record(clean("combined_traction_braking"), 0).truth
    time, v = truth["time"], truth["speed_x"]
    resistance = CAR["rolling_resistance"] * CAR["mass"] * GRAVITY + CAR["drag"] * v**2
    force = truth["force_x_front"] + truth["force_x_rear"] - resistance
    force += CAR["mass"] * GRAVITY * np.sin(truth["road_grade"])
    gained = CAR["mass"] * (v[-1] - v[0])
    assert np.trapezoid(force, time) == pytest.approx(gained, abs=1e-3 * CAR["mass"])


def test_coasting_follows_the_closed_form():
    """Slip is negligible then: (m + 2 I/R^2) v_dot = -(C_r m g + D_a v^2)."""
    scenario = custom([(0.0, 1.0, 0.0, 0.0)], horizon=30.0, initial_speed=20.0)
    truth = record(scenario, 0).truth
    inertia = CAR["mass"] + 2.0 * CAR["wheel_inertia"] / RADIUS**2
    a = CAR["rolling_resistance"] * CAR["mass"] * GRAVITY / inertia
    b = CAR["drag"] / inertia
    angle = np.arctan(20.0 * np.sqrt(b / a)) - np.sqrt(a * b) * truth["time"]
    np.testing.assert_allclose(truth["speed_x"], np.sqrt(a / b) * np.tan(angle), atol=2e-3)


def test_braking_ends_at_rest():
    scenario = custom(
        [(0.0, 10.0, -1000.0, -1000.0)], horizon=10.0, initial_speed=15.0, name="stop"
    )
    truth = record(scenario, 0).truth
    v = truth["speed_x"]
    assert v.min() > -1e-3  # its brakes do not push it backwards
    assert v[-1] < 1e-3
    assert truth["wheel_speed_front"].min() * RADIUS > -HOLD_SPEED
    # the deceleration while rolling: brake force of both axles and the resistances
    moving = (v > 5.0) & (truth["time"] > 0.5)
    force = 2.0 * 1000.0 / RADIUS + CAR["rolling_resistance"] * CAR["mass"] * GRAVITY
    inertia = CAR["mass"] + 2.0 * CAR["wheel_inertia"] / RADIUS**2
    expected = -(force + CAR["drag"] * v[moving] ** 2) / inertia
    np.testing.assert_allclose(truth["speed_x_rate"][moving], expected, rtol=0.02)


def test_rest_stays_rest_without_torque():
    scenario = custom([(0.0, 1.0, 0.0, 0.0)], horizon=5.0, initial_speed=0.0)
    truth = record(scenario, 0).truth
    for name in ("speed_x", "wheel_speed_front", "force_x_front", "accel_x"):
        assert np.all(truth[name] == 0.0)


def test_accelerometer_reads_no_gravity_and_the_slope_pulls_downhill():
    scenario = custom([(0.0, 1.0, 0.0, 0.0)], horizon=2.0, initial_speed=5.0, road_grade=0.05)
    truth = record(scenario, 0).truth
    assert truth["speed_x"][-1] > 5.0
    np.testing.assert_allclose(
        truth["speed_x_rate"] - truth["accel_x"], GRAVITY * np.sin(0.05), rtol=1e-12
    )


@pytest.mark.parametrize("tyre", ["brush", "dugoff", "magic_formula", "fitted_curve"])
@pytest.mark.parametrize("slip", [0.004, 0.03, -0.05, 0.3])
def test_every_tyre_has_the_slopes_of_its_force_and_the_stiffness_on_paper(tyre, slip):
    record = plant_record(CAR, tyre)
    speed = 12.0
    spin = (speed / (1.0 - slip) if slip > 0.0 else speed * (1.0 + slip)) / RADIUS

    def force(v, w):
        tyres = np.zeros(1, TYRE_TYPE)
        evaluate_tyres(np.array([v, w, w]), record[0], tyres[0])
        return tyres[0]["front"]

    tyres = np.zeros(1, TYRE_TYPE)
    evaluate_tyres(np.array([speed, spin, spin]), record[0], tyres[0])
    step = 1e-6
    to_wheel = (force(speed, spin + step) - force(speed, spin - step)) / (2.0 * step)
    to_speed = (force(speed + step, spin) - force(speed - step, spin)) / (2.0 * step)
    assert tyres[0]["front_wheel"] == pytest.approx(to_wheel, rel=1e-4, abs=1e-7)
    assert tyres[0]["front_speed"] == pytest.approx(to_speed, rel=1e-4, abs=1e-7)
    rolling = speed / RADIUS
    slope = force(speed, rolling * (1.0 + 1e-7)) / 1e-7
    assert slope == pytest.approx(CAR["magic_b"] * CAR["magic_c"], rel=1e-4)
