"""A drive in closed form: heading, roll and velocities, with what perfect sensors give of them."""

import numpy as np

from gripbench.envs.signals import record_type
from gripbench.envs.vehicles import GRAVITY
from gripbench.methods.magnetometer_gps_cascade import MagnetometerGpsCascade

FIELD = (15.8e-6, -53.2e-6)
VEHICLE = {
    "roll_gradient": 0.0,  # the roll of this drive is not that of springs
    "mass": 2450.0,
    "cg_to_front": 1.573,
    "cg_to_rear": 2.085,
    "cornering_stiffness_front": 100e3,
    "cornering_stiffness_rear": 100e3,
}


def drive(duration=20.0, dt=1.0 / 166.0, yaw_start=0.7, delay=0.4, period=0.2, roll_size=0.02):
    """Return observations and truth (dict of arrays) of a weaving car that drifts sideways."""
    t = np.arange(0.0, duration, dt)
    w = 0.8

    def motion(t):
        yaw = yaw_start + 0.5 * np.sin(w * t) + 0.05 * t
        vx = 15.0 + 2.0 * np.sin(0.3 * t)
        vy = 1.5 * np.sin(w * t + 0.4)
        return yaw, vx, vy

    yaw, vx, vy = motion(t)
    yaw_speed = 0.5 * w * np.cos(w * t) + 0.05
    roll = roll_size * np.sin(0.9 * t)
    roll_speed = roll_size * 0.9 * np.cos(0.9 * t)
    vx_dot = 0.6 * np.cos(0.3 * t)
    vy_dot = 1.5 * w * np.cos(w * t + 0.4)
    names = ("time", *MagnetometerGpsCascade.sensors)
    obs = np.zeros(len(t), record_type(names))
    obs["time"] = t
    obs["yaw_rate"] = yaw_speed * np.cos(roll)
    obs["pitch_rate"] = yaw_speed * np.sin(roll)
    obs["roll_rate"] = roll_speed
    obs["accel_x"] = vx_dot - yaw_speed * vy
    obs["accel_y"] = vy_dot + yaw_speed * vx + GRAVITY * np.sin(roll)
    horizontal, up = FIELD
    obs["magnetic_field_x"] = horizontal * np.cos(yaw)
    obs["magnetic_field_y"] = -horizontal * np.sin(yaw) * np.cos(roll) + up * np.sin(roll)
    obs["magnetic_field_z"] = horizontal * np.sin(yaw) * np.sin(roll) + up * np.cos(roll)
    obs["magnetic_field_x_new"] = 1.0
    # The level velocity: v_y is taken in the level axis here, so roll does not enter the GPS.
    sample = np.floor(t / period + 1e-9)
    new = np.diff(sample, prepend=-1.0) > 0
    held = t[new][np.cumsum(new) - 1]
    true_at = np.maximum(held - delay, 0.0)
    p, u, v = motion(true_at)
    obs["velocity_north"] = u * np.cos(p) - v * np.sin(p)
    obs["velocity_west"] = u * np.sin(p) + v * np.cos(p)
    obs["velocity_north_new"] = new
    obs["gps_time"] = true_at
    truth = {"time": t, "yaw": yaw, "roll": roll, "speed_x": vx, "speed_y": vy}
    truth["sideslip"] = np.arctan2(vy, vx)
    return obs, truth
