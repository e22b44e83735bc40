"""The native vector environment is Gymnasium's SyncVectorEnv over single ones, lane by lane."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from gripbench.envs.gym.arguments import ArgumentError, NotResetError
from gripbench.envs.gym.environment import VehicleEnvironment
from gripbench.envs.gym.vector_environment import VehicleVectorEnvironment
from gripbench.envs.worlds import load_scenario
from gripbench.errors import InputError

LANES = 3
ONE_OF_EACH_WORLD = ["noisy_acceleration", "double_lane_change_snow", "two_turns_bicycle"]


def assert_same(ours, theirs, where=""):
    if isinstance(theirs, dict):
        assert set(ours) == set(theirs), where
        for key in theirs:
            assert_same(ours[key], theirs[key], f"{where}.{key}")
    elif isinstance(theirs, np.ndarray) and theirs.dtype == object:
        assert [type(one) for one in ours] == [type(one) for one in theirs], where
        for one, other in zip(ours, theirs, strict=True):
            assert_same(one, other, where)
    elif isinstance(theirs, np.ndarray):
        assert ours.dtype == theirs.dtype, where
        assert ours.tobytes() == theirs.tobytes(), (where, ours, theirs)
    else:
        assert ours == theirs, where


def pair(name, mode, limit):
    """Return the native environment and Gymnasium's, both with episodes of `limit` steps."""
    identity = load_scenario(name).environment

    def single():
        return gymnasium.make(identity, max_episode_steps=limit, disable_env_checker=True)

    native = gymnasium.make_vec(
        identity, num_envs=LANES, max_episode_steps=limit, autoreset_mode=mode
    )
    assert isinstance(native, VehicleVectorEnvironment)
    return native, SyncVectorEnv([single] * LANES, autoreset_mode=mode)


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("name", ONE_OF_EACH_WORLD)
def test_everything_is_that_of_gymnasiums_own(name, mode):
    native, sync = pair(name, mode, 4)
    draws = np.random.default_rng(5)

    def step():
        actions = draws.uniform(-0.3, 0.3, native.action_space.shape)
        ours, theirs = native.step(actions), sync.step(actions)
        assert_same(dict(enumerate(ours)), dict(enumerate(theirs)), "step")
        return ours[2] | ours[3]

    def reset(**given):
        copy = dict(given.get("options") or {})
        ours, theirs = native.reset(**given), sync.reset(**given)
        assert_same(dict(enumerate(ours)), dict(enumerate(theirs)), "reset")
        assert not copy or given["options"] is not None

    def drive(steps):
        for _ in range(steps):
            ended = step()
            if mode is AutoresetMode.DISABLED and ended.any():
                reset(options={"reset_mask": ended})

    reset(seed=7)
    assert native.np_random_seed == sync.np_random_seed
    drive(11)  # three episodes: their seeds follow from that of the first
    some = np.array([True, False, True])
    reset(seed=3, options={"reset_mask": some})
    drive(3)  # lanes are now out of step
    reset(seed=[5, None, 9], options={"reset_mask": ~some})
    drive(6)
    reset(seed=[11, None, 13])
    drive(6)
    reset()
    drive(2)
    reset(seed=2, options={"speed": 9.0})  # for one episode only
    drive(6)
    if name != "two_turns_bicycle":
        reset(options={"mu": 0.3, "reset_mask": some.copy()})
        drive(6)
    native.close()
    sync.close()


def first_readings(seed, episodes=1):
    """Return the first readings of the last of some episodes."""
    lanes = VehicleVectorEnvironment(LANES, "double_lane_change_ice", max_episode_steps=3)
    lanes.reset(seed=seed)
    for _ in range(4 * (episodes - 1)):
        lanes.step(lanes.driver_actions())
    return np.array([lanes.step(lanes.driver_actions())[0]["yaw_rate"] for _ in range(3)])


@pytest.mark.parametrize(
    "seed",
    [np.int64(5), np.array(5), np.uint8(5), [5, 6, 7], (5, 6, 7), np.array([5, 6, 7]),
     [np.int64(5), 6, np.uint8(7)]],
)  # fmt: skip
def test_every_way_to_write_a_seed_is_that_seed(seed):
    for episodes in (1, 2, 3):
        assert np.array_equal(first_readings(seed, episodes), first_readings(5, episodes))


def test_lanes_and_episodes_differ():
    episodes = [first_readings(5, number) for number in (1, 2)]
    assert not np.array_equal(episodes[0], episodes[1])
    assert not np.array_equal(episodes[0][:, 0], episodes[0][:, 1])


@pytest.mark.parametrize(
    "seed",
    [-1, 1.0, "5", True, [1, 2], [1, 2, 3, 4], [], (1,), np.array([1.0, 2.0, 3.0]),
     np.zeros((3, 1), int), {1, 2, 3}, [1, 2, -3], [1, True, 3], b"123", {"seed": 1}],
)  # fmt: skip
def test_what_is_no_seed_is_refused_and_changes_nothing(seed):
    lanes = VehicleVectorEnvironment(LANES, "constant_mu")
    lanes.reset(seed=4)
    with pytest.raises(InputError, match="seed"):
        lanes.reset(seed=seed)
    assert lanes.np_random_seed == (4, 5, 6)


@pytest.mark.parametrize(
    "actions",
    [np.zeros((1, 2)), np.zeros(2), np.zeros((3, 3)), np.zeros((2, 3)), np.zeros((4, 2)), 0.0,
     np.zeros((3, 2, 1)), [[0.0, 0.0]] * 2, [[0.0], [0.0, 0.0], [0.0, 0.0]], None,
     [["0.1", "0.2"]] * 3, np.zeros((3, 2), complex), np.zeros((3, 2), bool),
     np.full((3, 2), np.nan), np.full((3, 2), np.inf)],
)  # fmt: skip
def test_actions_that_are_none_are_refused(actions):
    lanes = VehicleVectorEnvironment(LANES, "constant_mu")
    lanes.reset(seed=0)
    with pytest.raises(ArgumentError, match="action"):
        lanes.step(actions)


def test_the_action_of_a_lane_that_starts_again_is_ignored():
    lanes = VehicleVectorEnvironment(2, "constant_mu", max_episode_steps=1)
    lanes.reset(seed=0)
    lanes.step(np.zeros((2, 2)))
    observation, reward, *_ = lanes.step(np.full((2, 2), np.nan))
    assert (observation["time"] == 0.0).all()
    assert (reward == 0.0).all()


@pytest.mark.parametrize("count", [0, -1, 1.5, True, None, "3"])
def test_lanes_are_counted(count):
    with pytest.raises(InputError, match="num_envs"):
        VehicleVectorEnvironment(count, "constant_mu")


@pytest.mark.parametrize("limit", [0, -2, 2.5, True, "5"])
def test_a_limit_of_steps_is_a_count(limit):
    with pytest.raises(InputError, match="max_episode_steps"):
        VehicleVectorEnvironment(1, "constant_mu", max_episode_steps=limit)


def test_nothing_but_a_reset_comes_first():
    lanes = VehicleVectorEnvironment(2, "constant_mu")
    for call in (
        lambda: lanes.step(np.zeros((2, 2))),
        lanes.driver_actions,
        lambda: lanes.reset(options={"reset_mask": np.array([True, False])}),
    ):
        with pytest.raises(NotResetError, match="reset"):
            call()
    assert issubclass(NotResetError, gymnasium.error.ResetNeeded)


@pytest.mark.parametrize(
    "mask",
    [[True, False], np.array([1, 0]), np.array([True]), np.array([[True, False]]),
     np.array([False, False]), True],
)  # fmt: skip
def test_what_is_no_mask_is_refused(mask):
    lanes = VehicleVectorEnvironment(2, "constant_mu")
    lanes.reset(seed=0)
    with pytest.raises(ArgumentError, match="reset_mask"):
        lanes.reset(options={"reset_mask": mask})


def test_a_reset_leaves_the_options_as_they_were():
    lanes = VehicleVectorEnvironment(2, "constant_mu")
    options = {"reset_mask": np.array([True, True]), "mu": 0.3}
    lanes.reset(options=options)
    assert set(options) == {"reset_mask", "mu"}


def test_a_lane_that_has_ended_is_not_stepped_when_nobody_resets_it():
    lanes = VehicleVectorEnvironment(2, "constant_mu", 1, autoreset_mode="Disabled")
    lanes.reset(seed=0)
    lanes.step(np.zeros((2, 2)))
    with pytest.raises(NotResetError, match=r"lanes \[0, 1\] have ended"):
        lanes.step(np.zeros((2, 2)))


def test_an_unknown_autoreset_mode_is_refused():
    with pytest.raises(ArgumentError, match="NextStep, SameStep, Disabled"):
        VehicleVectorEnvironment(2, "constant_mu", autoreset_mode="never")


@pytest.mark.parametrize("seed", [np.int64(5), np.array(5)])
def test_a_single_environment_takes_numpys_integers(seed):
    environment = VehicleEnvironment("double_lane_change_ice")
    one, _ = environment.reset(seed=seed)
    other, _ = environment.reset(seed=5)
    assert one == other


@pytest.mark.parametrize("seed", [-1, 1.0, "5", True, [5]])
def test_a_single_environment_refuses_what_is_no_seed(seed):
    with pytest.raises(ArgumentError, match="seed"):
        VehicleEnvironment("constant_mu").reset(seed=seed)


def test_a_single_environment_is_stepped_within_an_episode_only():
    environment = VehicleEnvironment("constant_mu")
    environment.scenario = environment.scenario.model_copy(update={"horizon": 0.002})
    with pytest.raises(NotResetError, match="before step"):
        environment.step(np.zeros(2))
    environment.reset(seed=0)
    environment.step(np.zeros(2))
    assert environment.step(np.zeros(2))[3]
    with pytest.raises(NotResetError, match="ended"):
        environment.step(np.zeros(2))


def test_friction_and_speed_of_one_episode():
    environment = VehicleEnvironment("friction_step")
    _, info = environment.reset(seed=0, options={"mu": 0.3, "speed": np.float32(12.0)})
    assert info["truth"]["mu_front"] == 0.3
    assert info["truth"]["speed_x"] == 12.0
    assert environment.reset()[1]["truth"]["mu_front"] == 0.9
    split = VehicleEnvironment("split_mu_braking")
    truth = split.reset(seed=0, options={"mu": 0.3})[1]["truth"]
    assert {truth[f"mu_{wheel}"] for wheel in ("front_left", "front_right")} == {0.3}


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("constant_mu", {"friction": 0.3}, "unknown option 'friction'"),
        ("constant_mu", {"mU": 0.3}, "did you mean 'mu'"),
        ("constant_mu", {"mu": 0.0}, "allowed is 0.01 to 2"),
        ("constant_mu", {"mu": "0.3"}, "allowed is 0.01 to 2"),
        ("constant_mu", {"mu": np.nan}, "allowed is 0.01 to 2"),
        ("constant_mu", {"mu": True}, "allowed is 0.01 to 2"),
        ("constant_mu", {"speed": -1.0}, "allowed is 0 to 100"),
        ("constant_mu", [("mu", 0.3)], "must be a dict"),
        ("constant_mu", {1: 2}, "unknown option 1"),
        ("two_turns_bicycle", {"mu": 0.3}, "no friction limit"),
        ("two_turns_bicycle", {"speed": 0.5}, "needs 1 and above"),
    ],
)
def test_options_that_make_no_sense_are_refused(name, options, said):
    environment = VehicleEnvironment(name)
    with pytest.raises(ArgumentError, match=said):
        environment.reset(seed=0, options=options)


def test_idealised_channels_come_on_request_only():
    idealised = {"speed_x_rate", "wheel_acceleration_front", "wheel_acceleration_rear"}
    plain, full = (
        VehicleEnvironment("constant_mu"),
        VehicleEnvironment("constant_mu", idealised=True),
    )
    assert not idealised & set(plain.observation_space.spaces)
    assert not idealised & set(plain.reset(seed=0)[0])
    assert idealised <= set(full.reset(seed=0)[0])
    lanes = VehicleVectorEnvironment(1, "constant_mu", idealised=True)
    assert idealised <= set(lanes.reset(seed=0)[0])


def test_streams_of_lanes_are_those_of_gymnasium():
    lanes = VehicleVectorEnvironment(2, "constant_mu")
    lanes.reset(seed=8)
    stream, _ = seeding.np_random(9)
    assert lanes.np_random[1].integers(2**31) == stream.integers(2**31)
