"""Speed of the planar plant: one step of 1 ms, one recording, one sample of the environment."""

import numba
import numpy as np
import pytest

from gripbench.envs.plants.planar import plant
from gripbench.envs.vehicles import load_vehicle
from gripbench.envs.worlds import load_scenario, simulation_of

STEPS = 1000


@numba.njit(error_model="numpy")
def _advance(x, u, p, wheels, work):
    for _ in range(STEPS):
        plant.hold_stiffness(x, p[0], u)
        plant.advance_step(x, u, p[0], wheels, work)


@pytest.mark.parametrize("tyre", ["brush", "dugoff", "magic_formula"])
def test_thousand_plant_steps(benchmark, tyre):
    record = plant.plant_record(tyre, load_vehicle("dakhlallah2008"))
    inputs = np.zeros(plant.INPUTS)
    inputs[plant.MU : plant.MU + 4] = 0.8
    inputs[[plant.YAW_GAIN, plant.ALONG_X, plant.ACROSS_Y]] = 1.0
    inputs[plant.NORMAL] = 9.81
    inputs[plant.TORQUE : plant.TORQUE + 4] = 40.0
    state = np.zeros(plant.STATES)
    state[plant.V_X] = 20.0
    state[plant.WHEEL : plant.WHEEL + 4] = 20.0 / record["wheel_radius"][0]
    state[plant.STEER] = 0.02
    wheels, work = np.zeros((4, plant.WHEEL_COLUMNS)), np.zeros((3, plant.STATES))
    benchmark(lambda: _advance(state.copy(), inputs, record, wheels, work))


@pytest.mark.parametrize("name", ["double_lane_change_snow", "dakhlallah_hard"])
def test_recording(benchmark, name):
    simulation = simulation_of(load_scenario(name))
    simulation.run(0)
    benchmark(simulation.run, 1)


def test_sample_of_the_environment(benchmark):
    simulation = simulation_of(load_scenario("double_lane_change_snow"))
    simulation.reset(0)
    action = np.zeros(5)
    benchmark(simulation.advance, action)
