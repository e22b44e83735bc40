"""Friction filter of Yoon, Li & Ahn (2015), eq. 13-16: friction from sideslip and a brush tyre.

An extended Kalman filter over the friction coefficient alone. Slip angles follow from the sideslip
angle (eq. 14), the brush tyre gives the lateral forces (eq. 15), and their sum is compared with
the measured lateral acceleration (eq. 16).

Errata, corrected here; `gripbench.methods.printed.yoon2015` has the printed forms:

- (15): the condition is on the magnitude of the slip angle; as printed the force keeps growing
  for a large negative one, to -2 mu F_z at theta sigma = -2. Only the product c_p l^2 enters, so
  the two "parameters that characterise the tyre" are one: here the cornering stiffness of an
  axle, 4 c_p l^2.
- (16): the model gives the acceleration of the tyre forces, so bias and gravity's component by
  roll are taken off the measured one first.

Where the tyres are not excited the acceleration says nothing about the friction: an update is
left out while |d a_y / d mu| is small, and while the acceleration itself is, since an error of
the sideslip looks like sliding on a road of no friction then.

Of its variance: the sideslip is taken for known, and the error of the tyre model, which lasts for
a whole bend, for white noise.
"""

from __future__ import annotations

import numpy as np

from gripbench.envs.vehicles import GRAVITY
from gripbench.methods.contract import Parameter, compiled

FRICTION_STATE = np.dtype(
    [("mu", np.float64), ("variance", np.float64), ("time", np.float64), ("taken", np.int64)]
)
"""State of the friction filter."""

FRICTION_VEHICLE = (
    "mass",
    "cg_to_front",
    "cg_to_rear",
    "cornering_stiffness_front",
    "cornering_stiffness_rear",
)

FRICTION_PARAMETERS = (
    Parameter("first_mu", 0.5, "-", "Friction before any measurement", 0.03, 1.2),
    Parameter("first_mu_std", 0.3, "-", "Its standard deviation", 1e-6, 10.0),
    Parameter("mu_walk", 0.005, "1/sqrt(s)", "Random walk of the friction", 0.0, 10.0),
    Parameter(
        "accel_y_density", 0.08, "m/s^2 sqrt(s)",
        "Noise density of the modelled lateral acceleration, mostly of the tyre model: "
        "1.03 m/s^2 a sample at 166 Hz",
        1e-9, 100.0,
    ),
    Parameter("least_slope", 0.3, "m/s^2", "Least |d a_y / d mu| of an update", 0.0, 100.0),
    Parameter("least_accel", 0.8, "m/s^2", "Least |a_y| of an update", 0.0, 100.0),
    Parameter("least_speed", 2.0, "m/s", "Least speed of an update", 0.1, 100.0),
)  # fmt: skip

_LEAST_MU, _LARGEST_MU = 0.03, 1.2


@compiled
def slides(share):
    """Return whether a tyre slides, eq. 15, at this theta sigma: 1 where sliding begins."""
    return abs(share) > 1.0


@compiled
def brush_force(slip_angle, mu, load, stiffness):
    """Return the lateral force of a brush tyre, eq. 15, and its derivative to the friction.

    Parameters
    ----------
    slip_angle
        Slip angle [rad]; positive gives a positive force.
    mu
        Friction coefficient.
    load
        Vertical load [N].
    stiffness
        Force over slip angle at zero slip, 2 c_p l^2 for a tyre [N/rad].

    Returns
    -------
    Force [N] and its derivative [N].
    """
    slip = np.tan(slip_angle)
    share = stiffness * slip / (3.0 * mu * load)  # theta_y sigma_y
    if slides(share):
        sign = 1.0 if share > 0.0 else -1.0
        return sign * mu * load, sign * load
    size = abs(share)
    force = stiffness * slip * (1.0 - size + size * size / 3.0)
    return force, stiffness * slip / mu * size * (1.0 - 2.0 / 3.0 * size)


@compiled
def acceleration_of_forces(reading, level, bias):
    """Return the acceleration that the tyre forces cause [m/s^2], the measurement of eq. 16.

    Parameters
    ----------
    reading
        The lateral accelerometer's reading [m/s^2].
    level
        The same without gravity's component by roll [m/s^2].
    bias
        The accelerometer's bias [m/s^2].
    """
    return level - bias


@compiled
def lateral_acceleration(mu, slip_front, slip_rear, steer, params):
    """Return the lateral acceleration of eq. 16 [m/s^2] and its derivative to the friction."""
    wheelbase = params.cg_to_front + params.cg_to_rear
    weight = params.mass * GRAVITY
    front, front_slope = brush_force(
        slip_front, mu, weight * params.cg_to_rear / wheelbase, params.cornering_stiffness_front
    )
    rear, rear_slope = brush_force(
        slip_rear, mu, weight * params.cg_to_front / wheelbase, params.cornering_stiffness_rear
    )
    turn = np.cos(steer)
    return (front * turn + rear) / params.mass, (front_slope * turn + rear_slope) / params.mass


@compiled
def slip_angles(speed_x, speed_y, yaw_rate, steer, params):
    """Return the slip angles of the axles [rad], eq. 14 without its small angles."""
    front = steer - np.arctan2(speed_y + params.cg_to_front * yaw_rate, speed_x)
    rear = -np.arctan2(speed_y - params.cg_to_rear * yaw_rate, speed_x)
    return front, rear


@compiled
def friction_predict(friction, elapsed, params):
    """Advance the friction, a random walk, over `elapsed` [s]."""
    friction.variance += params.mu_walk**2 * elapsed


@compiled
def friction_update(friction, accel_y, slip_front, slip_rear, steer, variance, params):
    """Take a measured lateral acceleration [m/s^2] with its variance; return whether it was used.

    It is not where it says nothing about the friction, |d a_y / d mu| below `least_slope`.
    """
    expected, slope = lateral_acceleration(friction.mu, slip_front, slip_rear, steer, params)
    if not abs(slope) >= params.least_slope:
        return False
    spread = slope * slope * friction.variance + variance
    gain = friction.variance * slope / spread
    mu = friction.mu + gain * (accel_y - expected)
    friction.mu = min(max(mu, _LEAST_MU), _LARGEST_MU)
    friction.variance *= variance / spread
    friction.taken += 1
    return True


@compiled
def friction_step(friction, time, speed_x, speed_y, yaw_rate, steer, accel_y, params):
    """Advance the friction filter by one sample.

    Parameters
    ----------
    friction
        Record of `FRICTION_STATE`.
    time
        Time [s].
    speed_x, speed_y
        Velocity of the centre of gravity [m/s].
    yaw_rate
        Yaw rate [rad/s].
    steer
        Steering angle at the road [rad].
    accel_y
        Lateral acceleration that the tyre forces cause [m/s^2].
    params
        Record with `FRICTION_PARAMETERS` and `FRICTION_VEHICLE`.
    """
    if friction.variance == 0.0:
        friction.mu = params.first_mu
        friction.variance = params.first_mu_std**2
        friction.time = time
    elapsed = time - friction.time
    if not elapsed > 0.0:
        return
    friction.time = time
    friction_predict(friction, elapsed, params)
    if speed_x > params.least_speed and abs(accel_y) >= params.least_accel:
        front, rear = slip_angles(speed_x, speed_y, yaw_rate, steer, params)
        friction_update(
            friction, accel_y, front, rear, steer, params.accel_y_density**2 / elapsed, params
        )
