"""A plug-in around filterpy: an unscented Kalman filter for speed and tyre force.

gripbench check examples/filterpy_ukf.py
gripbench run --scenario constant_mu --method examples/filterpy_ukf.py
"""

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

GRAVITY = 9.81


class ForceFilter:
    """Speed v and total force F: m dv/dt = F - D v^2 - f m g, F a random walk."""

    name = "force_ukf"
    sensors = ("speed_gps", "accel_x")
    estimates = ("speed_x", "force_x_front")
    variances = ("speed_x", "force_x_front")
    vehicle_parameters = ("mass", "drag", "rolling_resistance")

    def __init__(self, force_walk=2000.0, speed_noise=0.05, accel_noise=0.1):
        self.force_walk = force_walk  # [N/sqrt(s)]
        self.noise = np.diag([speed_noise**2, accel_noise**2])

    def reset(self, vehicle, dt):
        self.mass = vehicle["mass"]
        self.drag = vehicle["drag"]
        self.rolling = vehicle["rolling_resistance"] * self.mass * GRAVITY
        self.filter = None

    def rate(self, x):
        """Rate of change of speed [m/s^2]."""
        return (x[1] - self.drag * x[0] ** 2 - self.rolling) / self.mass

    def predict(self, x, dt):
        return np.array([x[0] + dt * self.rate(x), x[1]])

    def measure(self, x):
        return np.array([x[0], self.rate(x)])

    def update(self, obs):
        if self.filter is None:
            self.start(obs)
        elapsed = obs["time"] - self.time
        self.time = obs["time"]
        if elapsed > 0.0:
            self.filter.Q = np.diag([1e-6, self.force_walk**2]) * elapsed
            self.filter.predict(dt=elapsed)
        self.filter.update(np.array([obs["speed_gps"], obs["accel_x"]]))
        speed, force = self.filter.x
        variance = np.diag(self.filter.P)
        return {
            "speed_x": speed,
            "force_x_front": 0.5 * force,
            "speed_x_variance": variance[0],
            "force_x_front_variance": 0.25 * variance[1],
        }

    def start(self, obs):
        points = MerweScaledSigmaPoints(n=2, alpha=0.5, beta=2.0, kappa=1.0)
        self.filter = UnscentedKalmanFilter(2, 2, 0.001, self.measure, self.predict, points)
        self.filter.x = np.array([obs["speed_gps"], self.rolling])
        self.filter.P = np.diag([1.0, 1000.0**2])
        self.filter.R = self.noise
        self.time = obs["time"]
