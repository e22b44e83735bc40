"""Heading filter of Yoon, Li & Ahn (2015), eq. 5-7: yaw and roll from magnetometer and gyroscopes.

An extended Kalman filter over yaw and roll. The gyroscopes drive it (eq. 7), the Earth's field
seen by the magnetometer corrects it (eq. 6), and a measurement whose Mahalanobis distance is
improbable is rejected (eq. 4): a passing lorry must not turn the heading.

Errata, corrected here; `gripbench.methods.printed.yoon2015` has the printed forms:

- (4): the chi-square threshold applies to the squared distance of the innovation.
- (5): the third column is (-sin theta, cos theta sin phi, cos theta cos phi).
- (6): the first term of m_z is M_X sin psi sin phi; printed with cos phi the model contradicts
  the field itself and nearly every measurement is rejected.
- (7): a body that rolls turns about the vertical with psi' = r / cos phi, and a pitched one
  rolls as it turns, phi' = p + psi' sin theta.

Two additions carry the filter over real roads. Where the field is steep a pitch of 1 degree looks
like several degrees of heading, so an unknown pitch enters the measurement covariance as a
considered parameter. And with one direction vector yaw and roll are not both observable on
northerly and southerly headings: roll is therefore an Ornstein-Uhlenbeck process around the roll
of the body on its springs, which the lateral acceleration gives (`no_roll_model`: around zero).
The variant `pitch_aware` takes the road's pitch from the vertical velocity of the GPS, with the
pitch gyroscope between its samples, and a weak roll from the lateral accelerometer.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gripbench.envs.vehicles import GRAVITY
from gripbench.methods.blocks.course_history import wrapped
from gripbench.methods.blocks.kalman import (
    correct,
    correct_scalar,
    filter_type,
    innovation_distance,
    predict_covariance,
)
from gripbench.methods.contract import CompiledMethod, Parameter, compiled
from gripbench.methods.settings import Setting

_DEGREE = np.pi / 180.0
_PITCH_HISTORY = 2048

HEADING_STATE = np.dtype(
    [
        ("filter", filter_type(2, 3)),  # yaw, roll
        ("time", np.float64),
        ("started", np.int64),
        ("aligned", np.int64),
        ("start_time", np.float64),
        ("turned", np.float64),  # yaw since the start, while aligning
        ("along", np.float64),  # mean level field of the alignment, turned back to the start
        ("across", np.float64),
        ("rejected", np.int64),
        ("taken", np.int64),
        ("pitch", np.float64),
        ("pitch_variance", np.float64),
        ("pitch_turned", np.float64),  # integral of the pitch gyroscope
        ("gps_time", np.float64),
        ("steps", np.int64),
        ("past_time", np.float64, (_PITCH_HISTORY,)),
        ("past_pitch_turned", np.float64, (_PITCH_HISTORY,)),
    ]
)
"""State of the heading filter; `filter.x` is yaw and roll [rad]."""

HEADING_SENSORS = (
    "magnetic_field_x",
    "magnetic_field_y",
    "magnetic_field_z",
    "magnetic_field_x_new",
    "yaw_rate",
    "roll_rate",
    "pitch_rate",
    "accel_y",
    "velocity_north",
    "velocity_west",
    "velocity_up",
    "velocity_north_new",
    "gps_time",
)

HEADING_VEHICLE = ("roll_gradient",)

HEADING_PARAMETERS = (
    Parameter("field_horizontal", 15.8e-6, "T", "Earth's field towards magnetic north", 1e-7, 1e-4),
    Parameter("field_up", -53.2e-6, "T", "Earth's field upwards", -1e-4, 1e-4),
    Parameter("declination", 0.0, "rad", "Magnetic north, from north to west", -np.pi, np.pi),
    Parameter("magnetometer_std", 2e-7, "T", "Magnetometer noise and hard iron", 1e-10, 1e-4),
    Parameter("pitch_std", 30.0 * _DEGREE, "rad", "Unknown pitch, considered", 0.0, 10.0),
    Parameter("gate", 11.34, "-", "Largest Mahalanobis distance squared, 3 axes, 1 %", 0.0),
    Parameter("yaw_walk", 0.03 * _DEGREE, "rad/sqrt(s)", "Random walk of the yaw", 0.0, 1.0),
    Parameter("roll_time", 5.0, "s", "Correlation time of that roll", 1e-3),
    Parameter("roll_std", 1.0 * _DEGREE, "rad", "Roll that the springs do not explain", 0.0, 1.0),
    Parameter("roll_model", True, "-", "The roll returns to that of the springs"),
    Parameter("roll_walk", 0.0, "rad/sqrt(s)", "Random walk of the roll", 0.0, 1.0),
    Parameter("alignment_time", 0.5, "s", "Time over which the first heading is averaged", 0.0),
    Parameter("alignment_pitch_std", 1.0 * _DEGREE, "rad", "Pitch while aligning", 0.0, 1.0),
    Parameter("pitch_from_gps", False, "-", "Road pitch from the vertical velocity"),
    Parameter("pitch_walk", 0.3 * _DEGREE, "rad/sqrt(s)", "Random walk of the pitch", 0.0, 1.0),
    Parameter("velocity_std", 0.05, "m/s", "GPS velocity noise an axis", 1e-6, 100.0),
    Parameter(
        "accelerometer_roll_std", 0.0, "rad sqrt(s)",
        "Noise density of the roll from the lateral accelerometer; 0: not used", 0.0, 100.0,
    ),
)  # fmt: skip

PITCH_AWARE = {
    "pitch_from_gps": True,
    "pitch_std": 5.0 * _DEGREE,
    "roll_std": 0.7 * _DEGREE,
    "accelerometer_roll_std": 4.0 * _DEGREE,
}
"""Settings for roads with grades and banks."""

TABLE_1_NOISE = {
    "magnetometer_std": 5e-8,
    "pitch_std": 0.0,
    "roll_time": 1e9,
    "roll_walk": 0.03 * _DEGREE,
}
"""The noise of Table 1 and neither of the two additions."""

NO_ROLL_MODEL = {"roll_model": False, "roll_time": 2.0, "roll_std": 1.5 * _DEGREE}
"""Roll around zero, without the springs."""

UNGATED = 1e300
"""A gate that lets every finite measurement pass."""


def unread_heading(settings: Mapping[str, Setting]) -> tuple[str, ...]:
    """Return the vehicle parameters that the heading filter does not need."""
    return () if settings["roll_model"] else HEADING_VEHICLE


@compiled
def west_in_z(north, west, roll):
    """Return the first term of m_z, eq. 6 [T], and its slopes over yaw and roll [T/rad]."""
    return west * np.sin(roll), north * np.sin(roll), west * np.cos(roll)


@compiled
def field_in_vehicle(yaw, roll, pitch, horizontal, up):
    """Return the Earth's field in vehicle axes, eq. 5 (eq. 6 at zero pitch).

    Parameters
    ----------
    yaw, roll, pitch
        Attitude against magnetic north [rad], ZYX Euler angles.
    horizontal, up
        Field towards magnetic north and upwards [T].

    Returns
    -------
    Components along x, y and z [T].
    """
    north = horizontal * np.cos(yaw)
    west = horizontal * np.sin(yaw)
    lifted = north * np.sin(pitch) + up * np.cos(pitch)
    x = north * np.cos(pitch) - up * np.sin(pitch)
    y = -west * np.cos(roll) + lifted * np.sin(roll)
    z = west_in_z(north, west, roll)[0] + lifted * np.cos(roll)
    return x, y, z


@compiled
def yaw_speed(yaw_rate, roll):
    """Return psi' of eq. 7 [rad/s] from the yaw rate [rad/s] and the roll [rad]."""
    return yaw_rate / np.cos(roll)


@compiled
def roll_speed(roll_rate, turning, pitch):
    """Return phi' of eq. 7 [rad/s] from the roll rate [rad/s], psi' [rad/s] and pitch [rad]."""
    return roll_rate + turning * np.sin(pitch)


@compiled
def yaw_by_roll(elapsed, turning, roll):
    """Return the slope of the yaw over the roll that eq. 7 gives over `elapsed` [s]."""
    return elapsed * turning * np.tan(roll)


@compiled
def heading_predict(heading, yaw_rate, roll_rate, accel_y, elapsed, params):
    """Advance yaw and roll by eq. 7 over `elapsed` [s].

    Parameters
    ----------
    heading
        Record of `HEADING_STATE`.
    yaw_rate, roll_rate
        Rates of the gyroscopes [rad/s].
    accel_y
        Lateral acceleration [m/s^2], for the roll on the springs.
    elapsed
        Time [s].
    params
        Record with `HEADING_PARAMETERS` and `HEADING_VEHICLE`.
    """
    f = heading.filter
    decay = np.exp(-elapsed / params.roll_time)
    roll = f.x[1]
    turning = yaw_speed(yaw_rate, roll)
    f.x[0] += turning * elapsed
    sprung = params.roll_gradient * accel_y if params.roll_model > 0.5 else 0.0
    rolling = roll_speed(roll_rate, turning, heading.pitch)
    f.x[1] = sprung + decay * (roll - sprung) + rolling * elapsed
    f.F[0, 0] = 1.0
    f.F[0, 1] = yaw_by_roll(elapsed, turning, roll)
    f.F[1, 0] = 0.0
    f.F[1, 1] = decay
    f.Q[0, 0] = params.yaw_walk**2 * elapsed
    f.Q[1, 1] = params.roll_walk**2 * elapsed
    f.Q[1, 1] -= params.roll_std**2 * np.expm1(-2.0 * elapsed / params.roll_time)
    predict_covariance(f)


@compiled
def is_probable(distance, gate):
    """Return whether a squared Mahalanobis distance is within the gate, eq. 4."""
    return distance <= gate


@compiled
def heading_update_field(heading, x, y, z, params):
    """Take a magnetometer measurement [T]; return whether it passed the gate (eq. 4)."""
    f = heading.filter
    yaw, roll = f.x[0] - params.declination, f.x[1]
    pitch = heading.pitch
    horizontal, up = params.field_horizontal, params.field_up
    expected = field_in_vehicle(yaw, roll, pitch, horizontal, up)
    f.residual[0] = x - expected[0]
    f.residual[1] = y - expected[1]
    f.residual[2] = z - expected[2]
    north, west = horizontal * np.cos(yaw), horizontal * np.sin(yaw)
    lifted = north * np.sin(pitch) + up * np.cos(pitch)
    slope = north * np.cos(pitch) - up * np.sin(pitch)  # of `lifted` to the pitch
    cosine, sine = np.cos(roll), np.sin(roll)
    first = west_in_z(north, west, roll)
    f.H[0, 0] = -west * np.cos(pitch)
    f.H[1, 0] = -north * cosine - west * np.sin(pitch) * sine
    f.H[2, 0] = first[1] - west * np.sin(pitch) * cosine
    f.H[0, 1] = 0.0
    f.H[1, 1] = west * sine + lifted * cosine
    f.H[2, 1] = first[2] - lifted * sine
    by_pitch = (-lifted, slope * sine, slope * cosine)
    for i in range(3):
        for j in range(3):
            f.R[i, j] = params.pitch_std**2 * by_pitch[i] * by_pitch[j]
        f.R[i, i] += params.magnetometer_std**2
    if not is_probable(innovation_distance(f), params.gate):
        heading.rejected += 1
        return False
    correct(f)
    heading.taken += 1
    return True


@compiled
def heading_update_roll(heading, roll, variance):
    """Take a measurement of the roll [rad] with its variance [rad^2]."""
    f = heading.filter
    f.h[0] = 0.0
    f.h[1] = 1.0
    correct_scalar(f, roll - f.x[1], variance)


@compiled
def _align(heading, obs, params):
    """Average the level field over the first samples, turned back by the gyroscope."""
    f = heading.filter
    along = obs.magnetic_field_x + params.field_up * np.sin(heading.pitch)
    cosine, sine = np.cos(heading.turned), np.sin(heading.turned)
    heading.along += along * cosine - obs.magnetic_field_y * sine
    heading.across += -obs.magnetic_field_y * cosine - along * sine
    yaw = np.arctan2(heading.across, heading.along) + heading.turned
    f.x[0] = yaw + params.declination
    f.x[1] = 0.0
    # An unknown roll or pitch tilts the steep field into the level plane: both errors are known
    # functions of the attitude, so yaw and roll start correlated.
    steepness = params.field_up / params.field_horizontal
    by_roll, by_pitch = steepness * np.cos(yaw), steepness * np.sin(yaw)
    f.P[0, 0] = (
        (by_roll * params.roll_std) ** 2
        + (by_pitch * params.alignment_pitch_std) ** 2
        + (params.magnetometer_std / params.field_horizontal) ** 2
    )
    f.P[0, 1] = by_roll * params.roll_std**2
    f.P[1, 0] = f.P[0, 1]
    f.P[1, 1] = params.roll_std**2


@compiled
def _follow_pitch(heading, obs, elapsed, params):
    """Follow the road's pitch: gyroscope between the late GPS samples of the vertical velocity."""
    roll = heading.filter.x[1]
    rate = obs.pitch_rate * np.cos(roll) - obs.yaw_rate * np.sin(roll)
    heading.pitch_turned += rate * elapsed
    heading.pitch += rate * elapsed
    heading.pitch_variance += params.pitch_walk**2 * elapsed
    length = heading.past_time.shape[0]
    heading.past_time[heading.steps % length] = obs.time
    heading.past_pitch_turned[heading.steps % length] = heading.pitch_turned
    heading.steps += 1
    level = np.hypot(obs.velocity_north, obs.velocity_west)
    fresh = obs.velocity_north_new > 0.0 and obs.gps_time > heading.gps_time
    if not (fresh and obs.gps_time <= obs.time and level > 1.0):
        return
    heading.gps_time = obs.gps_time
    back = heading.steps - 1
    oldest = max(heading.steps - length, 0)
    while back > oldest and heading.past_time[back % length] > obs.gps_time:
        back -= 1
    since = heading.pitch_turned - heading.past_pitch_turned[back % length]
    seen = -np.arctan2(obs.velocity_up, level) + since
    noise = (params.velocity_std / level) ** 2
    noise += params.pitch_walk**2 * (obs.time - obs.gps_time)
    gain = heading.pitch_variance / (heading.pitch_variance + noise)
    heading.pitch += gain * (seen - heading.pitch)
    heading.pitch_variance *= 1.0 - gain


@compiled
def heading_step(heading, obs, params):
    """Advance the heading filter by one sample of its sensors."""
    if heading.started == 0:
        heading.started = 1
        heading.start_time = obs.time
        heading.time = obs.time
        heading.gps_time = -np.inf
        heading.pitch_variance = (3.0 * np.pi / 180.0) ** 2
    elapsed = max(obs.time - heading.time, 0.0)
    heading.time = max(obs.time, heading.time)
    if params.pitch_from_gps > 0.0:
        _follow_pitch(heading, obs, elapsed, params)
    if heading.aligned == 0:
        heading.turned += obs.yaw_rate * elapsed
        heading.filter.x[0] += obs.yaw_rate * elapsed
        if obs.magnetic_field_x_new > 0.0:
            _align(heading, obs, params)
            if obs.time - heading.start_time >= params.alignment_time:
                heading.aligned = 1
        return
    if elapsed > 0.0:
        heading_predict(heading, obs.yaw_rate, obs.roll_rate, obs.accel_y, elapsed, params)
        if params.accelerometer_roll_std > 0.0:
            level = np.hypot(obs.velocity_north, obs.velocity_west)
            leaning = (obs.accel_y - level * obs.yaw_rate) / GRAVITY
            roll = np.arcsin(min(max(leaning, -1.0), 1.0))
            heading_update_roll(heading, roll, params.accelerometer_roll_std**2 / elapsed)
    if obs.magnetic_field_x_new > 0.0:
        heading_update_field(
            heading, obs.magnetic_field_x, obs.magnetic_field_y, obs.magnetic_field_z, params
        )


@compiled
def _step(state, obs, params, est):
    heading = state.heading
    before = heading.taken
    heading_step(heading, obs, params)
    taken = 1.0 if heading.taken > before else 0.0
    residual, spread = heading.filter.residual, heading.filter.S
    est.magnetic_field_x_innovation = taken * residual[0]
    est.magnetic_field_y_innovation = taken * residual[1]
    est.magnetic_field_z_innovation = taken * residual[2]
    est.magnetic_field_x_innovation_variance = taken * spread[0, 0]
    est.magnetic_field_y_innovation_variance = taken * spread[1, 1]
    est.magnetic_field_z_innovation_variance = taken * spread[2, 2]
    est.yaw = wrapped(heading.filter.x[0])
    est.roll = heading.filter.x[1]
    est.yaw_variance = heading.filter.P[0, 0]
    est.roll_variance = heading.filter.P[1, 1]


class HeadingEkf(CompiledMethod):
    """Yaw and roll from magnetometer and gyroscopes."""

    name = "heading_ekf"
    title = "Heading EKF (magnetometer)"
    reference = "Yoon, Li & Ahn (2015), Int. J. Automotive Technology, eq. 4-7"
    sensors = HEADING_SENSORS
    estimates = ("yaw", "roll")
    variances = ("yaw", "roll")
    innovations = ("magnetic_field_x", "magnetic_field_y", "magnetic_field_z")
    vehicle_parameters = HEADING_VEHICLE
    unread = staticmethod(unread_heading)
    parameters = HEADING_PARAMETERS
    variants = {
        "table_1_noise": TABLE_1_NOISE,
        "pitch_aware": PITCH_AWARE,
        "no_roll_model": NO_ROLL_MODEL,
        "no_rejection": {"gate": UNGATED},
    }
    printed = "gripbench.methods.printed.yoon2015"
    state = np.dtype([("heading", HEADING_STATE)])
    step = _step
