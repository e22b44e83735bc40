"""A thousand steps of each lateral method beside its filterpy twin and a vehicle simulator.

`pytest tests/benchmarks/test_lateral_methods.py --benchmark-enable -n 0` compares them in one run:
all jobs have the same number of steps. filterpy has no filter that takes a measurement of the
past, so the cascade's twin takes late GPS samples as if they were new.
"""

import math

import lateral_speed as speed
import numpy as np
import pytest

from gripbench.methods.dugoff_ekf import DugoffEkf
from gripbench.methods.kinematic_kalman_filter import KinematicKalmanFilter
from gripbench.methods.magnetometer_gps_cascade import MagnetometerGpsCascade
from gripbench.methods.model_based_kalman_filter import ModelBasedKalmanFilter
from gripbench.methods.stiffness_update import StiffnessUpdate
from gripbench.methods.velocity_friction_ekf import VelocityFrictionEkf

SLALOM = ("slalom_snow", 5000)
KINEMATIC, MODEL_BASED = KinematicKalmanFilter(), ModelBasedKalmanFilter()

METHODS = {
    "kinematic_kalman_filter": (KINEMATIC, ("two_turns", 0)),
    "model_based_kalman_filter": (MODEL_BASED, ("two_turns", 0)),
    "stiffness_update": (StiffnessUpdate(), ("two_turns", 0)),
    "dugoff_ekf": (DugoffEkf(), ("dakhlallah_hard", 0)),
    "velocity_friction_ekf": (VelocityFrictionEkf(), SLALOM),
    "magnetometer_gps_cascade": (MagnetometerGpsCascade(), SLALOM),
}
TWINS = {
    "kinematic_kalman_filter": lambda: speed.kinematic(KINEMATIC),
    "model_based_kalman_filter": lambda: speed.single_track(MODEL_BASED),
    "stiffness_update": lambda: speed.both(KINEMATIC, MODEL_BASED),
    "dugoff_ekf": lambda: speed.dugoff(DugoffEkf("paper_step")),
    "velocity_friction_ekf": lambda: speed.friction(*SLALOM),
    "magnetometer_gps_cascade": lambda: speed.cascade(*SLALOM),
}

group = pytest.mark.benchmark(group=f"{speed.STEPS} lateral steps")


@group
@pytest.mark.parametrize("name", METHODS)
def test_method(benchmark, name):
    method, place = METHODS[name]
    run = speed.batch(method, *place)
    run()
    benchmark.extra_info["steps"] = speed.STEPS
    estimates = benchmark(run)
    assert len(estimates) == speed.STEPS
    assert all(np.isfinite(estimates[output]).all() for output in method.outputs)


@group
@pytest.mark.parametrize("name", TWINS)
def test_filterpy_twin(benchmark, name):
    run = TWINS[name]()
    benchmark.extra_info["steps"] = speed.STEPS
    found = benchmark.pedantic(run, rounds=3)
    assert np.isfinite(found[0]).all()


def test_the_twins_of_the_cascade_find_the_friction():
    """What is timed does the work: filterpy's friction is that of the compiled filters."""
    mu = speed.batch(VelocityFrictionEkf(), *SLALOM)()["mu"][-1]
    assert speed.friction(*SLALOM)()[-1] == pytest.approx(mu, rel=0.1)
    assert speed.cascade(*SLALOM)()[-1] == pytest.approx(0.25, rel=0.4)


@group
def test_commonroad_single_track(benchmark):
    """The right-hand side of commonroad's single-track model, what an Euler step of it costs."""
    models = pytest.importorskip(
        "vehiclemodels.vehicle_dynamics_st",
        reason="commonroad-vehicle-models is not installed (extra 'test')",
    )
    parameters = pytest.importorskip("vehiclemodels.parameters_vehicle2")
    car = parameters.parameters_vehicle2()

    def run():
        for k in range(speed.STEPS):
            state = [0.0, 0.0, 0.02 * math.sin(0.01 * k), 20.0, 0.0, 0.1, 0.01]
            slope = models.vehicle_dynamics_st(state, [0.0, 0.0], car)
        return slope

    benchmark.extra_info["steps"] = speed.STEPS
    assert np.isfinite(benchmark(run)).all()
