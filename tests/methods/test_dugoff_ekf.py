"""The Dugoff EKF: tyre and Jacobian, its filterpy twin, symmetry, friction, the errata."""

import lateral_twins
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lateral_twins import dugoff_model

from gripbench.compilation import replacing
from gripbench.envs.tyres.combined import DUGOFF, combined_force
from gripbench.envs.vehicles import load_vehicle
from gripbench.envs.worlds import load_scenario, record
from gripbench.methods.blocks.dugoff_tyre import dugoff_force, dugoff_slips
from gripbench.methods.dugoff_ekf import DugoffEkf, evaluate
from gripbench.methods.printed.dakhlallah2008 import printed_slips
from gripbench.methods.samples import select_channels

VEHICLE = load_vehicle("dakhlallah2008").values()
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
STATES = ("speed_x", "speed_y", "yaw_rate")
linear = st.floats(-2e4, 2e4)
speeds = st.floats(3.0, 40.0)


@pytest.fixture(scope="module")
def run():
    scenario = load_scenario("dakhlallah_hard").model_copy(update={"horizon": 12.0})
    return record(scenario, 3)


@given(linear, linear, st.floats(100.0, 1e4))
def test_force_is_the_plants_dugoff_shape(x, y, capacity):
    ours = dugoff_force(x, y, capacity)
    np.testing.assert_allclose(
        ours[:2], combined_force(DUGOFF, x, y, 1.0, 1.0, capacity), rtol=1e-12, atol=1e-9
    )
    assert np.hypot(*ours[:2]) <= capacity


@given(linear, linear, st.floats(100.0, 1e4))
def test_force_slopes_are_the_derivatives(x, y, capacity):
    if abs(2.0 * np.hypot(x, y) - capacity) < 1.0:
        return  # the curvature jumps there
    _, _, xx, xy, yy = dugoff_force(x, y, capacity)
    h = 1e-3
    dx = np.subtract(dugoff_force(x + h, y, capacity), dugoff_force(x - h, y, capacity)) / (2 * h)
    dy = np.subtract(dugoff_force(x, y + h, capacity), dugoff_force(x, y - h, capacity)) / (2 * h)
    np.testing.assert_allclose([dx[0], dx[1], dy[0], dy[1]], [xx, xy, xy, yy], atol=1e-5)


@pytest.mark.parametrize("slips", [dugoff_slips, printed_slips])
@given(speed=speeds, ratio=st.floats(0.7, 1.3), tangent=st.floats(-0.5, 0.5))
def test_slips_are_those_of_the_paper(slips, speed, ratio, tangent):
    rolling, lateral = ratio * speed, -tangent * speed
    slip = (rolling - speed) / max(rolling, speed)
    base = 1.0 - (slip if slips is printed_slips else abs(slip))
    x, y, x_v, y_v, y_l = slips(rolling, speed, lateral)
    assert x == pytest.approx(slip / base, abs=1e-12)
    assert y == pytest.approx(tangent / base, abs=1e-12)
    if abs(ratio - 1.0) < 1e-4:
        return
    h = 1e-6
    up, down = (slips(rolling, speed + s * h, lateral) for s in (1, -1))
    np.testing.assert_allclose([x_v, y_v], [(up[i] - down[i]) / (2 * h) for i in (0, 1)], atol=1e-6)
    up, down = (slips(rolling, speed, lateral + s * h) for s in (1, -1))
    assert y_l == pytest.approx((up[1] - down[1]) / (2 * h), abs=1e-6)


@pytest.mark.parametrize("slips", [dugoff_slips, printed_slips])
def test_jacobian_is_the_derivative_of_the_model(slips):
    model = replacing(evaluate, {dugoff_slips: slips}, "test")
    state, params = dugoff_model(VEHICLE)
    rng = np.random.default_rng(0)

    def rate(x):
        state["filter"]["x"][:] = x
        model(state, params)
        return state["rate"].copy()

    for _ in range(100):
        x = np.array([rng.uniform(5.0, 30.0), rng.uniform(-3.0, 3.0), rng.uniform(-1.0, 1.0)])
        state["rolling"][:] = x[0] * rng.uniform(0.8, 1.2, 4)
        state["steer_angle"] = rng.uniform(-0.3, 0.3)
        state["accel_x"], state["accel_y"] = rng.uniform(-5.0, 5.0, 2)
        rate(x)
        slope = state["slope"].copy()
        for j, unit in enumerate(np.eye(3)):
            numeric = (rate(x + 1e-6 * unit) - rate(x - 1e-6 * unit)) / 2e-6
            np.testing.assert_allclose(slope[:, j], numeric, rtol=1e-6, atol=1e-6)


def test_wheel_loads_carry_the_vehicle_and_its_moments():
    """Eq. 6 with the full track: loads balance weight, pitch and roll moment."""
    state, params = dugoff_model(VEHICLE)
    state["filter"]["x"][:] = [20.0, 0.0, 0.0]
    state["rolling"][:] = 20.0
    state["accel_x"], state["accel_y"] = 2.0, 3.0
    evaluate(state, params)
    load = state["wheels"][:, 2]
    m, a, b = VEHICLE["mass"], VEHICLE["cg_to_front"], VEHICLE["cg_to_rear"]
    h = VEHICLE["cg_height"]
    assert load.sum() == pytest.approx(m * 9.81)
    assert (load[2] + load[3]) * b - (load[0] + load[1]) * a == pytest.approx(m * h * 2.0)
    roll = 0.5 * VEHICLE["track_front"] * (load[1] + load[3] - load[0] - load[2])
    assert roll == pytest.approx(m * h * 3.0)


def test_agrees_with_filterpy(run):
    """The twin has its own forward Euler prediction around the model, and a joint correction."""
    method = DugoffEkf("paper_step")
    obs = run.observations[:500]
    ours = method.run(VEHICLE, obs)
    states, covariance = lateral_twins.dugoff(method, obs, VEHICLE)
    for i, name in enumerate(STATES):
        np.testing.assert_allclose(ours[name], states[:, i], rtol=1e-9, atol=1e-9)
        assert ours[name + "_variance"][-1] == pytest.approx(covariance[i, i], rel=1e-9)
    v_x, v_y, _ = states[-1]
    slope = np.array([-v_y, v_x]) / (v_x * v_x + v_y * v_y)  # of the sideslip angle
    variance = slope @ covariance[:2, :2] @ slope
    assert ours["sideslip_variance"][-1] == pytest.approx(variance, rel=1e-9)
    assert abs(slope[0] * slope[1] * covariance[0, 1]) > 1e-7 * variance


def test_held_readings_count_once(run):
    """Each sample shown five times at five times the rate: the same knowledge, nearly."""
    obs = run.observations[:600]
    held = np.repeat(obs, 5)
    held["time"] = obs["time"][0] + 0.002 * np.arange(len(held))
    plain = DugoffEkf().run(VEHICLE, obs)
    fine = DugoffEkf().run(VEHICLE, held)
    name = "sideslip_variance"
    assert fine[name][-1] == pytest.approx(plain[name][-1], rel=0.15)


def test_a_mirrored_drive_gives_mirrored_estimates(run):
    obs = run.observations
    mirrored = obs.copy()
    for name in ("yaw_rate", "steer_angle", "accel_y"):
        mirrored[name] = -obs[name]
    for axle in ("front", "rear"):
        left, right = f"wheel_speed_{axle}_left", f"wheel_speed_{axle}_right"
        mirrored[left], mirrored[right] = obs[right], obs[left]
    a, b = DugoffEkf().run(VEHICLE, obs), DugoffEkf().run(VEHICLE, mirrored)
    np.testing.assert_allclose(a["sideslip"], -b["sideslip"], atol=1e-10)
    np.testing.assert_allclose(a["force_y_front_left"], -b["force_y_front_right"], atol=1e-4)
    np.testing.assert_allclose(a["mu_used"], b["mu_used"], atol=1e-9)


def test_used_friction_is_force_over_load_and_within_the_road(run):
    estimates = DugoffEkf().run(VEHICLE, run.observations)
    for wheel in WHEELS:
        force = np.hypot(estimates[f"force_x_{wheel}"], estimates[f"force_y_{wheel}"])
        used = estimates[f"mu_used_{wheel}"]
        np.testing.assert_allclose(used * estimates[f"force_z_{wheel}"], force, rtol=1e-9)
        assert used.max() <= 0.8 + 1e-12


def test_sideslip_and_forces_follow_the_vehicle(run):
    estimates, truth = DugoffEkf().run(VEHICLE, run.observations), run.truth
    error = np.degrees(estimates["sideslip"] - truth["sideslip"])[200:]
    assert np.sqrt(np.mean(error**2)) < 0.3
    lateral = sum(estimates[f"force_y_{wheel}"] for wheel in WHEELS)
    ahead = VEHICLE["mass"] * truth["accel_y"]
    assert np.sqrt(np.mean((lateral - ahead)[200:] ** 2)) < 0.06 * np.abs(ahead).max()


def test_open_loop_does_not_look_at_the_measured_states(run):
    other = run.observations.copy()
    other["yaw_rate"][1:] += 0.1
    other["speed_x"][1:] -= 1.0
    method = DugoffEkf("open_loop")
    a, b = method.run(VEHICLE, run.observations), method.run(VEHICLE, other)
    np.testing.assert_array_equal(a["sideslip"], b["sideslip"])


@pytest.mark.parametrize("variant", ["paper_load_transfer", "paper_jacobian", "paper_update"])
def test_printed_equations_cost_accuracy(run, variant):
    def rms(method):
        error = method.run(VEHICLE, run.observations)["sideslip"] - run.truth["sideslip"]
        return np.sqrt(np.mean(error[200:] ** 2))

    assert rms(DugoffEkf(variant)) > 1.5 * rms(DugoffEkf())


def test_standstill_reverse_and_locked_wheels_stay_finite(run):
    obs = run.observations[:300].copy()
    for wheel in WHEELS:
        obs[f"wheel_speed_{wheel}"] = 0.0
    for speed in (0.0, -5.0, 20.0):
        obs["speed_x"] = speed
        estimates = DugoffEkf().run(VEHICLE, obs)
        assert all(np.isfinite(estimates[name]).all() for name in estimates.dtype.names)
        for name in DugoffEkf.variances:
            assert estimates[name + "_variance"].min() >= 0.0


def test_online_equals_batch_and_reset_equals_fresh(run):
    method = DugoffEkf()
    obs = select_channels(run.observations, method.sensors)[:300]
    batch = method.run(VEHICLE, obs)
    for _ in range(2):
        method.reset(VEHICLE, 0.01)
        for k in range(len(obs)):
            last = method.update({name: float(obs[k][name]) for name in obs.dtype.names})
    for name in batch.dtype.names:
        assert last[name] == batch[name][-1]
