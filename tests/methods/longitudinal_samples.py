"""What the tests of the longitudinal methods share: recordings, methods, plain Python runs."""

from functools import cache

import numpy as np

from gripbench.envs.vehicles import load_vehicle
from gripbench.envs.worlds import load_scenario, record
from gripbench.methods.extended_kalman_filter import ExtendedKalmanFilter
from gripbench.methods.individual_wheel_acceleration import IndividualWheelAcceleration
from gripbench.methods.individual_wheel_torque import IndividualWheelTorque
from gripbench.methods.proposed_observer import ProposedObserver
from gripbench.methods.slip_slope import SlipSlope

METHODS = (
    SlipSlope,
    IndividualWheelTorque,
    IndividualWheelAcceleration,
    ExtendedKalmanFilter,
    ProposedObserver,
)
EACH_VARIANT = [(kind, variant) for kind in METHODS for variant in ("corrected", *kind.variants)]
CAR = load_vehicle("li2014").values()
GRAVITY = 9.81
WHEELBASE = CAR["cg_to_front"] + CAR["cg_to_rear"]
LOAD_FRONT = CAR["mass"] * GRAVITY * CAR["cg_to_rear"] / WHEELBASE
LOAD_REAR = CAR["mass"] * GRAVITY * CAR["cg_to_front"] / WHEELBASE


@cache
def recording(name="constant_mu", horizon=2.0, noise=3.6e-4, seed=0):
    """Return a recording of the first seconds of a scenario."""
    scenario = load_scenario(name)
    noise = 0.0 if scenario.integrator == "paper" else noise
    changes = {"horizon": horizon, "wheel_speed_noise": noise}
    return record(scenario.model_copy(update=changes), seed)


def unequal(observations, seed=0):
    """Return the observations less a random third: unequal sample times."""
    keep = np.random.default_rng(seed).random(len(observations)) < 0.67
    keep[0] = True
    return observations[keep]


def online(method, observations):
    """Return the estimates of a method that takes one sample at a time."""
    method.reset(CAR, 1e-3)
    names = observations.dtype.names
    rows = [
        tuple(method.update(dict(zip(names, row.item(), strict=True))).values())
        for row in observations
    ]
    return np.array(rows, [(name, float) for name in method.outputs])


def plain_python(method, observations):
    """Return the estimates of a method whose step runs uncompiled over records."""
    records = method._fresh(CAR, len(observations))
    chosen = np.zeros(len(observations), records.obs.dtype)
    for name in (*method.sensors, "time"):
        chosen[name] = observations[name]
    chosen["elapsed"] = np.diff(observations["time"], prepend=observations["time"][0])
    chosen["first"][0] = 1.0
    rows, state, params, est = (
        array.view(np.recarray) for array in (chosen, records.state, records.params, records.est)
    )
    for k in range(len(rows)):
        method.step.py_func(state[0], rows[k], params[0], est[k])
    return records.est


def slip_ratios(observations, speed="speed_gps"):
    """Return the slip ratios of both axles by eq. 5."""
    v = observations[speed] if isinstance(speed, str) else speed
    rolling = (
        CAR["wheel_radius"] * observations[f"wheel_speed_{axle}"] for axle in ("front", "rear")
    )
    return tuple((r - v) / np.maximum(r, v) for r in rolling)


def weighted_least_squares(regressor, output, forgetting, covariance):
    """Return the closed form of forgetting-factor RLS after each sample, start value 0.

    theta_t minimises sum_i lambda^(t-i) (y_i - phi_i theta)^2 + lambda^t theta^2/P0, where
    lambda^(t-i) is the product of the factors of the samples after i.
    """
    theta = np.empty(len(output))
    for t in range(len(output)):
        weights = np.ones(t + 1)
        weights[:-1] = np.cumprod(forgetting[1 : t + 1][::-1])[::-1]
        prior = np.prod(forgetting[: t + 1]) / covariance
        numerator = np.sum(weights * regressor[: t + 1] * output[: t + 1])
        theta[t] = numerator / (np.sum(weights * regressor[: t + 1] ** 2) + prior)
    return theta
