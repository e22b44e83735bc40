"""Samples of a car with stability control in, numbers that a regression can use out, causally.

Every 20 ms a row: what the sensors said in windows of the last second, the sideslip of the
single-track model on paper, and leaky integrals of a_y / v - r, the rate of the sideslip.
"""

from collections import deque
from itertools import pairwise

import numpy as np

WHEELS = tuple(
    f"wheel_speed_{axle}_{side}" for axle in ("front", "rear") for side in ("left", "right")
)
SENSORS = (*WHEELS, "steer_angle", "yaw_rate", "accel_x", "accel_y")
VEHICLE = (
    "mass", "cg_to_front", "cg_to_rear", "cornering_stiffness_front", "cornering_stiffness_rear",
    "wheel_radius",
)  # fmt: skip
PERIOD = 0.02
EDGES = (0, 5, 15, 30, 50)
MEMORIES = (0.25, 0.5, 1.0, 2.0, 4.0)
GRAVITY, SLOWEST = 9.81, 2.0


class Windows:
    """Makes a row of numbers of every 20 ms of samples."""

    def __init__(self, vehicle):
        self.car = dict(vehicle)
        self.last = dict.fromkeys(SENSORS, 0.0)
        self.sums, self.count, self.begin = np.zeros(5), 0, None
        self.integrals = np.zeros(len(MEMORIES))
        self.past = deque(maxlen=EDGES[-1])

    def take(self, obs):
        """Take a sample; return a row where 20 ms are full, else None."""
        last, time = self.last, obs["time"]
        for name in SENSORS:
            value = obs[name]
            if value == value:  # a channel that is missing keeps its last value
                last[name] = value
        if self.begin is None or time < self.begin:
            self.begin = time
        wheels = sorted(last[name] for name in WHEELS)
        speed = 0.5 * self.car["wheel_radius"] * (wheels[1] + wheels[2])
        self.sums += (
            speed,
            last["steer_angle"],
            last["yaw_rate"],
            last["accel_x"],
            last["accel_y"],
        )
        self.count += 1
        elapsed = time - self.begin
        if elapsed < PERIOD * (1.0 - 1e-9):
            return None
        means = self.sums / self.count
        self.sums, self.count, self.begin = np.zeros(5), 0, time
        return self.row(*means.tolist(), min(elapsed, 5 * PERIOD))

    def row(self, speed, steer, rate, accel_x, accel_y, elapsed):
        car = self.car
        a, b = car["cg_to_front"], car["cg_to_rear"]
        front, rear = car["cornering_stiffness_front"], car["cornering_stiffness_rear"]
        moves = speed > SLOWEST
        speed = max(speed, SLOWEST)
        drift = accel_y / speed - rate if moves else 0.0
        self.integrals += elapsed * (drift - self.integrals / MEMORIES)
        gradient = car["mass"] * (b * rear - a * front) / ((a + b) * front * rear)
        steered = speed * steer / max(a + b + gradient * speed**2, 0.1 * (a + b))
        sideslip = b * rate / speed - a * car["mass"] * accel_y / ((a + b) * rear)
        now = (steer, rate, accel_y / GRAVITY, steered - rate, drift)
        if not self.past:
            self.past.extend([now] * EDGES[-1])
        self.past.append(now)
        past = np.array(self.past)[::-1]
        windows = [past[i:j].mean(axis=0) for i, j in pairwise(EDGES)]
        usual = (1.0, sideslip, speed / 30.0, accel_x / GRAVITY, speed * rate / GRAVITY)
        return float(moves) * np.concatenate([usual, self.integrals, *windows])


def rows_of(drive, every=1):
    """Return rows, shape (n, m), and the true sideslip beside each [rad], shape (n,)."""
    windows = Windows(drive.vehicle)
    names = drive.observations.dtype.names
    truth = drive.truth["sideslip"]
    rows, targets, number = [], [], 0
    for k, sample in enumerate(drive.observations.tolist()):
        row = windows.take(dict(zip(names, sample, strict=True)))
        if row is None:
            continue
        number += 1
        if number % every == 0 and drive.truth["time"][k] >= drive.score_from:
            rows.append(row)
            targets.append(truth[k])
    return np.array(rows), np.array(targets)


def training_rows(recordings, every=1):
    """Return rows, targets and weights; every drive counts by its error relative to its size."""
    parts = [rows_of(drive, every) for drive in recordings]
    parts = [(rows, targets) for rows, targets in parts if len(targets)]
    size = np.radians(0.5)
    weights = [
        np.full(len(targets), 1.0 / (len(targets) * (np.mean(targets**2) + size**2)))
        for _, targets in parts
    ]
    rows, targets = (np.concatenate(item) for item in zip(*parts, strict=True))
    weights = np.concatenate(weights)
    return rows, targets, weights / weights.sum()
