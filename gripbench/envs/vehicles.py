"""Vehicles: parameters as TOML, each value with its source, guesses marked.

A vehicle file is a table of parameters, each `{ value = ..., source = "..." }`, with
`guess = true` where no source gives the value::

    name = "li2014"
    description = "..."

    [parameters]
    mass = { value = 1298.9, source = "Table III" }

Methods and plants name the parameters that they need; a vehicle need not give them all.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from pydantic import model_validator

from gripbench.configuration import CONFIGS, Configuration, named_file, parse, read_toml
from gripbench.errors import InputError, nearest

GRAVITY = 9.81
"""Gravitational acceleration [m/s^2]."""


@dataclass(frozen=True)
class ParameterRange:
    """What a vehicle parameter is and which values are possible."""

    unit: str
    low: float
    high: float
    description: str


VEHICLE_PARAMETERS: dict[str, ParameterRange] = {
    "mass": ParameterRange("kg", 0.1, 1e5, "Vehicle mass"),
    "yaw_inertia": ParameterRange("kg m^2", 1e-4, 1e6, "Moment of inertia about z"),
    "cg_to_front": ParameterRange("m", 0.01, 10.0, "Distance from centre of gravity to front axle"),
    "cg_to_rear": ParameterRange("m", 0.01, 10.0, "Distance from centre of gravity to rear axle"),
    "cg_height": ParameterRange("m", 0.01, 5.0, "Height of centre of gravity above the road"),
    "track_front": ParameterRange("m", 0.05, 5.0, "Track: distance between the front wheels"),
    "track_rear": ParameterRange("m", 0.05, 5.0, "Track: distance between the rear wheels"),
    "steering_ratio": ParameterRange("-", 1.0, 50.0, "Steering wheel's angle over the wheels'"),
    "wheel_radius": ParameterRange("m", 0.01, 2.0, "Effective rolling radius"),
    "wheel_inertia": ParameterRange("kg m^2", 1e-6, 100.0, "Moment of inertia of an axle's wheels"),
    "drag": ParameterRange("kg/m", 0.0, 10.0, "Wind drag: force over speed squared"),
    "rolling_resistance": ParameterRange("-", 0.0, 0.2, "Rolling resistance over weight"),
    "longitudinal_stiffness": ParameterRange(
        "N", 1.0, 1e7, "Tyre force over slip ratio at zero slip, one axle"
    ),
    "cornering_stiffness_front": ParameterRange(
        "N/rad", 1.0, 1e7, "Lateral tyre force over slip angle at zero slip, front axle"
    ),
    "cornering_stiffness_rear": ParameterRange(
        "N/rad", 1.0, 1e7, "Lateral tyre force over slip angle at zero slip, rear axle"
    ),
    "stiffness_load_exponent": ParameterRange(
        "-", 0.0, 1.0, "Exponent of the tyre stiffness over wheel load"
    ),
    "roll_gradient": ParameterRange(
        "rad s^2/m", 0.0, 0.05, "Steady suspension roll over lateral specific force"
    ),
    "roll_frequency": ParameterRange("rad/s", 1.0, 50.0, "Natural frequency of suspension roll"),
    "roll_damping": ParameterRange("-", 0.05, 3.0, "Damping ratio of suspension roll"),
    "roll_share_front": ParameterRange(
        "-", 0.0, 1.0, "Share of the lateral load transfer that the front axle takes"
    ),
    "pitch_gradient": ParameterRange(
        "rad s^2/m", 0.0, 0.05, "Steady suspension pitch over longitudinal specific force"
    ),
    "load_lag": ParameterRange("s", 0.005, 1.0, "Time constant of the wheel loads"),
    "drive_share_front": ParameterRange("-", 0.0, 1.0, "Share of drive torque on the front axle"),
    "brake_share_front": ParameterRange("-", 0.0, 1.0, "Share of brake torque on the front axle"),
    "steer_limit": ParameterRange("rad", 0.01, 1.2, "Largest steering angle at the road"),
    "steer_rate_limit": ParameterRange(
        "rad/s", 0.01, 20.0, "Largest rate of the steering angle at the road"
    ),
    "magic_b": ParameterRange("-", 0.1, 100.0, "Magic Formula stiffness factor B"),
    "magic_c": ParameterRange("-", 0.5, 3.0, "Magic Formula shape factor C"),
    "magic_e": ParameterRange("-", -20.0, 1.0, "Magic Formula curvature factor E"),
    "friction_prior": ParameterRange(
        "-", 0.01, 2.0, "Mean of the friction coefficients that the vehicle may meet"
    ),
    "friction_prior_std": ParameterRange("-", 0.0, 2.0, "Standard deviation of the same"),
}
"""Every parameter that a vehicle file may give."""


class Value(Configuration):
    """One parameter's value with its source."""

    value: float
    source: str
    guess: bool = False


class Vehicle(Configuration):
    """A vehicle as its file gives it."""

    name: str
    description: str
    parameters: dict[str, Value]

    @model_validator(mode="after")
    def _check_parameters(self) -> Self:
        for name, given in self.parameters.items():
            if name not in VEHICLE_PARAMETERS:
                raise ValueError(
                    f"unknown vehicle parameter '{name}': {nearest(name, VEHICLE_PARAMETERS)}"
                )
            allowed = VEHICLE_PARAMETERS[name]
            if not allowed.low <= given.value <= allowed.high:
                raise ValueError(
                    f"parameters.{name}.value is {given.value:g} {allowed.unit}; "
                    f"allowed is {allowed.low:g} to {allowed.high:g}"
                )
        return self

    def values(self) -> dict[str, float]:
        """Return the parameters by name, SI units."""
        return {name: given.value for name, given in self.parameters.items()}


class CarOnPaper(dict[str, float]):
    """What an engineer knows of a vehicle: nominal values by parameter, SI units.

    This is what methods are given. The car that a plant integrates is a `CarOnRoad`; the two are
    different types, so that the one is never handed over for the other.
    """


@dataclass(frozen=True)
class CarOnRoad:
    """The vehicle that a plant integrates.

    Attributes
    ----------
    parameters
        Values by parameter, SI units.
    radius_front, radius_rear
        Rolling radius of an axle's tyres over `wheel_radius`.
    peak_front, peak_rear
        Friction that an axle's tyres find over that of the road.
    """

    parameters: dict[str, float]
    radius_front: float = 1.0
    radius_rear: float = 1.0
    peak_front: float = 1.0
    peak_rear: float = 1.0

    def values(self) -> dict[str, float]:
        """Return the parameters by name, SI units."""
        return dict(self.parameters)


def on_road(vehicle: Vehicle | CarOnRoad) -> CarOnRoad:
    """Return the car on the road of a vehicle that is just as its file says."""
    return vehicle if isinstance(vehicle, CarOnRoad) else CarOnRoad(vehicle.values())


def require(vehicle: Mapping[str, float], names: tuple[str, ...], reader: str) -> dict[str, float]:
    """Return the named parameters of a vehicle.

    Raises
    ------
    InputError
        If the vehicle does not give one of them.
    """
    for name in names:
        if name not in vehicle:
            raise InputError(f"{reader} needs the vehicle parameter '{name}', which is not given")
    return {name: vehicle[name] for name in names}


def vehicle_files() -> dict[str, Path]:
    """Return the vehicle files that ship with gripbench, by vehicle name."""
    return {path.stem: path for path in sorted((CONFIGS / "vehicles").glob("*.toml"))}


def load_vehicle(name: str) -> Vehicle:
    """Return a vehicle by the name of a file that ships, or by the path of a TOML file.

    Raises
    ------
    InputError
        If there is no such vehicle or its file has a mistake.
    """
    path = named_file("vehicle", name, vehicle_files())
    return parse(Vehicle, read_toml(path), path)
