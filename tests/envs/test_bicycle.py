"""The linear bicycle against the matrix exponential and its own steady state."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from gripbench.configuration import CONFIGS, parse, read_toml
from gripbench.envs.plants.bicycle import BicycleScenario, BicycleSimulation, steady_state
from gripbench.envs.vehicles import load_vehicle
from gripbench.envs.worlds import load_scenario, record
from gripbench.errors import InputError

VEHICLES = ["dakhlallah2008", "yoon2015_pickup", "anderson2004_blazer"]


def scenario_of(**changes):
    content = read_toml(CONFIGS / "scenarios" / "two_turns_bicycle.toml") | changes
    if "steering" in changes:
        del content["path"]
    return parse(BicycleScenario, content, "test.toml")


def simulation_of(**changes):
    scenario = scenario_of(**changes)
    return BicycleSimulation(scenario, load_vehicle(scenario.vehicle))


def matrices(vehicle, speed):
    """Return A and B of d/dt (v_y, r) = A (v_y, r) + B steer."""
    m, inertia = vehicle["mass"], vehicle["yaw_inertia"]
    a, b = vehicle["cg_to_front"], vehicle["cg_to_rear"]
    front, rear = vehicle["cornering_stiffness_front"], vehicle["cornering_stiffness_rear"]
    cross = b * rear - a * front
    A = [
        [-(front + rear) / (m * speed), cross / (m * speed) - speed],
        [cross / (inertia * speed), -(a**2 * front + b**2 * rear) / (inertia * speed)],
    ]
    return np.array(A), np.array([front / m, a * front / inertia])


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_response_to_held_steering_is_the_matrix_exponential(vehicle):
    simulation = simulation_of(vehicle=vehicle, speed=25.0, horizon=3.0, score_from=0.0)
    simulation.reset(0)
    A, B = matrices(load_vehicle(vehicle).values(), 25.0)
    simulation._run.state[15] = 0.02  # steered already: no ramp
    truth = np.concatenate([simulation.advance(np.array([0.02])) for _ in range(200)])
    for k in (0, 20, 199):
        time = 0.01 * (k + 1)
        exact = np.linalg.solve(A, (expm(A * time) - np.eye(2)) @ B) * 0.02
        assert truth["speed_y"][k] == pytest.approx(exact[0], abs=1e-10)
        assert truth["yaw_rate"][k] == pytest.approx(exact[1], abs=1e-10)


@pytest.mark.parametrize("vehicle", VEHICLES)
@pytest.mark.parametrize("speed", [5.0, 30.0])
def test_steady_state_is_the_fixed_point_of_the_equations(vehicle, speed):
    car = load_vehicle(vehicle).values()
    A, B = matrices(car, speed)
    lateral, yaw_rate = -np.linalg.solve(A, B)
    gains = steady_state(car, speed)
    assert gains.yaw_rate_gain == pytest.approx(yaw_rate, rel=1e-12)
    assert gains.sideslip_gain == pytest.approx(lateral / speed, rel=1e-12, abs=1e-15)


def test_anderson_turn_reaches_the_sideslip_of_equation_7():
    recording = record(load_scenario("two_turns_bicycle"), 1)
    assert recording.termination == ""
    truth = recording.truth[(recording.truth["time"] > 25.0) & (recording.truth["time"] < 40.0)]
    assert np.degrees(truth["sideslip"].mean()) == pytest.approx(-1.05, abs=0.03)
    assert truth["yaw_rate"].mean() == pytest.approx(0.1, rel=1e-3)


def test_bank_pulls_the_vehicle_to_its_lower_side():
    straight = {"kind": "step_steer", "amplitude": 0.0}
    truth = simulation_of(
        steering=straight, road={"mu": 0.9, "bank": 0.05}, horizon=1.0, score_from=0.0
    ).run(0)
    assert truth["speed_y"][-1] < 0.0  # left side up: to the right
    assert truth["accel_y"][-1] > 0.0


def test_steps_and_one_loop_give_identical_bytes_on_every_seed():
    simulation = simulation_of(horizon=20.0)
    for seed in (0, 1):
        whole = simulation.run(seed)
        stepped = [simulation.reset(seed)]
        stepped += [simulation.advance(simulation.drive()) for _ in range(2000)]
        assert np.concatenate(stepped).tobytes() == whole.tobytes()
        assert simulation.fresh().run(seed).tobytes() == whole.tobytes()


def test_oversteer_beyond_the_critical_speed_ends_named_and_finite():
    simulation = simulation_of(
        speed=60.0, horizon=200.0, steering={"kind": "step_steer", "amplitude": 0.01}
    )
    simulation._plant["tyre_y_rear"] *= 0.2
    truth = simulation.run(0)
    assert simulation.termination == "spin"
    assert len(truth) < 20001
    assert np.isfinite(truth.view(np.float64)).all()


def test_courses_are_within_half_a_turn():
    truth = simulation_of().run(3)
    for name in ("yaw", "course"):
        assert np.abs(truth[name]).max() <= math.pi


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"speed": 0.5}, "the linear bicycle needs 1 and above"),
        ({"driver": {"brake_at": 3.0}}, "keeps its speed"),
        ({"tyre": "brush"}, "unknown key 'tyre'"),
    ],
)
def test_what_a_linear_bicycle_cannot_do_is_refused(changes, message):
    with pytest.raises(InputError, match=message):
        scenario_of(**changes)


def test_an_action_that_is_not_finite_is_refused():
    simulation = simulation_of()
    simulation.reset(0)
    with pytest.raises(InputError, match="not finite"):
        simulation.advance(np.array([np.inf]))
