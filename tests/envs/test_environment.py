"""The Gymnasium environments: standard checks, identity with the batch rollout, lanes."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from gripbench.envs.gym.environment import VehicleEnvironment
from gripbench.envs.worlds import load_scenario, record, scenario_files, simulation_of
from gripbench.errors import InputError

STEPPED = [name for name in scenario_files() if load_scenario(name).environment]
ONE_OF_EACH_WORLD = ["noisy_acceleration", "double_lane_change_snow"]
STEERED = ["split_mu_braking", "public_road", "slalom_snow@1"]  # from the first sample on


def short(name, horizon):
    return load_scenario(name).model_copy(update={"horizon": horizon, "score_from": 0.0})


@pytest.mark.parametrize("name", STEPPED)
def test_registered_environment_passes_the_checker(name):
    identity = load_scenario(name).environment
    environment = gymnasium.make(identity, disable_env_checker=True)
    assert environment.spec.id == identity
    check_env(environment.unwrapped, skip_render_check=True)  # a warning is an error here


def test_ids_are_unique():
    identities = [load_scenario(name).environment for name in STEPPED]
    assert len(set(identities)) == len(identities)


def test_every_id_is_registered_by_importing_the_package():
    assert all(load_scenario(name).environment in gymnasium.registry for name in STEPPED)


def test_paper_solver_has_no_environment():
    assert not load_scenario("li2014_constant_mu").environment


@pytest.mark.parametrize("name", [*ONE_OF_EACH_WORLD, *STEERED])
def test_stepping_gives_the_bytes_of_the_batch_rollout(name):
    environment = VehicleEnvironment(name, idealised=True)
    steps = 700 if name in STEERED else 1500
    recording = record(load_scenario(name), 3)
    observation, info = environment.reset(seed=3)
    for k in range(steps + 1):
        truth = recording.truth[k]
        assert tuple(info["truth"].values()) == truth.item()
        assert tuple(float(v) for v in observation.values()) == recording.observations[k].item()
        observation, reward, *_, info = environment.step(environment.driver_action())
        assert reward == 0.0


def test_truth_is_not_observed():
    environment = VehicleEnvironment("constant_mu")
    observation, info = environment.reset(seed=0)
    assert "mu_front" in info["truth"]
    assert "force_x_front" in info["truth"]
    assert not {"mu_front", "force_x_front", "slip_ratio_front"} & set(observation)


def test_observations_are_copies():
    environment = VehicleEnvironment("constant_mu")
    first, _ = environment.reset(seed=0)
    kept = {name: value.copy() for name, value in first.items()}
    environment.step(environment.driver_action())
    assert all(first[name] == kept[name] for name in kept)


def test_episode_is_truncated_at_the_horizon():
    environment = VehicleEnvironment("constant_mu")
    environment.scenario = short("constant_mu", 0.005)
    environment.reset(seed=0)
    flags = [environment.step(np.zeros(2))[2:4] for _ in range(5)]
    assert flags[:4] == [(False, False)] * 4
    assert flags[4] == (False, True)


def test_reward_is_minus_the_share_of_the_range():
    environment = VehicleEnvironment("constant_mu")
    environment.reset(seed=0)
    driver = environment.driver_action()
    _, reward, *_ = environment.step(driver + np.array([0.2, 0.0]))
    assert reward == pytest.approx(-0.05)


def test_actions_beyond_the_space_are_clipped():
    one, other = VehicleEnvironment("constant_mu"), VehicleEnvironment("constant_mu")
    one.reset(seed=0)
    other.reset(seed=0)
    beyond, *_ = one.step(np.array([1e9, 1e9]))
    limit, *_ = other.step(np.array([1.0, 1.0]))
    assert {k: float(v) for k, v in beyond.items()} == {k: float(v) for k, v in limit.items()}


@pytest.mark.parametrize("name", ONE_OF_EACH_WORLD)
def test_lanes_give_the_bytes_of_single_environments(name):
    lanes = gymnasium.make_vec(
        load_scenario(name).environment, num_envs=3, vectorization_mode="vector_entry_point"
    )
    singles = [VehicleEnvironment(name) for _ in range(3)]
    together, _ = lanes.reset(seed=7)
    alone = [single.reset(seed=7 + lane)[0] for lane, single in enumerate(singles)]
    for _ in range(1100):  # beyond one block of random numbers
        for lane in range(3):
            assert all(together[key][lane] == alone[lane][key] for key in alone[lane])
        actions = lanes.unwrapped.driver_actions()
        together, rewards, _, _, info = lanes.step(actions)
        assert (rewards == 0.0).all()
        results = [single.step(single.driver_action()) for single in singles]
        alone = [result[0] for result in results]
        assert info["truth"]["speed_x"][1] == results[1][4]["truth"]["speed_x"]
    assert together["time"].shape == (3,)
    lanes.close()


@pytest.mark.parametrize("name", ONE_OF_EACH_WORLD)
@pytest.mark.parametrize(("value", "more"), [(np.nan, 0), (np.inf, 0), (0.0, 1)])
def test_an_action_that_is_none_is_refused(name, value, more):
    environment = VehicleEnvironment(name)
    environment.reset(seed=0)
    with pytest.raises(InputError, match="the action"):
        environment.step(np.full(environment.action_space.shape[0] + more, value))


def test_lane_starts_again_after_its_end():
    lanes = gymnasium.make_vec(
        "gripbench/ConstantMu-v0", num_envs=2, vectorization_mode="vector_entry_point"
    )
    base = lanes.unwrapped
    base.scenario = short("constant_mu", 0.003)
    lanes.reset(seed=1)
    driver = base.driver_actions
    for _ in range(2):
        assert not lanes.step(driver())[3].any()
    assert lanes.step(driver())[3].all()
    observation, reward, terminated, truncated, _ = lanes.step(driver())
    assert (observation["time"] == 0.0).all()
    assert (reward == 0.0).all()
    assert not terminated.any()
    assert not truncated.any()
    lanes.close()


def test_same_seed_same_bytes_other_seed_other_bytes():
    runs = [simulation_of(load_scenario("constant_mu")).run(seed) for seed in (4, 4, 5)]
    assert runs[0].tobytes() == runs[1].tobytes()
    assert runs[0].tobytes() != runs[2].tobytes()
