"""The extended Kalman filter of the longitudinal methods once more, around filterpy."""

import numpy as np
from filterpy.kalman import KalmanFilter

from gripbench.methods.extended_kalman_filter import ExtendedKalmanFilter

GRAVITY = 9.81


class FilterpyTwin:
    """The force part of `ExtendedKalmanFilter` as a user of filterpy would write it."""

    name = "filterpy_twin"
    sensors = ExtendedKalmanFilter.sensors
    estimates = ("force_x_front", "force_x_rear")

    def __init__(self, **settings):
        self.settings = ExtendedKalmanFilter(**settings).settings

    def reset(self, vehicle, dt):
        s = self.settings
        self.car = dict(vehicle)
        self.filter = f = KalmanFilter(dim_x=5, dim_z=3, dim_u=2)
        f.x = np.zeros(5)
        variance = s["wheel_speed_variance"]
        f.P = np.diag([1.0, variance, variance, s["force_variance"], s["force_variance"]])
        f.R = np.diag([s["acceleration_variance"], variance, variance])
        f.H = np.zeros((3, 5))
        f.H[0, 3:] = 1.0 / self.car["mass"]
        f.H[1, 1] = f.H[2, 2] = 1.0
        f.B = np.zeros((5, 2))
        self.time = None

    def update(self, obs):
        s, car, f = self.settings, self.car, self.filter
        if self.time is None:
            f.x[:3] = obs["speed_gps"], obs["wheel_speed_front"], obs["wheel_speed_rear"]
        else:
            h = obs["time"] - self.time
            f.F = np.eye(5)
            f.F[0, 3:] = h / car["mass"]
            f.F[1, 3] = f.F[2, 4] = -h * car["wheel_radius"] / car["wheel_inertia"]
            f.B[1, 0] = f.B[2, 1] = h / car["wheel_inertia"]
            density = s["wheel_speed_density"], s["force_density"]
            f.Q = h * np.diag([0.0, density[0], density[0], density[1], density[1]])
            f.predict(u=np.array([obs["torque_front"], obs["torque_rear"]]))
        self.time = obs["time"]
        speed = obs["speed_gps"]
        resistance = car["rolling_resistance"] * GRAVITY + car["drag"] * speed**2 / car["mass"]
        accel = obs["accel_x"] + s["resistances"] * resistance
        f.update(np.array([accel, obs["wheel_speed_front"], obs["wheel_speed_rear"]]))
        return {"force_x_front": f.x[3], "force_x_rear": f.x[4]}
