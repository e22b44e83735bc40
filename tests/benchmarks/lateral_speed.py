"""What the benchmark of the lateral methods times: a method, its filterpy twin, commonroad."""

import functools
import math
import sys
from pathlib import Path

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter, KalmanFilter

from gripbench.envs.vehicles import GRAVITY
from gripbench.envs.worlds import load_scenario, record
from gripbench.methods.friction_ekf import lateral_acceleration, slip_angles
from gripbench.methods.magnetometer_gps_cascade import MagnetometerGpsCascade
from gripbench.methods.samples import select_channels
from gripbench.methods.velocity_friction_ekf import VelocityFrictionEkf

sys.path.insert(0, str(Path(__file__).parents[1] / "methods"))
import lateral_twins

STEPS = 1000
"""Samples of every job, so that the times of all of them compare."""


@functools.cache
def drive(scenario, first):
    """Return the vehicle and `STEPS` samples of a recording from sample `first` on."""
    recording = record(load_scenario(scenario), 0)
    return recording.vehicle, recording.observations[first : first + STEPS]


def batch(method, scenario, first=0):
    """Return a call that runs a method over the samples."""
    vehicle, observations = drive(scenario, first)
    selected = select_channels(observations, method.sensors)
    return lambda: method.run(vehicle, selected)


def kinematic(method):
    """Return a call of the kinematic filter's twin."""
    return functools.partial(lateral_twins.kinematic, method, drive("two_turns", 0)[1])


def single_track(method):
    """Return a call of the model-based filter's twin."""
    vehicle, observations = drive("two_turns", 0)
    names = ("mass", "yaw_inertia", "cg_to_front", "cg_to_rear",
             "cornering_stiffness_front", "cornering_stiffness_rear")  # fmt: skip
    car = {name: vehicle[name] for name in names}
    return functools.partial(lateral_twins.single_track, method, observations, car, 30.0)


def both(kinematic_method, single_track_method):
    """Return a call of the two filters that the stiffness update runs side by side."""
    first, second = kinematic(kinematic_method), single_track(single_track_method)

    def run():
        first()
        return second()

    return run


def dugoff(method):
    """Return a call of the Dugoff EKF's twin."""
    vehicle, observations = drive("dakhlallah_hard", 0)
    return functools.partial(lateral_twins.dugoff, method, observations, vehicle)


class CascadeTwin:
    """Heading, sideslip and friction filters of the cascade around filterpy, without the delay."""

    def __init__(self, vehicle):
        self.settings = MagnetometerGpsCascade().settings
        self.roll_gradient = vehicle["roll_gradient"]
        self.friction = FrictionTwin(vehicle, self.settings)
        set_ = self.settings
        self.field = np.array([set_["field_horizontal"], set_["field_up"]]) * 1e6
        heading = ExtendedKalmanFilter(dim_x=2, dim_z=3)
        heading.P = np.diag([0.01, 0.001])
        self.magnetometer = np.eye(3) * (1e6 * set_["magnetometer_std"]) ** 2
        self.heading = heading
        sideslip = KalmanFilter(dim_x=4, dim_z=2)
        sideslip.P = np.diag([0.1, 0.02, 0.1, 0.02])
        sideslip.H = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
        self.sideslip = sideslip

    def start(self, yaw, speed):
        """Begin with a heading [rad] and a speed [m/s]."""
        self.heading.x = np.array([yaw, 0.0])
        self.sideslip.x = np.array([speed, 0.0, 0.0, 0.0])

    def model(self, x):
        """Return the field [uT] at yaw and roll."""
        level, up = self.field
        yaw, roll = x
        across = level * math.sin(yaw)
        return np.array([
            level * math.cos(yaw),
            -across * math.cos(roll) + up * math.sin(roll),
            across * math.sin(roll) + up * math.cos(roll),
        ])  # fmt: skip

    def jacobian(self, x):
        """Return its derivative, shape (3, 2)."""
        level, up = self.field
        yaw, roll = x
        along, across = level * math.cos(yaw), level * math.sin(yaw)
        c, s = math.cos(roll), math.sin(roll)
        return np.array(
            [[-across, 0.0], [-along * c, across * s + up * c], [along * s, across * c - up * s]]
        )

    def step(self, obs, dt):
        """Take one sample."""
        set_, heading, sideslip = self.settings, self.heading, self.sideslip
        yaw, roll = heading.x
        decay = math.exp(-dt / set_["roll_time"])
        turning = obs["yaw_rate"] / math.cos(roll)
        heading.F = np.array([[1.0, dt * turning * math.tan(roll)], [0.0, decay]])
        lean = self.roll_gradient * obs["accel_y"]
        heading.x = np.array(
            [yaw + dt * turning, decay * roll + (1.0 - decay) * lean + dt * obs["roll_rate"]]
        )
        spread = set_["roll_std"] ** 2 * (1.0 - decay**2)
        heading.P = heading.F @ heading.P @ heading.F.T
        heading.P += np.diag([set_["yaw_walk"] ** 2 * dt, spread])
        if obs["magnetic_field_x_new"]:
            by_pitch = np.array([self.field[1], 0.0, 0.0])
            heading.R = self.magnetometer + set_["pitch_std"] ** 2 * np.outer(by_pitch, by_pitch)
            field = np.array([obs[f"magnetic_field_{axis}"] for axis in "xyz"]) * 1e6
            heading.update(field, self.jacobian, self.model)
        yaw, roll = heading.x
        accel_y = obs["accel_y"] - GRAVITY * math.sin(roll)
        c, s = math.cos(turning * dt), math.sin(turning * dt)
        F = np.eye(4)
        F[0], F[2] = (c, -dt * c, s, -dt * s), (-s, dt * s, c, -dt * c)
        Q = np.diag([set_["velocity_walk"] ** 2 * dt, set_["bias_walk"] ** 2 * dt] * 2)
        B = -F[:, [1, 3]]
        B[[1, 3]] = 0.0
        sideslip.predict(u=np.array([obs["accel_x"], accel_y]), B=B, F=F, Q=Q)
        if obs["velocity_north_new"]:
            north, west = obs["velocity_north"], obs["velocity_west"]
            c, s = math.cos(yaw), math.sin(yaw)
            measured = np.array([c * north + s * west, c * west - s * north])
            noise = set_["gps_std"] ** 2 + measured[::-1] ** 2 * heading.P[0, 0]
            sideslip.update(measured, R=np.diag(noise))
        x = sideslip.x
        return self.friction.step(x[0], x[2], turning, obs["steer_angle"], accel_y - x[3], dt)


class FrictionTwin:
    """The friction filter around filterpy."""

    def __init__(self, vehicle, settings):
        own = [name for name, value in settings.items() if not isinstance(value, str)]
        names = (*VelocityFrictionEkf.vehicle_parameters, *own)
        values = tuple((settings | vehicle)[name] for name in names)
        self.params = np.array([values], [(name, np.float64) for name in names])[0]
        self.settings = settings
        self.filter = ExtendedKalmanFilter(dim_x=1, dim_z=1)
        self.filter.x = np.array([[settings["first_mu"]]])
        self.filter.P = np.array([[settings["first_mu_std"] ** 2]])

    def step(self, speed_x, speed_y, yaw_rate, steer, accel_y, dt):
        """Take one sample; return the friction."""
        filter, params = self.filter, self.params
        filter.Q = np.array([[self.settings["mu_walk"] ** 2 * dt]])
        filter.predict()
        if abs(accel_y) >= self.settings["least_accel"]:
            slips = slip_angles(speed_x, speed_y, yaw_rate, steer, params)
            mu = filter.x[0, 0]
            expected, slope = lateral_acceleration(mu, *slips, steer, params)
            if abs(slope) >= self.settings["least_slope"]:
                filter.R = np.array([[self.settings["accel_y_density"] ** 2 / dt]])
                filter.update(
                    np.array([[accel_y]]),
                    lambda _: np.array([[slope]]),
                    lambda _: np.array([[expected]]),
                )
        return filter.x[0, 0]


def cascade(scenario, first):
    """Return a call of the cascade's twin."""
    vehicle, observations = drive(scenario, first)
    times = np.diff(observations["time"], prepend=observations["time"][0] - 0.002)
    yaw = float(record(load_scenario(scenario), 0).truth["yaw"][first])

    def run():
        twin = CascadeTwin(vehicle)
        twin.start(yaw, float(observations["speed_x"][0]))
        return [twin.step(obs, dt) for obs, dt in zip(observations, times, strict=True)]

    return run


def friction(scenario, first):
    """Return a call of the friction filter's twin."""
    vehicle, observations = drive(scenario, first)
    settings = VelocityFrictionEkf().settings
    names = ("speed_x", "speed_y", "yaw_rate", "steer_angle", "accel_y")

    def run():
        twin = FrictionTwin(vehicle, settings)
        found, before = [], observations["time"][0] - 0.002
        for obs in observations:
            if obs["accel_y_new"]:
                found.append(twin.step(*(obs[name] for name in names), obs["time"] - before))
                before = obs["time"]
        return found

    return run
