"""The lateral filters a second time, around filterpy's filters."""

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter, KalmanFilter
from single_track_drive import STEP, held

from gripbench.methods.dugoff_ekf import DUGOFF_PARAMETERS, DUGOFF_STATE, DugoffEkf, evaluate

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")


def kinematic(method, obs):
    """Return heading and bias, shape (n, 2), with the published rule of turns, and covariance."""
    set_ = method.settings
    filter = KalmanFilter(dim_x=2, dim_z=1)
    filter.F = np.array([[1.0, -STEP], [0.0, 1.0]])
    filter.B = np.array([[STEP], [0.0]])
    filter.Q = STEP * np.diag([set_["gyro_noise"] ** 2, set_["bias_walk"] ** 2])
    filter.H = np.array([[1.0, 0.0]])
    filter.R = np.array([[(set_["gps_speed_noise"] / 30.0) ** 2]])
    filter.x = np.array([[obs["course"][0]], [0.0]])
    filter.P = np.diag([filter.R[0, 0], set_["bias_std"] ** 2])
    smooth, until = 0.0, -np.inf
    states = [filter.x[:, 0].copy()]
    for k in range(1, len(obs)):
        filter.predict(u=np.array([[0.5 * (obs["yaw_rate"][k - 1] + obs["yaw_rate"][k])]]))
        share = 1.0 - np.exp(-STEP / set_["turn_smoothing"])
        smooth += share * (obs["yaw_rate"][k] - smooth)
        limit = set_["turn_rate"] + 2.0 * np.sqrt(filter.P[1, 1])
        if abs(smooth - filter.x[1, 0]) > limit:
            until = obs["time"][k] + set_["turn_hold"]
        if obs["course_new"][k] and obs["time"][k] >= until:
            residual = (obs["course"][k] - filter.x[0, 0] + np.pi) % (2 * np.pi) - np.pi
            filter.update(filter.x[0, 0] + residual)
        states.append(filter.x[:, 0].copy())
    return np.array(states), filter.P


def single_track(method, obs, vehicle, speed):
    """Return the four states of the model-based filter and their covariance, matrices by scipy."""
    set_ = method.settings
    transition, inputs = held(vehicle, speed)
    filter = KalmanFilter(dim_x=4, dim_z=1)
    filter.F = np.eye(4)
    filter.F[:3, :3] = transition
    filter.B = np.vstack([inputs[:, :1], [[0.0]]])
    filter.Q = filter.B @ filter.B.T * set_["steer_noise"] ** 2 / STEP
    filter.Q[3, 3] += set_["bias_walk"] ** 2 * STEP
    course_variance = (set_["gps_speed_noise"] / speed) ** 2
    gyro_variance = set_["gyro_noise"] ** 2 / STEP
    gyro, gps = np.array([[0.0, 1.0, 0.0, 1.0]]), np.array([[1.0, 0.0, 1.0, 0.0]])
    beta, bias = set_["sideslip_std"] ** 2, set_["bias_std"] ** 2
    filter.x = np.array([[0.0], [obs["yaw_rate"][0]], [obs["course"][0]], [0.0]])
    filter.P = np.diag([beta, gyro_variance + bias, beta + course_variance, bias])
    filter.P[0, 2] = filter.P[2, 0] = -beta
    filter.update(obs["yaw_rate"][0], R=gyro_variance, H=gyro)
    states = [filter.x[:, 0].copy()]
    for k in range(1, len(obs)):
        filter.predict(u=np.array([[0.5 * (obs["steer_angle"][k - 1] + obs["steer_angle"][k])]]))
        if obs["course_new"][k]:
            predicted = filter.x[0, 0] + filter.x[2, 0]
            residual = (obs["course"][k] - predicted + np.pi) % (2.0 * np.pi) - np.pi
            filter.update(predicted + residual, R=course_variance, H=gps)
        filter.update(obs["yaw_rate"][k], R=gyro_variance, H=gyro)
        states.append(filter.x[:, 0].copy())
    return np.array(states), filter.P


def dugoff_model(vehicle, settings=None):
    """Return a state record and the parameters of the Dugoff EKF."""
    values = {name: vehicle[name] for name in DugoffEkf.vehicle_parameters}
    values |= {parameter.name: parameter.default for parameter in DUGOFF_PARAMETERS}
    values |= settings or {}
    params = np.array([tuple(values.values())], [(name, np.float64) for name in values])
    return np.zeros(1, DUGOFF_STATE)[0], params[0]


def dugoff(method, obs, vehicle):
    """Return the states of the Dugoff EKF, forward Euler and joint correction, and covariance."""
    state, params = dugoff_model(vehicle)
    set_ = method.settings
    filter = ExtendedKalmanFilter(dim_x=3, dim_z=2)
    filter.x = np.array([obs["speed_x"][0], 0.0, obs["yaw_rate"][0]])
    noise = 10.0 * np.array([set_["speed_x_noise"], set_["yaw_rate_noise"]])  # at 100 Hz
    filter.P = np.diag(np.square([noise[0], set_["speed_y_std"], noise[1]]))
    filter.R = np.diag(np.square(noise))
    walk = np.diag([set_["speed_x_walk"], set_["speed_y_walk"], set_["yaw_rate_walk"]])
    H = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    states = [filter.x.copy()]
    for k in range(1, len(obs)):
        step = obs["time"][k] - obs["time"][k - 1]
        _dugoff_inputs(state, obs[k - 1], vehicle["wheel_radius"])
        state["filter"]["x"][:] = filter.x
        evaluate(state, params)
        filter.F = np.eye(3) + step * state["slope"]
        filter.x = filter.x + step * state["rate"]
        filter.P = filter.F @ filter.P @ filter.F.T + step * walk
        z = np.array([obs["speed_x"][k], obs["yaw_rate"][k]])
        filter.update(z, lambda _: H, lambda x: H @ x)
        states.append(filter.x.copy())
    return np.array(states), filter.P


def _dugoff_inputs(state, sample, radius):
    state["steer_angle"] = sample["steer_angle"]
    state["accel_x"], state["accel_y"] = sample["accel_x"], sample["accel_y"]
    for i, wheel in enumerate(WHEELS):
        state["rolling"][i] = radius * sample[f"wheel_speed_{wheel}"]
