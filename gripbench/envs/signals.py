"""The signal table: every channel of the project, declared once.

Axes follow ISO 8855: x forward, y left, z up; angles are right-handed, so a positive pitch or
road grade lowers the nose (downhill) and a positive yaw rate turns left. SI units and radians
throughout.

A signal has one name wherever it occurs: in the truth of a recording, in the observations that
a sensor gives of it, and in the estimates of a method. It has one unit in which people see it, in
tables, pictures and pages alike: degrees for angles, degrees a second for the body's rates.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from gripbench.errors import InputError, unknown
from gripbench.extensions import entry_points, load

VARIANCE = "_variance"
"""Suffix of the estimate that holds the variance of another estimate."""

QUANTILE = "_q"
"""Before the digits of a level: the estimate that holds that quantile of another, as `mu_q05`."""

INNOVATION = "_innovation"
"""Suffix of the field that holds a channel's last reading less its prediction."""

NEW = "_new"
"""Suffix of the flag that is 1 when a held channel carries a new sample, else 0."""


@dataclass(frozen=True)
class Signal:
    """One channel.

    Attributes
    ----------
    name
        Unique name.
    unit
        SI unit, `-` where there is none.
    frame
        Axes in which the signal is resolved.
    sign
        What a positive value means.
    instrument
        What measures it in a vehicle; empty for a quantity that is truth or estimate only;
        `idealised` for one that no sensor in a vehicle gives.
    description
        What it is.
    shape
        Shape of one sample; every signal is a scalar.
    """

    name: str
    unit: str
    frame: str
    sign: str
    instrument: str
    description: str
    shape: tuple[int, ...] = ()

    @property
    def idealised(self) -> bool:
        """Whether no sensor in a vehicle gives this channel."""
        return self.instrument == IDEALISED

    @property
    def angle(self) -> bool:
        """Whether values that differ by whole turns mean the same: a plane angle [rad]."""
        return self.unit == "rad"

    @property
    def display_unit(self) -> str:
        """Unit in which people see the signal, `-` where there is none."""
        return self._display[0]

    @property
    def display_factor(self) -> float:
        """Factor from the SI value to the one that people see."""
        return self._display[1]

    @property
    def _display(self) -> tuple[str, float]:
        if self.frame == "wheel" and not self.angle:
            return self.unit, 1.0  # a wheel turns many times a second
        return _DISPLAY.get(self.unit, (self.unit, 1.0))


_DEGREES = 180.0 / math.pi

_DISPLAY = {
    "rad": ("deg", _DEGREES),
    "rad/s": ("deg/s", _DEGREES),
    "(rad)^2": ("deg^2", _DEGREES**2),
    "(rad/s)^2": ("(deg/s)^2", _DEGREES**2),
}
"""Display unit and factor by SI unit, for those that are not shown as they are."""


IDEALISED = "idealised"
WHEEL_SPEED_SENSOR = "wheel speed sensor"
TORQUE_ON_BUS = "torque on the vehicle bus"
ACCELEROMETER = "accelerometer"
GPS = "GPS receiver"
GRADE_ESTIMATE = "road grade estimate"
BANK_MAP = "road bank map"
GYROSCOPE = "gyroscope"
SPEED_SENSOR = "optical speed sensor"
MAGNETOMETER = "magnetometer"
STEERING_SENSOR = "steering angle sensor"

_LONGITUDINAL = (
    Signal("time", "s", "-", "-", "clock", "Time of the sample"),
    Signal(
        "wheel_speed_front", "rad/s", "wheel", "rolling forward", WHEEL_SPEED_SENSOR,
        "Angular velocity of the front axle's wheels",
    ),
    Signal(
        "wheel_speed_rear", "rad/s", "wheel", "rolling forward", WHEEL_SPEED_SENSOR,
        "Angular velocity of the rear axle's wheels",
    ),
    Signal(
        "torque_front", "N m", "wheel", "driving forward, braking is negative", TORQUE_ON_BUS,
        "Traction or brake torque on the front axle",
    ),
    Signal(
        "torque_rear", "N m", "wheel", "driving forward, braking is negative", TORQUE_ON_BUS,
        "Traction or brake torque on the rear axle",
    ),
    Signal(
        "accel_x", "m/s^2", "vehicle", "forward", ACCELEROMETER,
        "Specific force along x: rate of change of velocity less gravity's component",
    ),
    Signal(
        "speed_gps", "m/s", "vehicle", "forward", GPS,
        "Speed over ground along x",
    ),
    Signal(
        "road_grade", "rad", "road", "downhill", GRADE_ESTIMATE,
        "Inclination of the road along x",
    ),
    Signal(
        "speed_x_rate", "m/s^2", "vehicle", "forward", IDEALISED,
        "Exact rate of change of v_x, gravity's component included",
    ),
    Signal(
        "wheel_acceleration_front", "rad/s^2", "wheel", "spinning up", IDEALISED,
        "Exact angular acceleration of the front axle's wheels",
    ),
    Signal(
        "wheel_acceleration_rear", "rad/s^2", "wheel", "spinning up", IDEALISED,
        "Exact angular acceleration of the rear axle's wheels",
    ),
    Signal("speed_x", "m/s", "vehicle", "forward", SPEED_SENSOR, "Longitudinal velocity v_x"),
    Signal("slip_ratio_front", "-", "wheel", "driving", "", "Slip ratio of the front axle"),
    Signal("slip_ratio_rear", "-", "wheel", "driving", "", "Slip ratio of the rear axle"),
    Signal(
        "force_x_front", "N", "wheel", "driving forward", "", "Longitudinal tyre force, front axle"
    ),
    Signal(
        "force_x_rear", "N", "wheel", "driving forward", "", "Longitudinal tyre force, rear axle"
    ),
    Signal("mu_front", "-", "-", "-", "", "Available friction coefficient at the front axle"),
    Signal("mu_rear", "-", "-", "-", "", "Available friction coefficient at the rear axle"),
    Signal(
        "utilisation", "-", "-", "-", "", "Share of the available friction that is used, |a|/(mu g)"
    ),
)  # fmt: skip

_WHEELS = ("front_left", "front_right", "rear_left", "rear_right")

_BODY = (
    Signal("accel_y", "m/s^2", "vehicle", "left", ACCELEROMETER, "Specific force along y"),
    Signal("accel_z", "m/s^2", "vehicle", "up", ACCELEROMETER, "Specific force along z, g at rest"),
    Signal("roll_rate", "rad/s", "vehicle", "left side up", GYROSCOPE, "Angular velocity about x"),
    Signal("pitch_rate", "rad/s", "vehicle", "nose down", GYROSCOPE, "Angular velocity about y"),
    Signal("yaw_rate", "rad/s", "vehicle", "turning left", GYROSCOPE, "Angular velocity about z"),
    Signal(
        "steer_angle", "rad", "vehicle", "to the left", STEERING_SENSOR,
        "Steering angle of the front wheels at the road",
    ),
    Signal(
        "magnetic_field_x", "T", "vehicle", "forward", MAGNETOMETER, "Magnetic flux density along x"
    ),
    Signal(
        "magnetic_field_y", "T", "vehicle", "left", MAGNETOMETER, "Magnetic flux density along y"
    ),
    Signal("magnetic_field_z", "T", "vehicle", "up", MAGNETOMETER, "Magnetic flux density along z"),
    Signal("velocity_north", "m/s", "earth", "north", GPS, "Velocity over ground, north component"),
    Signal("velocity_west", "m/s", "earth", "west", GPS, "Velocity over ground, west component"),
    Signal("velocity_up", "m/s", "earth", "up", GPS, "Velocity over ground, upward component"),
    Signal(
        "gps_time", "s", "-", "-", GPS, "Time at which the reported velocity and course were true"
    ),
    Signal(
        "course", "rad", "earth", "from north to west", GPS,
        "Direction of the velocity over ground, within -pi to pi",
    ),
    Signal(
        "road_bank", "rad", "road", "left side up", BANK_MAP, "Inclination of the road across x"
    ),
    Signal("yaw", "rad", "earth", "from north to west", "", "Heading of the x axis"),
    Signal("roll", "rad", "earth", "left side up", "", "Roll angle of the body, bank included"),
    Signal("pitch", "rad", "earth", "nose down", "", "Pitch angle of the body, grade included"),
    Signal(
        "suspension_roll", "rad", "road", "left side up", "", "Roll of the body against the road"
    ),
    Signal("position_x", "m", "earth", "north", "", "Position of the centre of gravity, north"),
    Signal("position_y", "m", "earth", "west", "", "Position of the centre of gravity, west"),
    Signal("speed_y", "m/s", "vehicle", "left", SPEED_SENSOR, "Lateral velocity v_y"),
    Signal("sideslip", "rad", "vehicle", "moving left", "", "Sideslip angle atan2(v_y, v_x)"),
    Signal("mu", "-", "-", "-", "", "Available friction coefficient, mean of the four wheels"),
    Signal("force_y_front", "N", "wheel", "left", "", "Lateral tyre force, front axle"),
    Signal("force_y_rear", "N", "wheel", "left", "", "Lateral tyre force, rear axle"),
    Signal("gyro_bias", "rad/s", "vehicle", "turning left", "", "Bias of the yaw rate gyroscope"),
    Signal("gyro_scale", "-", "vehicle", "-", "", "Scale factor of the yaw rate gyroscope"),
    Signal(
        "cornering_stiffness_front", "N/rad", "wheel", "-", "", "Cornering stiffness, front axle"
    ),
    Signal(
        "cornering_stiffness_rear", "N/rad", "wheel", "-", "", "Cornering stiffness, rear axle"
    ),
    Signal("mu_used", "-", "-", "-", "", "Used friction, mean of the four wheels"),
)  # fmt: skip


def _of_each_wheel() -> list[Signal]:
    table = []
    for wheel in _WHEELS:
        place = wheel.replace("_", " ") + " wheel"
        table += [
            Signal(
                f"wheel_speed_{wheel}", "rad/s", "wheel", "rolling forward", WHEEL_SPEED_SENSOR,
                f"Angular velocity of the {place}",
            ),
            Signal(
                f"torque_{wheel}", "N m", "wheel", "driving forward, braking is negative",
                TORQUE_ON_BUS, f"Traction or brake torque on the {place}",
            ),
            Signal(
                f"slip_ratio_{wheel}", "-", "wheel", "driving", "", f"Slip ratio of the {place}"
            ),
            Signal(
                f"slip_angle_{wheel}", "rad", "wheel", "moving to the left", "",
                f"Slip angle of the {place}: positive gives a force to the right",
            ),
            Signal(
                f"force_x_{wheel}", "N", "wheel", "driving forward", "",
                f"Longitudinal tyre force of the {place}",
            ),
            Signal(f"force_y_{wheel}", "N", "wheel", "left", "", f"Lateral tyre force, {place}"),
            Signal(f"force_z_{wheel}", "N", "wheel", "up", "", f"Vertical load of the {place}"),
            Signal(f"mu_{wheel}", "-", "-", "-", "", f"Available friction at the {place}"),
            Signal(
                f"mu_used_{wheel}", "-", "-", "-", "",
                f"Used friction of the {place}: force over load",
            ),
        ]  # fmt: skip
    return table


SIGNALS: dict[str, Signal] = {
    signal.name: signal for signal in (*_LONGITUDINAL, *_BODY, *_of_each_wheel())
}
"""The signal table, by name."""


def signal(name: str) -> Signal:
    """Return a signal by name; those of a variance, quantile, innovation, flag derive from it.

    Raises
    ------
    InputError
        If no such signal exists; the message names the nearest one.
    """
    if name in SIGNALS:
        return SIGNALS[name]
    derived = _derived(name)
    if derived is not None:
        return derived
    known = len(SIGNALS)
    if len(all_signals()) > known:
        return signal(name)
    raise unknown("signal", name, SIGNALS)


def _derived(name: str) -> Signal | None:
    """Return a signal that says something of another one, None where there is no such other."""
    if name.endswith(NEW) and name.removesuffix(NEW) in SIGNALS:
        parent = SIGNALS[name.removesuffix(NEW)]
        sign, text = "1: new sample, 0: held", f"{parent.name} is new"
        return Signal(name, "-", "-", sign, parent.instrument, text)
    plain = name.removesuffix(VARIANCE)
    stem, _, level = plain.rpartition(QUANTILE)
    found = SIGNALS.get(plain)
    if plain.removesuffix(INNOVATION) in SIGNALS and plain.endswith(INNOVATION):
        parent = SIGNALS[plain.removesuffix(INNOVATION)]
        text = f"Last reading of {parent.name} less its prediction"
        found = Signal(plain, parent.unit, parent.frame, parent.sign, "", text)
    elif stem in SIGNALS and level.isdecimal() and len(level) > 1 and plain == name:
        parent = SIGNALS[stem]
        text = f"Quantile of {parent.name}, level .{level}"
        return Signal(name, parent.unit, parent.frame, parent.sign, "", text)
    if found is None or plain == name:
        return found
    unit = "-" if found.unit == "-" else f"({found.unit})^2"
    return Signal(name, unit, found.frame, "-", "", f"Variance of {plain}")


def all_signals() -> dict[str, Signal]:
    """Return the signal table with the signals of installed packages, group `gripbench.signals`.

    Their entry points are looked for at each call, because the path may have grown since.

    Raises
    ------
    InputError
        If one cannot be loaded, is none, or has the name of another.
    """
    found: dict[str, Signal] = {}
    for point in entry_points("gripbench.signals").values():
        given = load(point, (Signal, tuple))
        for entry in given if isinstance(given, tuple) else (given,):
            if SIGNALS.get(entry.name) == entry:
                continue  # added before
            if entry.name in SIGNALS or entry.name in found:
                raise InputError(
                    f"entry point '{point.name}' of {point.group}: signal '{entry.name}' exists"
                )
            found[entry.name] = entry
    SIGNALS.update(found)
    return SIGNALS


Angle = TypeVar("Angle", float, npt.NDArray[np.float64])


def wrapped(angle: Angle) -> Angle:
    """Return an angle [rad] within -pi to pi, any shape; what lies there already keeps its bits.

    Examples
    --------
    >>> float(wrapped(0.5)), bool(abs(wrapped(0.5 + 4.0 * math.pi) - 0.5) < 1e-14)
    (0.5, True)
    """
    turns = np.round(angle / (2.0 * math.pi))
    return angle - 2.0 * math.pi * turns


def difference(name: str, value: Angle, other: Angle) -> Angle:
    """Return `value - other` of a signal, any shape: of an angle the shorter way round.

    Raises
    ------
    InputError
        If no such signal exists.
    """
    return wrapped(value - other) if signal(name).angle else value - other


def record_type(names: Iterable[str]) -> np.dtype:
    """Return the structured type with one float64 field a signal.

    Parameters
    ----------
    names
        Signal names, in the order of the fields.
    """
    return np.dtype([(signal(name).name, np.float64) for name in names])
