"""Pictures of a drive: what they show, when they are drawn, and Gymnasium's own video recorder."""

import copy
import pickle

import gymnasium
import matplotlib
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from gripbench.envs.gym.arguments import ArgumentError, NotResetError
from gripbench.envs.gym.environment import VehicleEnvironment
from gripbench.envs.gym.picture import HEIGHT, WIDTH
from gripbench.envs.gym.vector_environment import VehicleVectorEnvironment
from gripbench.envs.gym.view import Body, turned, view_of
from gripbench.envs.vehicles import GRAVITY, load_vehicle
from gripbench.envs.worlds import load_scenario, record


@pytest.fixture(autouse=True)
def _no_window(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "agg")
    matplotlib.use("agg")


def drive(environment, steps):
    for _ in range(steps):
        environment.step(environment.unwrapped.driver_action())


def test_the_checker_finds_nothing_with_both_modes():
    environment = gymnasium.make("gripbench/SlalomSnow-v0", disable_env_checker=True)
    check_env(environment.unwrapped)


@pytest.mark.parametrize("name", ["friction_step", "slalom_snow", "two_turns_bicycle"])
def test_a_frame_follows_the_drive(name):
    environment = VehicleEnvironment(name, render_mode="rgb_array")
    environment.reset(seed=1)
    first = environment.render()
    assert first.shape == (HEIGHT, WIDTH, 3)
    assert first.dtype == np.uint8
    assert 0.1 < (first < 250).any(axis=2).mean() < 0.9  # neither empty nor full
    environment.step(environment.driver_action())
    assert environment.render() is first or environment.scenario.sample_time >= 0.04
    drive(environment, round(0.5 / environment.scenario.sample_time))
    assert (environment.render() != first).any()


def test_the_same_drive_gives_the_same_frame_and_other_friction_another():
    frames = []
    for mu in (0.25, 0.25, 0.9):
        environment = VehicleEnvironment("slalom_snow", render_mode="rgb_array")
        environment.reset(seed=1, options={"mu": mu})
        frames.append(environment.render())
    assert np.array_equal(frames[0], frames[1])
    assert (frames[0] != frames[2]).any()


def test_rendering_changes_nothing_of_the_drive():
    plain = VehicleEnvironment("slalom_snow")
    shown = VehicleEnvironment("slalom_snow", render_mode="rgb_array")
    for environment in (plain, shown):
        environment.reset(seed=2)
        drive(environment, 30)
    shown.render()
    action = plain.driver_action()
    assert plain.step(action)[0] == shown.step(action)[0]


def test_a_view_is_the_truth_of_each_world():
    for name in ("friction_step", "slalom_snow", "two_turns_bicycle"):
        scenario = load_scenario(name)
        short = scenario.model_copy(update={"horizon": 8.0, "score_from": 0.0})
        truth = record(short, 0).truth[-1]
        body = Body.of(load_vehicle(scenario.vehicle).values())
        view = view_of(truth, body)
        lateral = truth["force_y_front"] if "force_y_front" in truth.dtype.names else 0.0
        assert view.force[:2, 1].sum() == pytest.approx(lateral, rel=1e-12, abs=1e-9)
        if name == "friction_step":
            assert view.force[2:, 0].sum() == pytest.approx(truth["force_x_rear"])
            limit = 0.9 * body.loads[2:].sum()
            assert view.used[2] == pytest.approx(truth["force_x_rear"] / limit)
        mass = load_vehicle(scenario.vehicle).values()["mass"]
        assert body.loads.sum() == pytest.approx(mass * GRAVITY)


def test_a_quarter_turn_to_the_left():
    assert turned(np.array([[1.0, 0.0]]), 0.5 * np.pi)[0] == pytest.approx([0.0, 1.0])


def test_the_path_lies_where_the_car_starts_and_heads():
    environment = VehicleEnvironment("slalom_snow")
    _, info = environment.reset(seed=3)
    path = environment.simulation.path()
    truth = info["truth"]
    assert path[0] == pytest.approx([truth["position_x"], truth["position_y"]])
    ahead = path[4] - path[0]
    assert np.arctan2(ahead[1], ahead[0]) == pytest.approx(truth["yaw"])


def test_a_window_is_asked_for_by_name():
    environment = VehicleEnvironment("slalom_snow", render_mode="human")
    environment.reset(seed=0)
    drive(environment, 3)
    assert environment.render() is None
    environment.close()


@pytest.mark.parametrize("mode", ["ansi", "", "RGB", 3])
def test_an_unknown_mode_is_refused(mode):
    for make in (VehicleEnvironment, lambda *a, **k: VehicleVectorEnvironment(2, *a, **k)):
        with pytest.raises(ArgumentError, match="human, rgb_array"):
            make("constant_mu", render_mode=mode)


def test_there_is_no_frame_before_an_episode():
    with pytest.raises(NotResetError, match="before render"):
        VehicleEnvironment("constant_mu", render_mode="rgb_array").render()


def test_lanes_give_the_frames_of_single_environments():
    lanes = VehicleVectorEnvironment(2, "slalom_snow", render_mode="rgb_array")
    lanes.reset(seed=4)
    single = VehicleEnvironment("slalom_snow", render_mode="rgb_array")
    single.reset(seed=5)
    for _ in range(25):
        lanes.step(lanes.driver_actions())
        single.step(single.driver_action())
    frames = lanes.render()
    assert len(frames) == 2
    assert np.array_equal(frames[1], single.render())


@pytest.mark.parametrize("twin", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_copies_go_on_alike(twin):
    environment = VehicleEnvironment("slalom_snow", render_mode="rgb_array")
    environment.reset(seed=0)
    environment.render()
    other = twin(environment)
    for one in (environment, other):
        drive(one, 40)
    assert np.array_equal(environment.render(), other.render())


def test_gymnasiums_recorder_writes_a_video(tmp_path):
    pytest.importorskip("moviepy")
    environment = gymnasium.make("gripbench/SplitMuBraking-v0", render_mode="rgb_array")
    recorder = gymnasium.wrappers.RecordVideo(environment, str(tmp_path / "videos"))
    recorder.reset(seed=0)
    drive(recorder, 30)
    recorder.close()
    (video,) = (tmp_path / "videos").glob("*.mp4")
    assert video.stat().st_size > 1000
