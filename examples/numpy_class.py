"""A plain class with NumPy: friction from the slip slope, by least squares over a window.

gripbench check examples/numpy_class.py
gripbench run --scenario constant_mu --method examples/numpy_class.py
"""

from collections import deque

import numpy as np

GRAVITY = 9.81


class WindowedSlope:
    """Force over slip, fitted over the last samples; the slope over the tyre's B C is friction."""

    name = "windowed_slope"
    sensors = ("wheel_speed_front", "wheel_speed_rear", "accel_x", "speed_gps")
    estimates = ("mu_front",)
    vehicle_parameters = (
        "mass", "drag", "rolling_resistance", "wheel_radius", "magic_b", "magic_c",
    )  # fmt: skip

    def __init__(self, window=300, least_slip=1e-4):
        self.window = int(window)
        self.least_slip = least_slip

    def reset(self, vehicle, dt):
        self.vehicle = dict(vehicle)
        self.pairs = deque(maxlen=self.window)  # (slip, normalised force)
        self.friction = 1.0

    def update(self, obs):
        car = self.vehicle
        speed = obs["speed_gps"]
        rim = 0.5 * car["wheel_radius"] * (obs["wheel_speed_front"] + obs["wheel_speed_rear"])
        slip = (rim - speed) / max(abs(rim), abs(speed), 0.1)
        force = obs["accel_x"] + car["drag"] * speed**2 / car["mass"]
        used = force / GRAVITY + car["rolling_resistance"]
        if abs(slip) > self.least_slip:
            self.pairs.append((slip, used))
            slips, forces = np.array(self.pairs).T
            slope = slips @ forces / (slips @ slips)
            self.friction = float(np.clip(slope / (car["magic_b"] * car["magic_c"]), 0.0, 1.5))
        return {"mu_front": self.friction}
