"""Filters on production sensors: closed forms, a filterpy twin, and drives of the population."""

from functools import cache

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from scipy.linalg import expm

from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.envs.vehicles import load_vehicle
from gripbench.envs.worlds import record
from gripbench.methods.baselines.bicycle_on_paper import steady_sideslip, steady_yaw_rate
from gripbench.methods.blocks.single_track import brush_axle, motion
from gripbench.methods.sideslip_friction_bank import SideslipFrictionBank
from gripbench.methods.single_track_kalman_filter import SingleTrackKalmanFilter, linear_model
from gripbench.methods.speed_fusion import SpeedFusion

CAR = load_vehicle("yoon2015_pickup").values()


@cache
def drive(name, seed=1000, horizon=None):
    """Return a drive of the population at production spread; its seed was never tested."""
    scenario = find_scenario(name)
    if horizon is not None:
        scenario = scenario.model_copy(update={"horizon": horizon})
    return record(scenario, seed)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def sideslip_error(method, recording):
    found = method.run(recording.vehicle, recording.observations)
    late = recording.truth["time"] >= recording.score_from
    return rms((found["sideslip"] - recording.truth["sideslip"])[late]), found, late


def params_of(**changes):
    values = CAR | changes
    return np.rec.array(np.array([tuple(values.values())], [(n, float) for n in values]))[0]


@pytest.mark.parametrize("limit", [2e3, 2e4])
def test_brush_slopes_are_derivatives(limit):
    for angle in (-0.3, -0.05, 0.01, 0.04, 0.5):
        force, slope, per_limit = brush_axle(angle, 1e5, limit)
        h = 1e-6
        above, below = brush_axle(angle + h, 1e5, limit)[0], brush_axle(angle - h, 1e5, limit)[0]
        assert slope == pytest.approx((above - below) / (2 * h), rel=1e-4, abs=1e-3)
        more, less = brush_axle(angle, 1e5, limit + 1)[0], brush_axle(angle, 1e5, limit - 1)[0]
        assert per_limit == pytest.approx((more - less) / 2, rel=1e-4, abs=1e-6)
        assert abs(force) <= limit
    assert brush_axle(1e-5, 1e5, limit)[0] == pytest.approx(1.0, rel=1e-3)


def test_motion_slopes_are_derivatives():
    params, speed, out, near = params_of(), 15.0, np.zeros((2, 7)), np.zeros((2, 7))
    point = np.array([-0.6, 0.3, 0.08, np.log(9e4), np.log(8e4), np.log(7e3)])

    def evaluate(p, target):
        front, rear = np.exp(p[3]), np.exp(p[4])
        limits = np.exp(p[5]), 0.8 * np.exp(p[5])
        motion(speed, p[:2], p[2], front, rear, *limits, params, target)
        return target[:, 0].copy()

    evaluate(point, out)
    for place, column in enumerate((1, 2, 6, 4, 5, 3)):
        step = np.zeros(6)
        step[place] = 1e-6
        slope = (evaluate(point + step, near) - evaluate(point - step, near)) / 2e-6
        scale = np.array([1.0, params.cg_to_front * params.mass / params.yaw_inertia])
        # the force turns with the wheel, which the slope to the steering angle leaves out
        tolerance = 0.05 * abs(out[:, 0]).max() if column == 6 else 1e-6
        np.testing.assert_allclose(out[:, column], slope, rtol=1e-4, atol=tolerance * scale.max())


def test_kalman_filter_is_its_filterpy_twin():
    recording = drive("two_turns@1", horizon=15.0)
    car, seen = recording.vehicle, recording.observations
    method = SingleTrackKalmanFilter("measured_speed")
    settings, params = (
        method.settings,
        np.rec.array(np.array([tuple(car.values())], [(n, float) for n in car]))[0],
    )
    found = method.run(car, seen)
    twin = KalmanFilter(2, 1)
    twin.P = np.diag([settings["speed_y_std"] ** 2, 1.0])
    model, key = np.zeros((3, 3)), (0.0, 0.0)
    worst, held = 0.0, None
    for k in range(1500):
        speed, steer = max(seen["speed_x"][k], 3.0), seen["steer_angle"][k]
        elapsed = seen["time"][k] - seen["time"][k - 1] if k else 0.0
        if k:
            if abs(elapsed - key[0]) > 1e-9 or abs(speed - key[1]) > 1e-3 * speed:
                key = (elapsed, speed)
                linear_model(model, speed, params)
                held = expm(model * elapsed)
            mean = 0.5 * (steer + seen["steer_angle"][k - 1])
            walk = np.array([settings["speed_y_walk"], settings["yaw_rate_walk"]])
            twin.predict(u=np.array([[mean]]), B=held[:2, 2:], F=held[:2, :2],
                         Q=np.diag(walk**2 * elapsed))  # fmt: skip
        span = elapsed or 0.01
        twin.update(seen["yaw_rate"][k], R=settings["gyro_noise"] ** 2 / span,
                    H=np.array([[0.0, 1.0]]))  # fmt: skip
        linear_model(model, speed, params)
        row = np.array([[model[0, 0], model[0, 1] + speed]])
        twin.update(seen["accel_y"][k] - model[0, 2] * steer,
                    R=settings["accel_y_noise"] ** 2 / span, H=row)  # fmt: skip
        worst = max(worst, abs(twin.x[0, 0] - found["speed_y"][k]))
        assert found["speed_y_variance"][k] == pytest.approx(twin.P[0, 0], rel=1e-7)
    assert worst < 1e-9


def test_steady_turn_of_the_filter_is_the_papers():
    speed, steer, n = 20.0, 0.02, 4000
    params = params_of()
    rate = steady_yaw_rate(speed, steer, params)
    seen = np.zeros(
        n, [(c, float) for c in ("time", "speed_x", "steer_angle", "yaw_rate", "accel_y")]
    )
    seen["time"], seen["speed_x"], seen["steer_angle"] = 0.01 * np.arange(n), speed, steer
    seen["yaw_rate"], seen["accel_y"] = rate, speed * rate
    found = SingleTrackKalmanFilter("measured_speed").run(CAR, seen)
    expected = steady_sideslip(speed, rate, params)
    assert found["sideslip"][-1] == pytest.approx(np.arctan(expected), rel=1e-6)


def test_speed_survives_a_wheel_that_spins():
    n = 3000
    names = [f"wheel_speed_{w}" for w in ("front_left", "front_right", "rear_left", "rear_right")]
    seen = np.zeros(n, [(c, float) for c in ("time", *names, "steer_angle", "yaw_rate", "accel_x")])
    seen["time"] = 0.01 * np.arange(n)
    seen["accel_x"] = 0.5
    speed = 5.0 + 0.5 * seen["time"]
    for name in names:
        seen[name] = speed / CAR["wheel_radius"]
    for name in names[2:]:
        seen[name][1000:2500] *= 1.6  # both driven wheels spin for 15 s
    found = SpeedFusion().run(CAR, seen)
    error = found["speed_x"] - speed
    assert np.abs(error).max() < 0.3
    assert rms(error) ** 2 < 4.0 * np.mean(found["speed_x_variance"])


@pytest.mark.parametrize("scenario", ["slalom_snow@1", "mu_jump_lane_change@1", "two_turns@1"])
def test_the_bank_knows_the_sideslip_and_how_well(scenario):
    recording = drive(scenario)
    error, found, late = sideslip_error(SideslipFrictionBank(), recording)
    assert error < 0.35 * rms(recording.truth["sideslip"][late])
    squares = (found["sideslip"] - recording.truth["sideslip"])[late] ** 2
    assert np.mean(squares / found["sideslip_variance"][late]) < 8.0
    assert rms((found["speed_x"] - recording.truth["speed_x"])[late]) < 0.3


def test_friction_that_nothing_excites_stays_at_the_prior():
    recording = drive("banked_turn@1", horizon=10.0)  # straight ahead so far
    found = SideslipFrictionBank().run(recording.vehicle, recording.observations)
    assert found["mu_variance"][-1] == pytest.approx(found["mu_variance"][0], rel=0.3)
    assert found["mu"][-1] == pytest.approx(found["mu"][0], abs=0.1)
