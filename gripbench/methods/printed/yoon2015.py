"""Equations as Yoon, Li & Ahn (2015) print them, in place of the corrected ones.

What is wrong with each stands at the corrected form, in `gripbench.methods.heading_ekf` and
`gripbench.methods.friction_ekf`. Eq. 8 and 12 cannot be run as printed: eq. 9 contradicts eq. 8,
and eq. 12 gives the complement of the angle.
"""

from __future__ import annotations

import numpy as np

from gripbench.compilation import compiled
from gripbench.methods.friction_ekf import acceleration_of_forces, slides
from gripbench.methods.heading_ekf import (
    TABLE_1_NOISE,
    is_probable,
    roll_speed,
    west_in_z,
    yaw_by_roll,
    yaw_speed,
)
from gripbench.methods.settings import Variant


@compiled
def printed_gate(distance, gate):
    """Return whether the distance itself is within the threshold of eq. 4."""
    return np.sqrt(distance) <= gate


@compiled
def printed_west_in_z(north, west, roll):
    """Return the first term of m_z with cos phi as eq. 6 prints it, and its slopes."""
    return west * np.cos(roll), north * np.cos(roll), -west * np.sin(roll)


@compiled
def printed_yaw_speed(yaw_rate, roll):
    """Return the yaw rate for psi', eq. 7."""
    return yaw_rate


@compiled
def printed_roll_speed(roll_rate, turning, pitch):
    """Return the roll rate for phi', eq. 7."""
    return roll_rate


@compiled
def printed_yaw_by_roll(elapsed, turning, roll):
    """Return no slope, for psi' of eq. 7 does not know the roll."""
    return 0.0


@compiled
def printed_slides(share):
    """Return whether a tyre slides, eq. 15: for positive slip angles only."""
    return share > 1.0


@compiled
def printed_acceleration(reading, level, bias):
    """Return the accelerometer's reading for the measurement of eq. 16."""
    return reading


EQ_4 = {is_probable: printed_gate}
EQ_6 = {west_in_z: printed_west_in_z}
EQ_7 = {
    yaw_speed: printed_yaw_speed,
    roll_speed: printed_roll_speed,
    yaw_by_roll: printed_yaw_by_roll,
}
EQ_15 = {slides: printed_slides}
EQ_16 = {acceleration_of_forces: printed_acceleration}

FORMS = {
    "heading_ekf": {"paper": Variant(TABLE_1_NOISE, functions=EQ_4 | EQ_6 | EQ_7)},
    "magnetometer_gps_cascade": {
        "paper": Variant(TABLE_1_NOISE, functions=EQ_4 | EQ_6 | EQ_7 | EQ_15 | EQ_16),
        "paper_4": Variant(functions=EQ_4),
        "paper_6": Variant(functions=EQ_6),
        "paper_7": Variant(functions=EQ_7),
        "paper_15": Variant(functions=EQ_15),
        "paper_16": Variant(functions=EQ_16),
    },
}
"""Variants with printed equations, by method."""
