"""Gustafsson's filter: its filterpy twin, a radius that is off, a step of the friction."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from gripbench.envs.vehicles import load_vehicle
from gripbench.methods.slip_slope_kalman_filter import SlipSlopeKalmanFilter

CAR = load_vehicle("li2014").values()
WEIGHT = CAR["mass"] * 9.81 / (CAR["cg_to_front"] + CAR["cg_to_rear"])
SLOPE = CAR["magic_b"] * CAR["magic_c"]


def straight(mu, radius_error=0.0, noise=0.0, seconds=40.0, seed=0):
    """Return a drive of a linear tyre: driven in front, torque on and off; `mu` of each sample."""
    n = int(seconds * 100)
    time = 0.01 * np.arange(n)
    mu = np.broadcast_to(mu, n)
    torque = np.where(time % 8.0 < 5.0, 400.0, 0.0)
    speed = 15.0 + 0.2 * time
    rear = speed / CAR["wheel_radius"]
    force = (torque - CAR["wheel_inertia"] * 0.2 / CAR["wheel_radius"]) / CAR["wheel_radius"]
    coasting = -CAR["wheel_inertia"] * 0.2 / CAR["wheel_radius"] ** 2
    used = force / (WEIGHT * CAR["cg_to_rear"]) - coasting / (WEIGHT * CAR["cg_to_front"])
    slip = used / (SLOPE * mu) + radius_error
    rng = np.random.default_rng(seed)
    names = ("time", *SlipSlopeKalmanFilter.sensors)
    seen = np.zeros(n, [(name, float) for name in names])
    seen["time"], seen["torque_front"] = time, torque
    seen["wheel_speed_rear"] = rear
    seen["wheel_speed_front"] = rear * (1.0 + slip + noise * rng.standard_normal(n))
    return seen


def test_it_is_its_filterpy_twin():
    step = np.where(np.arange(4000) < 2200, 0.9, 0.4)
    seen = straight(step, radius_error=0.003, noise=1e-4)
    method = SlipSlopeKalmanFilter()
    found, s = method.run(CAR, seen), method.settings
    twin = KalmanFilter(2, 1)
    ratio = s["friction_spread"] / s["friction_mean"]
    first = (s["friction_spread"] / s["friction_mean"] ** 2) ** 2
    twin.x = np.array([[(1 + ratio**2) / s["friction_mean"]], [0.0]])
    twin.P = np.diag([first, s["offset_std"] ** 2])
    rise = fall = 0.0
    alarms = 0
    for end in range(5, len(seen), 5):
        part, span = seen[end - 4 : end + 1], 0.05
        twin.predict(Q=np.diag([s["flex_walk"] ** 2 * span, s["offset_walk"] ** 2 * span]))
        twin.P[0, 0] = min(twin.P[0, 0], 1.5 * first)
        used = 0.0
        for axle, lever, sign in (("front", "cg_to_rear", 1), ("rear", "cg_to_front", -1)):
            wheel = seen[f"wheel_speed_{axle}"]
            turn = (wheel[end] - wheel[end - 5]) / span
            moment = part[f"torque_{axle}"].mean() - CAR["wheel_inertia"] * turn
            used += sign * moment / CAR["wheel_radius"] / (WEIGHT * CAR[lever])
        slip = part["wheel_speed_front"].mean() / part["wheel_speed_rear"].mean() - 1.0
        variance = s["slip_noise"] ** 2 / span + s["slip_error"] ** 2 * s["slip_time"] / span
        if abs(slip) < s["largest_slip"]:
            twin.update(np.array([[slip]]), R=variance, H=np.array([[used / SLOPE, 1.0]]))
            if abs(used) > s["least_share"]:
                normal = np.sign(used) * float(twin.y[0, 0]) / np.sqrt(float(twin.S[0, 0]))
                rise, fall = (
                    max(0.0, rise + normal - s["drift"]),
                    max(0.0, fall - normal - s["drift"]),
                )
                if max(rise, fall) > s["threshold"]:
                    rise = fall = 0.0
                    alarms += 1
                    twin.P[0, 0] += first
        ratio = min(twin.P[0, 0] / twin.x[0, 0] ** 2, 0.25)
        assert found["mu_front"][end] == pytest.approx((1 + ratio) / twin.x[0, 0], rel=1e-6)
    assert alarms > 0


@pytest.mark.parametrize("radius_error", [0.0, 0.004, -0.004])
def test_a_radius_that_is_off_moves_the_offset_only(radius_error):
    found = SlipSlopeKalmanFilter().run(CAR, straight(0.8, radius_error, noise=3e-5))
    assert found["mu_front"][-1] == pytest.approx(0.8, rel=0.06)


def test_a_step_of_the_friction_is_found():
    step = np.where(np.arange(4000) < 2000, 0.9, 0.4)
    seen = straight(step, noise=3e-5)
    found = SlipSlopeKalmanFilter().run(CAR, seen)
    blind = SlipSlopeKalmanFilter(threshold=100.0).run(CAR, seen)
    error, without = (np.abs(one["mu_front"][2200:2400] - 0.4).mean() for one in (found, blind))
    assert error < 0.06
    assert error < without
