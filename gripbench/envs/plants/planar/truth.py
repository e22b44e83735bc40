"""The truth of the planar world: what one sample holds, and the kernel that writes it.

The scalars come first, then for each quantity of `PER_WHEEL` the four wheels, so that the kernel
can write the wheels by their place.
"""

from __future__ import annotations

import math

from gripbench.compilation import compiled
from gripbench.envs.drivers.path_drivers import wrapped
from gripbench.envs.plants.planar import plant
from gripbench.envs.signals import record_type
from gripbench.envs.vehicles import GRAVITY

WHEEL_NAMES = ("front_left", "front_right", "rear_left", "rear_right")

_SCALARS = (
    "time",
    "steer_angle",
    "accel_x",
    "accel_y",
    "accel_z",
    "roll_rate",
    "pitch_rate",
    "yaw_rate",
    "magnetic_field_x",
    "magnetic_field_y",
    "magnetic_field_z",
    "velocity_north",
    "velocity_west",
    "velocity_up",
    "gps_time",
    "course",
    "speed_x",
    "speed_y",
    "speed_gps",
    "sideslip",
    "yaw",
    "roll",
    "pitch",
    "suspension_roll",
    "position_x",
    "position_y",
    "road_bank",
    "road_grade",
    "mu",
    "mu_used",
    "utilisation",
    "force_y_front",
    "force_y_rear",
)

PER_WHEEL = (
    "wheel_speed",
    "torque",
    "slip_ratio",
    "slip_angle",
    "force_x",
    "force_y",
    "force_z",
    "mu",
    "mu_used",
)

TRUTH = record_type(
    (*_SCALARS, *(f"{quantity}_{wheel}" for quantity in PER_WHEEL for wheel in WHEEL_NAMES))
)
"""Structured type of one sample of the truth."""

_FIRST_WHEEL = len(_SCALARS)


@compiled
def write_truth(time, x, u, p, heading, north, up, disturbance, wheels, dx, row, columns):
    """Write one sample of the truth.

    Parameters
    ----------
    time
        Time of the sample [s].
    x, u, p
        State, inputs and parameters of the plant.
    heading
        Direction of the track, from north to west [rad].
    north, up
        The Earth's magnetic field [T].
    disturbance
        What disturbs it in the vehicle's axes [T], shape (3,).
    wheels, dx
        Work space for the wheels and the derivative of the state.
    row, columns
        The sample as a record of `TRUTH` and, in the same memory, as an array.
    """
    plant.derivative(x, u, p, wheels, dx)
    force_x, force_y, _ = plant.wheel_forces(x, u, p, wheels)
    bank = u[plant.BANK]
    grade = u[plant.GRADE]
    yaw = x[plant.YAW] + heading
    roll = x[plant.ROLL] + bank
    lean = -p.pitch_gradient * x[plant.LAGGED_X]  # nose down under braking
    pitch = lean + grade
    row.time = time
    row.steer_angle = x[plant.STEER]
    row.gps_time = time
    row.speed_x = x[plant.V_X]
    row.speed_y = x[plant.V_Y]
    row.speed_gps = x[plant.V_X]
    # At rest there is no direction of travel; a crawl below 1 mm/s has none either.
    moving = math.hypot(x[plant.V_X], x[plant.V_Y]) > 1e-3
    row.sideslip = math.atan2(x[plant.V_Y], x[plant.V_X]) if moving else 0.0

    # Specific force in the axes of the road, turned into those of the body by its lean and roll.
    along = force_x / p.mass
    across = force_y / p.mass
    normal = u[plant.NORMAL]
    row.accel_x = math.cos(lean) * along - math.sin(lean) * normal
    tilted = math.sin(lean) * along + math.cos(lean) * normal
    row.accel_y = math.cos(x[plant.ROLL]) * across + math.sin(x[plant.ROLL]) * tilted
    row.accel_z = math.cos(x[plant.ROLL]) * tilted - math.sin(x[plant.ROLL]) * across

    roll_change = dx[plant.ROLL] + u[plant.BANK_RATE]
    pitch_change = -p.pitch_gradient * dx[plant.LAGGED_X] + u[plant.GRADE_RATE]
    yaw_change = dx[plant.YAW]
    sin_pitch, cos_pitch = math.sin(pitch), math.cos(pitch)
    sin_roll, cos_roll = math.sin(roll), math.cos(roll)
    row.roll_rate = roll_change - yaw_change * sin_pitch
    row.pitch_rate = pitch_change * cos_roll + yaw_change * cos_pitch * sin_roll
    row.yaw_rate = yaw_change * cos_pitch * cos_roll - pitch_change * sin_roll

    sin_yaw, cos_yaw = math.sin(yaw), math.cos(yaw)
    level = cos_yaw * sin_pitch * north + cos_pitch * up
    row.magnetic_field_x = cos_yaw * cos_pitch * north - sin_pitch * up + disturbance[0]
    row.magnetic_field_y = -sin_yaw * cos_roll * north + sin_roll * level + disturbance[1]
    row.magnetic_field_z = sin_yaw * sin_roll * north + cos_roll * level + disturbance[2]

    forward = u[plant.ALONG_X] * x[plant.V_X] + u[plant.ALONG_Y] * x[plant.V_Y]
    left = u[plant.ACROSS_Y] * x[plant.V_Y]
    row.velocity_north = cos_yaw * forward - sin_yaw * left
    row.velocity_west = sin_yaw * forward + cos_yaw * left
    climb = math.cos(grade) * math.sin(bank)
    row.velocity_up = -math.sin(grade) * x[plant.V_X] + climb * x[plant.V_Y]
    row.course = math.atan2(row.velocity_west, row.velocity_north) if moving else wrapped(yaw)
    row.yaw = wrapped(yaw)
    row.roll = roll
    row.pitch = pitch
    row.suspension_roll = x[plant.ROLL]
    sin_track, cos_track = math.sin(heading), math.cos(heading)
    row.position_x = cos_track * x[plant.X] - sin_track * x[plant.Y]
    row.position_y = sin_track * x[plant.X] + cos_track * x[plant.Y]
    row.road_bank = bank
    row.road_grade = grade
    row.force_y_front = wheels[0, plant.FORCE_Y] + wheels[1, plant.FORCE_Y]
    row.force_y_rear = wheels[2, plant.FORCE_Y] + wheels[3, plant.FORCE_Y]
    _write_wheels(x, u, p, wheels, row, columns)
    row.utilisation = math.hypot(along, across) / (row.mu * GRAVITY)


@compiled
def _write_wheels(x, u, p, wheels, row, columns):
    available = 0.0
    used = 0.0
    for i in range(4):
        radius = p.radius_front if i < 2 else p.radius_rear
        rolling = radius * x[plant.WHEEL + i]
        speed_x = wheels[i, plant.LON_SPEED]
        force = math.hypot(wheels[i, plant.FORCE_X], wheels[i, plant.FORCE_Y])
        load = wheels[i, plant.LOAD]
        share = force / load if load > 0.0 else 0.0
        larger = max(abs(rolling), abs(speed_x))
        at = _FIRST_WHEEL + i
        columns[at] = x[plant.WHEEL + i]
        columns[at + 4] = wheels[i, plant.APPLIED_TORQUE]
        columns[at + 8] = (rolling - speed_x) / plant.rolling_speed(larger)
        columns[at + 12] = math.atan2(wheels[i, plant.LAT_SPEED], plant.rolling_speed(abs(speed_x)))
        columns[at + 16] = wheels[i, plant.FORCE_X]
        columns[at + 20] = wheels[i, plant.FORCE_Y]
        columns[at + 24] = load
        columns[at + 28] = u[plant.MU + i]
        columns[at + 32] = share
        available += 0.25 * u[plant.MU + i]
        used += 0.25 * share
    row.mu = available
    row.mu_used = used
