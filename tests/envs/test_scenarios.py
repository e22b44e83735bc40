"""Scenario files: what ships loads and records, mistakes are named."""

import numpy as np
import pytest
from longitudinal_drive import ACCURATE, clean, custom

from gripbench.configuration import CONFIGS, read_toml
from gripbench.envs.worlds import load_scenario, record, scenario_files, simulation_of
from gripbench.errors import InputError

PAPER = tuple(f"li2014_{name}" for name in ACCURATE)
BASE = (CONFIGS / "scenarios" / "constant_mu.toml").read_text()


@pytest.mark.parametrize("name", sorted(scenario_files()))
def test_shipped_scenarios_load(name):
    scenario = load_scenario(name)
    assert scenario.name == name
    assert scenario.all_sensors()


def test_environment_ids_are_unique():
    ids = [i for name in scenario_files() if (i := load_scenario(name).environment)]
    assert len(set(ids)) == len(ids)


@pytest.mark.parametrize("name", ACCURATE)
def test_accurate_and_paper_scenarios_differ_in_the_integrator_only(name):
    ours, paper = load_scenario(name), load_scenario(f"li2014_{name}")
    assert paper.integrator == "paper"
    assert ours.integrator == "ros3"
    for key in ("friction", "driver", "road_grade", "horizon", "vehicle", "initial_speed"):
        assert getattr(ours, key) == getattr(paper, key)
    assert ours.all_sensors() == paper.all_sensors()


def test_mu_step_and_large_torque():
    truth = record(clean("friction_step"), 0).truth
    at = np.searchsorted(truth["time"], 10.0 + 1e-9)
    assert truth["mu_front"][at - 2] == 0.9
    assert truth["mu_front"][at] == 0.5
    torque = record(clean("large_torque"), 0).truth
    expected = 2150.0 * np.sin(np.pi * 12.4995 / 25.0)
    assert torque["torque_front"][12500] == pytest.approx(expected, rel=1e-9)
    assert np.all(torque["torque_front"][25_001:] == 0.0)


def test_noisy_row_has_the_friction_step_and_a_worse_accelerometer():
    noisy, step = load_scenario("noisy_acceleration"), load_scenario("friction_step")
    assert noisy.friction == step.friction
    sensor = noisy.all_sensors()["accel_x"]
    assert sensor.bias == 0.1
    assert sensor.noise_std**2 == pytest.approx(0.1)
    assert step.all_sensors()["accel_x"].noise_std == 0.0


def test_recording_is_the_same_again_and_differs_by_seed():
    scenario = load_scenario("noisy_acceleration").model_copy(update={"horizon": 2.0})
    first, again, other = (record(scenario, seed) for seed in (3, 3, 4))
    assert first.truth.tobytes() == again.truth.tobytes()
    assert first.observations.tobytes() == again.observations.tobytes()
    assert first.truth.tobytes() != other.truth.tobytes()
    assert first.notes == {"friction_step": 10.0}


def test_process_noise_has_the_size_that_it_names():
    """The jump of the wheel speed at a sample, relative; its effect on the next is the plant's."""
    scenario = load_scenario("constant_mu").model_copy(update={"horizon": 5.0})
    noisy = simulation_of(scenario)
    quiet = simulation_of(clean("constant_mu", horizon=5.0))
    noisy.reset(1)
    quiet.reset(1)
    jumps = []
    for _ in range(3000):
        quiet._x[:] = noisy._x
        quiet._step = noisy._step
        ahead, calm = noisy.advance(noisy.drive()), quiet.advance(quiet.drive())
        jumps.append(ahead["wheel_speed_front"][0] / calm["wheel_speed_front"][0] - 1.0)
    assert np.std(jumps) == pytest.approx(3.6e-4, rel=0.05)
    assert abs(np.mean(jumps)) < 3e-5


def test_stepping_gives_the_bytes_of_the_run():
    scenario = load_scenario("combined_traction_braking").model_copy(update={"horizon": 3.0})
    run = simulation_of(scenario).run(7)
    stepped = simulation_of(scenario)
    samples = [stepped.reset(7)]
    samples += [stepped.advance(stepped.drive()) for _ in range(scenario.steps)]
    assert np.concatenate(samples).tobytes() == run.tobytes()


def _file(tmp_path, old, new):
    assert old in BASE
    path = tmp_path / "mine.toml"
    path.write_text(BASE.replace(old, new, 1))
    return path


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("horizon = 30.0", "horizn = 30.0", "unknown key 'horizn': did you mean 'horizon'"),
        ("horizon = 30.0", "horizon = 0.0", r"key 'horizon'.*greater than 0.*\(given 0\.0\)"),
        ("horizon = 30.0", "horizon = -3.0", "key 'horizon'.*greater than 0"),
        ("horizon = 30.0", "horizon = 1e-4", "shorter than one sample"),
        ("horizon = 30.0", "horizon = 31.0", "friction ends at 30 s, before the horizon"),
        ("horizon = 30.0", "sample_time = 0.0\nhorizon = 30.0", "key 'sample_time'.*to 0.00001"),
        ("horizon = 30.0", "sample_time = 1.0\nhorizon = 30.0", "key 'sample_time'.*equal to 0.1"),
        ("horizon = 30.0", "horizon = 30.0\nscore_from = 40.0", "score_from 40 s is not before"),
        ("horizon = 30.0", 'horizon = "long"', "key 'horizon'.*valid number"),
        ("first = 0.9", "first = nan", r"key 'friction\.0\.first'.*finite"),
        ("first = 0.9", "first = 5.0", "key 'friction'.*reaches 5; allowed is 0.01 to 2"),
        ("start = 1.0, end = 20.0", "start = 0.5, end = 20.0", "pieces overlap at 0.5 s"),
        ("[driver]", "[sensors.speed_gps]\nrate = 5.0\n[driver]", "mine.toml: sensors.speed_gps"),
        ("last = 0.9", "last = 0.9, amplitude = 5.0", "reaches -4.1; allowed is 0.01 to 2"),
        ("last = 150.0", "last = 1e300", "key 'driver.front'.*allowed is -5000 to 5000"),
        ("horizon = 30.0", "horizon = 29.9995", "29.9995 s is not a whole number of samples"),
        ("horizon = 30.0", "horizon = true", "key 'horizon'.*valid number"),
        ("horizon = 30.0", 'horizon = "30"', "key 'horizon'.*valid number"),
        ("horizon = 30.0", "sample_time = 1e-5\nhorizon = 36000.0", "3.6e.09 samples of 1e-05 s"),
        ("first = 0.0, last = 150.0", "first = nan, last = 150.0", r"driver\.front\.0\.first"),
        ("end = 1.0", "ende = 1.0", r"driver\.front\.0\.end"),
        ("start = 1.0, end = 20.0", "start = 20.0, end = 1.0", "is not after start"),
        ("wheel_speed_noise = 3.6e-4", "wheel_speed_noise = -1.0", "'wheel_speed_noise'"),
        ('"ros3"', '"euler"', "key 'integrator'.*'ros3', 'rk4' or 'paper'"),
        ('"ros3"', '"paper"', "wheel_speed_noise has no meaning"),
        ('"longitudinal"', '"longitudnal"', "key 'world'.*did you mean 'longitudinal'"),
        ("[driver]", "[sensors.acel_x]\n[driver]", "'acel_x': did you mean 'accel_x'"),
        ("[driver]", "[sensors.accel_x]\nnoise = 1.0\n[driver]", "did you mean 'noise_"),
        ('"gripbench/ConstantMu-v0"', '"ConstantMu"', "key 'environment'"),
    ],
)
def test_mistakes_name_file_key_and_remedy(tmp_path, old, new, message):
    path = _file(tmp_path, old, new)
    with pytest.raises(InputError, match=message) as caught:
        load_scenario(str(path))
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_unknown_names_suggest_the_nearest(tmp_path):
    with pytest.raises(InputError, match="unknown scenario 'constant_nu': did you mean"):
        load_scenario("constant_nu")
    path = _file(tmp_path, '"li2014"', '"li2015"')
    scenario = load_scenario(str(path))
    with pytest.raises(InputError, match="unknown vehicle 'li2015': did you mean 'li2014'"):
        record(scenario, 0)
    path = _file(tmp_path, 'sensor_suite = "li2014"', 'sensor_suite = "li214"')
    with pytest.raises(InputError, match="unknown sensor suite 'li214': did you mean 'li2014'"):
        load_scenario(str(path)).all_sensors()


def test_gaps_in_friction_are_refused():
    gap = [{"start": 0.0, "end": 4.0, "first": 0.9, "last": 0.9}]
    gap.append({"start": 5.0, "end": 10.0, "first": 0.5, "last": 0.5})
    with pytest.raises(InputError, match="gap or an overlap at 5 s"):
        custom([(0.0, 1.0, 0.0, 0.0)], friction=gap)


def test_a_written_scenario_reads_back():
    for name in PAPER:
        content = read_toml(scenario_files()[name])
        assert load_scenario(name).model_dump(mode="json", exclude_unset=True) == content
