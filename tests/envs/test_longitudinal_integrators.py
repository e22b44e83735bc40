"""The accurate integrators against their order and against scipy's Radau."""

from itertools import pairwise

import numpy as np
import pytest
from longitudinal_drive import ACCURATE, clean
from scipy.integrate import solve_ivp

from gripbench.envs.drivers.profiles import breakpoints, profile_value, segment_records
from gripbench.envs.plants.longitudinal import integrators
from gripbench.envs.plants.longitudinal.plant import (
    INPUT_TYPE,
    TYRE_TYPE,
    derivatives,
    evaluate_tyres,
    jacobian,
    plant_record,
)
from gripbench.envs.vehicles import load_vehicle
from gripbench.envs.worlds import record

CAR = load_vehicle("li2014").values()
PLANT = plant_record(CAR)


def _inputs(torque_front, torque_rear, mu, grade):
    inputs = np.zeros(1, INPUT_TYPE)
    inputs[0] = (torque_front, torque_rear, mu, mu, grade, 0.0)
    return inputs


def _tyres(x):
    tyres = np.zeros(1, TYRE_TYPE)
    evaluate_tyres(x, PLANT[0], tyres[0])
    return tyres


def _jacobian(x, inputs):
    jac = np.zeros((3, 3))
    tyres = np.zeros(1, TYRE_TYPE)
    evaluate_tyres(x, PLANT[0], tyres[0])
    (
        jac[0, 0], jac[0, 1], jac[0, 2], jac[1, 0], jac[1, 1], jac[2, 0], jac[2, 2],
    ) = jacobian(*x, inputs, PLANT[0], tyres[0])  # fmt: skip
    return jac


def _radau(x0, span, times, inputs_at):
    """Integrate with scipy; `inputs_at(t)` gives the inputs."""

    def slope(t, x):
        dx = np.zeros(3)
        derivatives(x, inputs_at(t), PLANT[0], dx)
        return dx

    def jac(t, x):
        return _jacobian(x, inputs_at(t))

    solution = solve_ivp(
        slope, span, x0, method="Radau", t_eval=times, rtol=1e-10, atol=1e-11, jac=jac
    )
    assert solution.success
    return solution.y.T


@pytest.mark.parametrize("integrator", ["ros3", "rk4"])
def test_order(integrator, monkeypatch):
    """Halving the step divides the error by 2^3 or 2^4 where the problem is not stiff."""
    monkeypatch.setattr(integrators, "TOLERANCE", 1e30)  # every step is accepted as it is asked for
    start = np.array([20.0, 20.4 / 0.35, 20.1 / 0.35])
    inputs = _inputs(600.0, 300.0, 0.9, 0.0).view(np.recarray)
    plant = PLANT.view(np.recarray)
    duration = 8e-3
    exact = _radau(start, (0.0, duration), [duration], lambda t: inputs[0])[-1]
    errors = []
    work = integrators.scratch()
    for steps in (40, 80, 160):
        x = start.copy()
        for _ in range(steps // 10 if integrator == "rk4" else steps):
            if integrator == "rk4":  # takes ten steps a call
                integrators.rk4.py_func(x, duration / steps * 10, inputs[0], plant[0], work)
            else:
                h = duration / steps
                tyres = _tyres(x).view(np.recarray)
                integrators.ros3.py_func(x, h, h, inputs[0], plant[0], tyres[0])
        errors.append(np.abs(x - exact).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    expected = 3.0 if integrator == "ros3" else 4.0
    np.testing.assert_allclose(orders, expected, atol=0.35)


def test_ros3_is_damped_at_infinity():
    """One step of a second relaxes a wheel with an eigenvalue of -100/s and more onto its slip."""
    x = np.array([5.0, 8.0 / 0.35, 5.0 / 0.35])
    inputs = _inputs(50.0, 50.0, 0.9, 0.0)
    integrators.ros3(x, 1e-5, 0.5, inputs[0], PLANT[0], _tyres(x)[0])
    exact = _radau(np.array([5.0, 8.0 / 0.35, 5.0 / 0.35]), (0.0, 0.5), [0.5], lambda t: inputs[0])[
        -1
    ]
    np.testing.assert_allclose(x, exact, rtol=1e-5)


def test_not_a_number_ends_the_step():
    """Such a step returns instead of shrinking for ever; the simulation then names the run."""
    x = np.array([np.nan, 1.0, 1.0])
    inputs = _inputs(0.0, 0.0, 0.9, 0.0)
    integrators.ros3(x, 1e-4, 1e-3, inputs[0], PLANT[0], _tyres(x)[0])
    assert np.isnan(x).all()


def _continuous(scenario):
    """Return the samples of a run under the continuous profiles, between breakpoints by Radau."""
    driver = scenario.driver
    rear = driver.rear or driver.front
    parts = (driver.front, rear, scenario.friction)
    profiles = [segment_records(part) for part in parts]
    n = scenario.steps
    times = np.arange(n + 1) * scenario.sample_time
    jumps = sorted({0.0, scenario.horizon}.union(*(breakpoints(part) for part in parts)))
    states = np.empty((n + 1, 3))
    states[0] = x = np.array([scenario.initial_speed, *[scenario.initial_speed / 0.35] * 2])
    inputs = _inputs(0.0, 0.0, 0.0, scenario.road_grade)
    for begin, end in pairwise(jumps):

        def inputs_at(t, end=end):
            at = min(t, end - 1e-12)
            values = [profile_value(at, profile) for profile in profiles]
            inputs[0] = (*values, values[2], scenario.road_grade, 0.0)
            return inputs[0]

        inside = (times > begin + 1e-9) & (times <= end + 1e-9)
        states[inside] = _radau(x, (begin, end), np.minimum(times[inside], end), inputs_at)
        x = states[inside][-1]
    return states


def _front_force(states, mu):
    rolling = 0.35 * states[:, 1]
    slip = (rolling - states[:, 0]) / np.maximum(rolling, states[:, 0])
    inner = 20.0 * slip + 0.5 * (20.0 * slip - np.arctan(20.0 * slip))
    return mu * PLANT["load_front"][0] * np.sin(1.5 * np.arctan(inner))


@pytest.mark.parametrize("name", ACCURATE)
def test_front_force_of_each_scenario_is_that_of_radau(name):
    scenario = clean(name)
    exact = _continuous(scenario)
    for integrator in ("ros3", "rk4"):
        truth = record(scenario.model_copy(update={"integrator": integrator}), 0).truth
        states = np.column_stack(
            [truth[c] for c in ("speed_x", "wheel_speed_front", "wheel_speed_rear")]
        )
        # both forces with the friction that acted up to the sample
        error = _front_force(states, truth["mu_front"]) - _front_force(exact, truth["mu_front"])
        np.testing.assert_allclose(
            _front_force(states, truth["mu_front"]), truth["force_x_front"], atol=1e-6
        )
        assert np.sqrt(np.mean(error**2)) < 0.1
        assert np.abs(states[:, 0] - exact[:, 0]).max() < 1e-3
