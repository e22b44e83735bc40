"""A drive of a linear single-track car: what its sensors and a sideslip reference would log."""

import numpy as np
import pandas as pd

WHEELBASE = 2.7
MAP = {
    "name": "drive",
    "time": {"column": "t", "unit": "s"},
    "channels": {
        "speed_x": {"column": "v", "unit": "m/s"},
        "accel_x": {"column": "ax", "unit": "m/s^2"},
        "accel_y": {"column": "ay", "unit": "m/s^2"},
        "yaw_rate": {"column": "r", "unit": "rad/s"},
        "steer_angle": {"column": "d", "unit": "rad"},
    },
    "reference": {"sideslip": {"column": "beta", "unit": "rad"}},
}


def drive(seconds: float = 40.0, rate: float = 100.0, noise: float = 1.0) -> pd.DataFrame:
    """Return speed, accelerations, yaw rate, steering, sideslip, lateral velocity and pose."""
    rng = np.random.default_rng(1)
    count, step = int(seconds * rate), 1.0 / rate
    t = np.arange(count) * step
    m, inertia, a, b, front, rear = 1500.0, 2500.0, 1.2, 1.5, 90e3, 110e3
    v = 20.0 + 4.0 * np.sin(0.2 * t)
    d = 0.03 * np.sin(1.3 * t) * (0.6 + 0.4 * np.sin(0.31 * t)) + 0.012 * np.sin(3.1 * t + 1.0)
    vy, r = 0.0, 0.0
    side, turn, lateral = np.zeros((3, count))
    for k in range(count):
        force_front = front * (d[k] - (vy + a * r) / v[k])
        force_rear = rear * -(vy - b * r) / v[k]
        lateral[k] = (force_front + force_rear) / m
        side[k], turn[k] = vy, r
        vy += step * (lateral[k] - v[k] * r)
        r += step * (a * force_front - b * force_rear) / inertia
    yaw = np.concatenate([[0.0], np.cumsum(turn)[:-1] * step])
    north = np.cumsum(v * np.cos(yaw) - side * np.sin(yaw)) * step
    west = np.cumsum(v * np.sin(yaw) + side * np.cos(yaw)) * step

    def noisy(values, deviation):
        return values + noise * deviation * rng.standard_normal(count)

    return pd.DataFrame(
        {
            "t": t,
            "v": noisy(v, 0.02),
            "ax": noisy(np.gradient(v, t) - side * turn, 0.05),
            "ay": noisy(lateral, 0.05),
            "r": noisy(turn, 0.002),
            "d": d,
            "beta": noisy(np.arctan2(side, v), 0.0005),
            "vy": side,
            "yaw": yaw,
            "north": north,
            "west": west,
        }
    )
