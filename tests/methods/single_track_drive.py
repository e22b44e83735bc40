"""Drives of the linear single-track model, exact at the samples, with noise of known size."""

import numpy as np
from scipy.linalg import expm

from gripbench.envs.signals import record_type
from gripbench.methods.model_based_kalman_filter import ModelBasedKalmanFilter

BLAZER = {
    "mass": 1850.0,
    "yaw_inertia": 3080.0,
    "cg_to_front": 1.17,
    "cg_to_rear": 1.421,
    "cornering_stiffness_front": 69e3,
    "cornering_stiffness_rear": 110e3,
}
STEP = 0.01
CHANNELS = ("time", *ModelBasedKalmanFilter.sensors, "road_bank")


def system(vehicle, speed):
    """Return A and B of sideslip, yaw rate, heading under steering angle and sin(bank)."""
    m, inertia, a, b, front, rear = vehicle.values()
    A = np.array(
        [
            [-(front + rear) / (m * speed), (b * rear - a * front) / (m * speed**2) - 1.0, 0.0],
            [
                (b * rear - a * front) / inertia,
                -(a**2 * front + b**2 * rear) / (inertia * speed),
                0,
            ],
            [0.0, 1.0, 0.0],
        ]
    )
    B = np.array([[front / (m * speed), -9.81 / speed], [a * front / inertia, 0.0], [0.0, 0.0]])
    return A, B


def held(vehicle, speed, step=STEP):
    """Return the transition and input matrices of a step with held inputs."""
    A, B = system(vehicle, speed)
    block = np.zeros((5, 5))
    block[:3, :3], block[:3, 3:] = A, B
    block = expm(block * step)
    return block[:3, :3], block[:3, 3:]


def drive(
    steer,
    *,
    vehicle=BLAZER,
    speed=30.0,
    bank=None,
    seed=None,
    bias=0.0,
    scale=1.0,
    heading=0.0,
    late=0,
    noise=(5.236e-3, 0.05, 0.0),
):
    """Return observations and the true states (n, 3).

    `steer` has one angle a sample and moves linearly between samples; `noise` is that of gyro
    [rad/s], GPS velocity [m/s] and steering [rad], none without a seed; `late` is the age of a
    GPS sample in samples.
    """
    n = len(steer)
    bank = np.zeros(n) if bank is None else bank
    transition, inputs = held(vehicle, speed)
    x = np.zeros((n, 3))
    x[0, 2] = heading
    for k in range(n - 1):
        u = [0.5 * (steer[k] + steer[k + 1]), np.sin(0.5 * (bank[k] + bank[k + 1]))]
        x[k + 1] = transition @ x[k] + inputs @ u
    rng = np.random.default_rng(seed)
    size = np.zeros(3) if seed is None else np.asarray(noise)
    obs = np.zeros(n, record_type(CHANNELS))
    obs["time"] = STEP * np.arange(n)
    obs["yaw_rate"] = scale * x[:, 1] + bias + size[0] * rng.standard_normal(n)
    obs["steer_angle"] = steer + size[2] * rng.standard_normal(n)
    obs["speed_gps"] = speed
    obs["road_bank"] = bank
    course = x[:, 0] + x[:, 2] + size[1] / speed * rng.standard_normal(n)
    sampled = np.arange(n) // 20 * 20
    true_at = np.maximum(sampled - late, 0)
    obs["course"] = (course[true_at] + np.pi) % (2.0 * np.pi) - np.pi
    obs["course_new"] = np.arange(n) % 20 == 0
    obs["gps_time"] = obs["time"][true_at]
    return obs, x


def turn(straight=15.0, arc=10.0, angle=0.04, ramp=2.0, after=10.0):
    """Return the steering of a straight, a turn with ramps, and a straight."""
    times = np.cumsum([0.0, straight, ramp, arc, ramp, after])
    t = np.arange(0.0, times[-1], STEP)
    return np.interp(t, times, [0.0, 0.0, angle, angle, 0.0, 0.0])
