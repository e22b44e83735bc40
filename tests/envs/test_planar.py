"""Runs of the planar world: determinism, ends, intended sideslip, kinematics, refusals."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from planar_cases import OPEN_LOOP, SCENARIOS, held, scenario_of, simulation_of, vehicle_with

from gripbench.envs.instruments.suite import SensorSuite
from gripbench.envs.plants.planar.truth import TRUTH
from gripbench.envs.plants.planar.world import PlanarSimulation
from gripbench.envs.vehicles import load_vehicle
from gripbench.envs.worlds import load_scenario, record
from gripbench.errors import InputError


@pytest.mark.parametrize("name", SCENARIOS)
def test_one_loop_and_single_steps_give_identical_bytes(name):
    simulation = simulation_of(name, horizon=7.0, score_from=0.0)
    whole = simulation.run(5)
    stepped = [simulation.reset(5)]
    while not simulation.termination and len(stepped) <= round(7.0 / simulation.sample_time):
        stepped.append(simulation.advance(simulation.drive()))
    assert np.concatenate(stepped).tobytes() == whole.tobytes()
    assert simulation.fresh().run(5).tobytes() == whole.tobytes()


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_scenario_runs_to_its_end_with_finite_truth(name):
    recording = record(load_scenario(name), 2)
    assert recording.termination == ("stop" if "brak" in name else "")
    for samples in (recording.truth, recording.observations):
        assert all(np.isfinite(samples[field]).all() for field in samples.dtype.names)
    for wheel in ("front_left", "front_right", "rear_left", "rear_right"):
        used, mu = recording.truth[f"mu_used_{wheel}"], recording.truth[f"mu_{wheel}"]
        assert (used <= mu * (1.0 + 1e-9)).all()
    for angle in ("yaw", "course", "sideslip"):
        assert np.abs(recording.truth[angle]).max() <= math.pi


@pytest.mark.parametrize(
    ("name", "intended", "tolerance"),
    [
        ("double_lane_change_snow", 12.8, 0.1),
        ("slalom_snow", 18.8, 0.1),
        ("double_lane_change_ice", 7.8, 0.1),
        ("slalom_ice", 14.2, 0.1),
        ("dakhlallah_limit", 32.0, 0.1),
        ("two_turns", 1.05, 0.05),
    ],
)
def test_manoeuvres_saturate_the_tyres_as_they_are_meant_to(name, intended, tolerance):
    truth = simulation_of(name).run(1)
    assert np.degrees(np.abs(truth["sideslip"]).max()) == pytest.approx(intended, rel=tolerance)


def test_lateral_acceleration_of_the_open_loop_cases():
    for name, intended in [("dakhlallah_mild", 4.2), ("dakhlallah_hard", 7.1)]:
        truth = simulation_of(name).run(1)
        lateral = (truth["force_y_front"] + truth["force_y_rear"]) / 1550.0
        assert np.abs(lateral).max() == pytest.approx(intended, rel=0.1)


def test_heading_is_drawn_by_the_seed_and_changes_nothing_else():
    runs = [simulation_of("double_lane_change_snow", horizon=8.0).run(seed) for seed in range(4)]
    assert len({run["yaw"][0] for run in runs}) == 4
    for run in runs[1:]:
        for name in ("speed_x", "speed_y", "yaw_rate", "accel_y", "magnetic_field_z"):
            same = run[name].tobytes() == runs[0][name].tobytes()
            assert same != (name == "magnetic_field_z")
    headings = [simulation_of(OPEN_LOOP, horizon=0.01).reset(seed)["yaw"][0] for seed in range(200)]
    assert np.histogram(headings, bins=4, range=(-math.pi, math.pi))[0].min() > 30


# --- ends


def test_a_spin_ends_the_run():
    steering = {"kind": "step_steer", "amplitude": 0.1, "start": 0.1}
    simulation = simulation_of(OPEN_LOOP, speed=35.0, steering=steering, road={"mu": 0.7})
    simulation._plant["tyre_y_rear"] *= 0.3  # oversteers beyond its critical speed
    truth = simulation.run(0)
    assert simulation.termination == "spin"
    assert truth["time"][-1] < 5.0
    assert abs(truth["sideslip"][-1]) > math.radians(60.0)
    assert np.isfinite(truth.view(np.float64)).all()


def test_a_tall_vehicle_rolls_over_and_a_low_one_slides():
    steering = {"kind": "step_steer", "amplitude": 0.3, "start": 0.1}
    road = {"mu": 1.1}
    tall = vehicle_with("dakhlallah2008", cg_height=1.3)
    simulation = simulation_of(OPEN_LOOP, vehicle=tall, steering=steering, road=road)
    truth = simulation.run(0)
    assert simulation.termination == "roll_over"
    assert truth["force_z_front_left"][-1] == truth["force_z_rear_left"][-1] == 0.0
    low = simulation_of(OPEN_LOOP, steering=steering, road=road)
    low.run(0)
    assert low.termination != "roll_over"


def test_too_fast_a_lane_change_leaves_the_road_or_spins():
    simulation = simulation_of("double_lane_change_ice", speed=30.0, off_road=2.5)
    truth = simulation.run(0)
    assert simulation.termination in ("off_road", "spin")
    assert truth["time"][-1] < 17.0
    assert np.isfinite(truth.view(np.float64)).all()


def test_an_action_that_is_not_finite_is_refused():
    simulation = simulation_of(OPEN_LOOP)
    simulation.reset(0)
    with pytest.raises(InputError, match="not finite"):
        simulation.advance(np.array([math.nan, 0.0, 0.0, 0.0, 0.0]))


def test_an_exploding_plant_ends_named_and_without_nan():
    simulation = simulation_of(OPEN_LOOP, horizon=1.0)
    simulation._plant["inverse_yaw_inertia"] = 1e200
    simulation._planned[:, 0] = 0.1
    truth = simulation.run(0)
    assert simulation.termination in ("diverged", "spin", "roll_over")
    assert np.isfinite(truth.view(np.float64)).all()


def test_reversing_is_no_spin():
    simulation = simulation_of(OPEN_LOOP, speed=0.0, stop_speed=0.0)
    simulation.reset(0)
    simulation._run.state[0] = -4.0
    simulation._run.state[3:7] = -4.0 / 0.306
    truth = held(simulation, [0.02, 0.0, 0.0, 0.0, 0.0], 500)
    assert simulation.termination == ""
    assert truth["speed_x"][-1] < -3.0


def test_the_road_goes_straight_on_behind_the_end_of_the_path():
    simulation = simulation_of(
        "two_turns", path={"kind": "turns", "segments": [{"length": 20.0}]}, horizon=30.0
    )
    truth = simulation.run(1)
    assert simulation.termination == ""
    assert math.hypot(truth["position_x"][-1], truth["position_y"][-1]) > 850.0
    assert np.abs(truth["sideslip"]).max() < 1e-9


@settings(max_examples=40)
@given(
    speed=st.sampled_from([0.0, 0.3, 2.0, 15.0, 60.0]),
    tyre=st.sampled_from(["brush", "dugoff", "magic_formula"]),
    mu=st.sampled_from([0.02, 0.3, 1.2]),
    vehicle=st.sampled_from(["dakhlallah2008", "yoon2015_pickup"]),
    actions=st.lists(
        st.tuples(st.floats(-1.2, 1.2), *[st.floats(-6000.0, 6000.0)] * 4), min_size=1, max_size=8
    ),
)
def test_no_action_whatever_leads_to_nan(speed, tyre, mu, vehicle, actions):
    simulation = simulation_of(
        OPEN_LOOP | {"vehicle": vehicle, "tyre": tyre, "stop_speed": 0.0, "sample_time": 0.01},
        speed=speed,
        road={"mu": mu, "bank": 0.1, "grade": -0.1},
    )
    simulation.reset(0)
    for action in actions:
        for _ in range(20):
            sample = simulation.advance(np.array(action))
            assert np.isfinite(sample.view(np.float64)).all()
            for wheel in ("front_left", "front_right", "rear_left", "rear_right"):
                assert sample[f"mu_used_{wheel}"][0] <= mu * (1.0 + 1e-9)
                assert sample[f"force_z_{wheel}"][0] >= 0.0
            if simulation.termination:
                assert simulation.termination in ("spin", "roll_over")
                return


# --- kinematics and instruments


@pytest.mark.parametrize("name", ["public_road", "double_lane_change_snow", "banked_turn"])
def test_velocity_over_ground_changes_as_accelerometer_and_attitude_say(name):
    truth = simulation_of(name, horizon=26.0, sample_time=0.002).run(3)
    rotation = _attitude(truth)
    force = np.stack([truth[f"accel_{axis}"] for axis in "xyz"], axis=1)
    expected = np.einsum("kij,kj->ki", rotation, force)
    for axis, name_of in enumerate(("velocity_north", "velocity_west")):
        change = np.gradient(truth[name_of], truth["time"])
        error = (change - expected[:, axis])[2:-2]
        assert np.sqrt(np.mean(error**2)) < 0.02
        assert np.sqrt(np.mean(change**2)) > 0.2


@pytest.mark.parametrize("name", ["public_road", "slalom_snow"])
def test_attitude_turns_as_the_gyros_say(name):
    truth = simulation_of(name, horizon=26.0).run(3)
    p, q, r = (truth[f"{axis}_rate"] for axis in ("roll", "pitch", "yaw"))
    roll, pitch = truth["roll"], truth["pitch"]
    turning = q * np.sin(roll) + r * np.cos(roll)
    rates = {
        "yaw": turning / np.cos(pitch),
        "pitch": q * np.cos(roll) - r * np.sin(roll),
        "roll": p + turning * np.tan(pitch),
    }
    for angle, rate in rates.items():
        change = np.gradient(np.unwrap(truth[angle]), truth["time"])
        error = (change - rate)[2:-2]
        assert np.sqrt(np.mean(error**2)) < 2e-3
        assert np.sqrt(np.mean(change**2)) > 2e-3


def _attitude(truth):
    cy, sy = np.cos(truth["yaw"]), np.sin(truth["yaw"])
    cp, sp = np.cos(truth["pitch"]), np.sin(truth["pitch"])
    cr, sr = np.cos(truth["roll"]), np.sin(truth["roll"])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    ).transpose(2, 0, 1)


def test_magnetic_field_is_the_earths_in_the_axes_of_the_body():
    truth = simulation_of("slalom_snow", horizon=12.0).run(3)
    earth = np.einsum(
        "kij,kj->ki",
        _attitude(truth),
        np.stack([truth[f"magnetic_field_{axis}"] for axis in "xyz"], axis=1),
    )
    assert np.allclose(earth, [1.58e-5, 0.0, -5.32e-5], atol=1e-12)


def test_at_rest_on_a_slope_the_accelerometer_feels_gravity_alone():
    simulation = simulation_of(
        OPEN_LOOP, speed=0.0, stop_speed=0.0, road={"mu": 0.8, "grade": 0.08, "bank": -0.06}
    )
    simulation.reset(0)
    last = held(simulation, [0.0, *[-2000.0] * 4], 3000)[-1]
    size = math.sqrt(sum(last[f"accel_{axis}"] ** 2 for axis in "xyz"))
    assert size == pytest.approx(9.81, abs=0.01)
    assert last["accel_x"] == pytest.approx(-9.81 * math.sin(last["pitch"]), abs=0.02)
    assert last["accel_y"] == pytest.approx(9.81 * math.sin(last["roll"]), abs=0.02)


def test_a_late_gps_says_when_its_velocity_was_true():
    scenario = scenario_of("slalom_snow", horizon=14.0)
    truth = PlanarSimulation(scenario, load_vehicle(scenario.vehicle)).run(1)
    perfect = {
        channel: sensor.model_copy(update={"noise_std": 0.0})
        for channel, sensor in scenario.all_sensors().items()
    }
    seen = SensorSuite(perfect, TRUTH, scenario.sample_time, 1).observe(truth)
    new = np.flatnonzero((seen["velocity_north_new"] == 1.0) & (seen["time"] > 0.5))
    assert len(new) == pytest.approx(5 * 13.5, abs=2)
    assert np.allclose(seen["time"][new] - seen["gps_time"][new], 0.4)
    place = np.searchsorted(truth["time"], seen["gps_time"][new] - 1e-9)
    for channel in ("velocity_north", "velocity_west", "velocity_up", "course"):
        assert np.array_equal(seen[f"{channel}_new"], seen["gps_time_new"])
        assert np.array_equal(seen[channel][new], truth[channel][place])


# --- friction of the road


def test_split_friction_is_seen_by_the_wheels_on_each_side():
    truth = simulation_of("split_mu_braking").run(1)
    assert (truth["mu_front_left"] == 0.8).all()
    assert (truth["mu_rear_right"] == 0.25).all()
    braking = truth[(truth["time"] > 5.0) & (truth["speed_x"] > 5.0)]
    assert (braking["force_x_front_left"] < 1.5 * braking["force_x_front_right"]).all()
    heading = truth["yaw"][0]
    across = math.cos(heading) * truth["position_y"] - math.sin(heading) * truth["position_x"]
    assert np.abs(across).max() < 1.0  # the driver holds the lane


def test_friction_jumps_under_the_front_wheels_first_and_is_noted():
    simulation = simulation_of("mu_jump_lane_change")
    truth = simulation.run(1)
    front = truth["time"][np.argmax(truth["mu_front_left"] < 0.25)]
    rear = truth["time"][np.argmax(truth["mu_rear_left"] < 0.25)]
    assert rear - front == pytest.approx(3.658 / 14.0, abs=0.03)
    assert simulation.notes() == {"mu_jump_time": pytest.approx(front, abs=0.05)}
    assert truth["mu"][-1] == pytest.approx(0.15)
    assert simulation_of("slalom_snow", horizon=7.0).notes() == {}


# --- refusals


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"speed": -3.0}, "key 'speed'"),
        ({"sample_time": 0.0015}, "key 'sample_time': must be a multiple"),
        ({"road": {"mu": 0.0}}, "key 'road.mu'"),
        ({"road": {"mu": 0.8, "mu_after": 0.3}}, "mu_after and mu_jump_at belong together"),
        ({"road": {"mu": 0.8, "turn_bank": 0.1}}, "turn_bank needs a path"),
        ({"tyre": "fiala"}, "key 'tyre'"),
        ({"path": {"kind": "double_lane_change"}}, "either 'path' or 'steering'"),
        ({"steering": {"kind": "zigzag", "amplitude": 0.1}}, "key 'steering'"),
        ({"driver": {"preview_tme": 1.0}}, "did you mean 'preview_time'"),
        ({"magnetic": {"pulse_low": 2e-6, "pulse_high": 1e-6}}, "pulse_high is below pulse_low"),
        ({"speed_wave": {"amplitude": 30.0}}, "speed_wave.amplitude is larger than speed"),
    ],
)
def test_impossible_scenarios_are_refused_with_the_key(changes, message):
    with pytest.raises(InputError, match=message) as caught:
        scenario_of(OPEN_LOOP, **changes)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("segment", "message"),
    [
        ({"length": 5.0, "radius": 20.0, "angle": 1.0}, "either 'length' or both"),
        ({"radius": 20.0}, "either 'length' or both"),
        ({"radius": 0.5, "angle": 1.0}, "less than any car turns"),
        ({"radius": 20.0, "angle": 1.0, "transition": 30.0}, "does not fit into an arc"),
    ],
)
def test_impossible_paths_are_refused_with_the_key(segment, message):
    with pytest.raises(InputError, match=f"key 'path.*{message}"):
        scenario_of("two_turns", path={"kind": "turns", "segments": [segment]})


def test_a_vehicle_without_what_the_plant_needs_is_refused():
    with pytest.raises(InputError, match="needs the vehicle parameter 'cg_height'"):
        simulation_of(OPEN_LOOP, vehicle=load_vehicle("li2014"))
    light = vehicle_with("dakhlallah2008", wheel_inertia=1e-3)
    with pytest.raises(InputError, match="'wheel_inertia' is"):
        simulation_of(OPEN_LOOP, vehicle=light)
