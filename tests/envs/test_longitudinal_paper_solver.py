"""The solver behind Tables IV and V: its coefficients, its steps, and what its error does."""

import numpy as np
import pytest
from longitudinal_drive import clean, custom

from gripbench.envs.plants.longitudinal import paper_solver as solver
from gripbench.envs.plants.longitudinal.world import LongitudinalSimulation
from gripbench.envs.vehicles import load_vehicle
from gripbench.envs.worlds import load_scenario, record
from gripbench.errors import GripbenchError

A = np.hstack([solver._STAGES, np.zeros((7, 1))])
FIFTH = A[6]
FOURTH = FIFTH - solver._ERROR
C = solver._NODES


def _conditions(weights):
    """Return (order, left, right) of the conditions of Butcher's trees up to order 5."""
    b, c = weights, C
    ac, ac2, ac3 = A @ c, A @ c**2, A @ c**3
    return [
        (1, b.sum(), 1.0),
        (2, b @ c, 1 / 2),
        (3, b @ c**2, 1 / 3),
        (3, b @ ac, 1 / 6),
        (4, b @ c**3, 1 / 4),
        (4, b @ (c * ac), 1 / 8),
        (4, b @ ac2, 1 / 12),
        (4, b @ (A @ ac), 1 / 24),
        (5, b @ c**4, 1 / 5),
        (5, b @ (c**2 * ac), 1 / 10),
        (5, b @ (c * ac2), 1 / 15),
        (5, b @ (c * (A @ ac)), 1 / 30),
        (5, b @ ac**2, 1 / 20),
        (5, b @ ac3, 1 / 20),
        (5, b @ (A @ (c * ac)), 1 / 40),
        (5, b @ (A @ ac2), 1 / 60),
        (5, b @ (A @ (A @ ac)), 1 / 120),
    ]


def test_solution_has_order_5():
    for _, left, right in _conditions(FIFTH):
        assert left == pytest.approx(right, abs=1e-14)
    np.testing.assert_allclose(A.sum(axis=1), C, atol=1e-14)


def test_embedded_solution_has_order_4_and_no_more():
    fifth = []
    for order, left, right in _conditions(FOURTH):
        if order <= 4:
            assert left == pytest.approx(right, abs=1e-14)
        else:
            fifth.append(abs(left - right))
    assert max(fifth) > 1e-5


@pytest.fixture(scope="module")
def friction_step():
    return record(load_scenario("li2014_friction_step"), 0).truth


def test_steps_end_on_breakpoints_and_tenths(friction_step):
    times = friction_step["time"]
    assert np.all(np.diff(times) > 0.0)
    expected = {round(0.1 * i, 9) for i in range(1, 301)}
    assert expected <= set(times.tolist())
    assert times[-1] == 30.0


def test_steps_end_on_odd_breakpoints():
    scenario = custom(
        [(0.0, 0.123, 0.0, 100.0), (0.123, 1.77, 100.0, 100.0)], horizon=2.0, integrator="paper"
    )
    times = record(scenario, 0).truth["time"]
    assert {0.123, 1.77, 2.0} <= set(times.tolist())


def test_friction_changes_at_its_step_and_nowhere_else(friction_step):
    times, mu = friction_step["time"], friction_step["mu_front"]
    assert np.all(mu[times < 10.0] == 0.9)
    assert np.all(mu[times >= 10.0] == 0.5)


def test_number_and_size_of_steps(friction_step):
    """The explicit method runs at its stability limit: some 20 000 steps of a millisecond."""
    steps = np.diff(friction_step["time"])
    assert 15_000 < len(steps) < 27_000
    assert 0.7e-3 < np.median(steps) < 1.6e-3
    # |eigenvalue| step: about 3.3 for Dormand-Prince on the negative real axis
    late = friction_step["time"][1:] > 19.0
    stiffness = 20.0 * 1.5 * 0.5 * 7549.8
    rate = stiffness * 0.35**2 / (2.1 * friction_step["speed_x"][1:][late])
    assert 2.0 < np.median(rate * steps[late]) < 4.5


def test_initial_samples(friction_step):
    assert friction_step["time"][0] == 0.0
    assert friction_step["speed_x"][0] == 1.0


def test_paper_solver_cannot_be_stepped():
    scenario = load_scenario("li2014_constant_mu")
    with pytest.raises(GripbenchError, match="ros3"):
        LongitudinalSimulation(scenario, load_vehicle("li2014")).reset(0)


def test_a_tight_tolerance_removes_the_ringing(monkeypatch):
    """The spurious force is the solver's error: it goes with the tolerance, nothing else changed.

    The same source runs uncompiled with another tolerance, beside the accurate integrator.
    """
    horizon = 2.5
    friction = clean("constant_mu").friction
    scenario = clean("constant_mu", horizon=horizon)
    accurate = record(scenario, 0).truth
    printed = scenario.model_copy(update={"integrator": "paper", "friction": friction})

    def front_force_error():
        simulation = LongitudinalSimulation(printed, load_vehicle("li2014"))
        simulation._plant = simulation._plant.view(np.recarray)
        truth = simulation.run(0)
        exact = np.interp(truth["time"], accurate["time"], accurate["force_x_front"])
        held = truth["time"] > 1.2
        return (truth["force_x_front"] - exact)[held]

    def uncompiled(x0, carry, *arguments):
        return solver.paper_solver.py_func(x0, carry.view(np.recarray), *arguments)

    loose = front_force_error()
    assert loose.mean() < -30.0
    assert loose.std() > 10.0
    monkeypatch.setattr(solver, "TOLERANCE", 1e-7)
    monkeypatch.setattr("gripbench.envs.plants.longitudinal.world.paper_solver", uncompiled)
    tight = front_force_error()
    assert abs(tight.mean()) < 0.1
    assert tight.std() < 0.5
