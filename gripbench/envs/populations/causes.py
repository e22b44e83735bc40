"""Causes: by name, what may deviate from paper, in which unit, and which dimension draws it.

The dimension of a cause in the quasi-random sequence is its place in the table, so a new cause goes
to the end: the draws of the others stay.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Cause:
    """One thing that differs from paper.

    Attributes
    ----------
    name
        Its name: the table of the population's file, a dot, the key.
    unit
        Unit of the deviation; `relative` for a share of 1, `logit` for the friction of a road, see
        `gripbench.envs.populations.drives.friction_of`.
    description
        What deviates.
    """

    name: str
    unit: str
    description: str


_RELATIVE = "relative"

_TABLE = (
    Cause("car.mass", _RELATIVE, "Kerb mass: equipment and tank"),
    Cause("car.payload", _RELATIVE, "Mass of passengers and load over kerb mass"),
    Cause("car.payload_place", "-", "Payload's place behind the front axle over the wheelbase"),
    Cause("car.payload_height", "m", "Height of the payload above the centre of gravity"),
    Cause("car.cg_place", "-", "Centre of gravity towards the rear over the wheelbase"),
    Cause("car.cg_height", _RELATIVE, "Height of the centre of gravity"),
    Cause("car.yaw_inertia", _RELATIVE, "Moment of inertia about z at kerb mass"),
    Cause("car.track", _RELATIVE, "Track of both axles: wheel offset"),
    Cause("car.wheel_inertia", _RELATIVE, "Moment of inertia of the wheels"),
    Cause("car.drag", _RELATIVE, "Wind drag: roof box, wind"),
    Cause("car.rolling_resistance", _RELATIVE, "Rolling resistance: tyre make, water, snow"),
    Cause("car.springs", _RELATIVE, "Stiffness of the suspension's springs"),
    Cause("car.dampers", _RELATIVE, "Damping of the suspension"),
    Cause("car.roll_share", _RELATIVE, "Front axle's share of the lateral load transfer"),
    Cause("car.brake_share", _RELATIVE, "Front axle's share of the brake torque: pads, valves"),
    Cause("car.load_lag", _RELATIVE, "Time constant of the wheel loads"),
    Cause("car.steering_ratio", _RELATIVE, "Steering ratio: compliance and wear"),
    Cause("car.steering_offset", "rad", "Zero of the steering angle at the road wheels"),
    Cause("car.torque_gain", _RELATIVE, "Gain of the torque signal"),
    Cause("car.brake_gain", _RELATIVE, "Gain of the torque signal while braking: pad friction"),
    Cause("tyre.radius", _RELATIVE, "Rolling radius of all tyres: make and load"),
    Cause("tyre.wear_front", "mm", "Tread worn off the front tyres"),
    Cause("tyre.wear_rear", "mm", "Tread worn off the rear tyres"),
    Cause("tyre.pressure_front", _RELATIVE, "Inflation pressure, front"),
    Cause("tyre.pressure_rear", _RELATIVE, "Inflation pressure, rear"),
    Cause("tyre.temperature", "K", "Temperature of the tread"),
    Cause("tyre.cornering_stiffness_front", _RELATIVE, "Cornering stiffness, front: make, paper"),
    Cause("tyre.cornering_stiffness_rear", _RELATIVE, "Cornering stiffness, rear: make, paper"),
    Cause("tyre.longitudinal_stiffness", _RELATIVE, "Longitudinal stiffness: make, paper"),
    Cause("tyre.load_exponent", _RELATIVE, "Exponent of the stiffness over wheel load"),
    Cause("tyre.shape", "-", "Shape of the force curve"),
    Cause("tyre.curve", _RELATIVE, "Shape factor C of the Magic Formula"),
    Cause("tyre.curvature", _RELATIVE, "Curvature factor E of the Magic Formula"),
    Cause("road.friction", "logit", "Friction level of the road"),
    Cause("road.friction_right", "logit", "Friction under the right wheels, where split"),
    Cause("road.friction_step_1", "logit", "Friction behind the first step"),
    Cause("road.friction_step_2", "logit", "Friction behind the second step"),
    Cause("road.friction_step_3", "logit", "Friction behind the third step"),
    Cause("road.friction_step_4", "logit", "Friction behind the fourth step"),
    Cause("road.step_place_1", _RELATIVE, "Time or place of the first step"),
    Cause("road.step_place_2", _RELATIVE, "Time or place of the second step"),
    Cause("road.step_place_3", _RELATIVE, "Time or place of the third step"),
    Cause("road.step_place_4", _RELATIVE, "Time or place of the fourth step"),
    Cause("road.friction_along", "log", "Slow variation of the friction along the path"),
    Cause("road.grade", "rad", "Grade"),
    Cause("road.grade_along", "rad", "Slow variation of the grade along the path"),
    Cause("road.bank", "rad", "Bank"),
    Cause("road.bank_along", "rad", "Slow variation of the bank along the path"),
    Cause("drive.speed", _RELATIVE, "Speed that the driver holds"),
    Cause("drive.initial_speed", "m/s", "Speed at the start of straight driving"),
    Cause("drive.amplitude", _RELATIVE, "Torque, steering, offset or curvature of the path"),
    Cause("drive.timing", _RELATIVE, "Times of the manoeuvre"),
    Cause("drive.side", "-", "Side to which the manoeuvre goes first"),
    Cause("drive.preview", _RELATIVE, "Driver's preview time"),
    Cause("drive.slip_use", _RELATIVE, "Slip angle that the driver uses"),
    Cause("drive.counter_steer", _RELATIVE, "Driver's gain against a slide"),
    Cause("drive.yaw_damping", _RELATIVE, "Driver's gain against yaw rate"),
    Cause("drive.reaction", _RELATIVE, "Driver's reaction time"),
    Cause("drive.speed_gain", _RELATIVE, "Driver's gain on the speed"),
    Cause("drive.held_speed", "-", "Share of the answer to a slippery road that is no lower speed"),
    Cause("drive.brake_timing", _RELATIVE, "Time at which the driver brakes"),
    Cause("drive.brake_strength", _RELATIVE, "Deceleration that the driver asks for"),
)  # fmt: skip

CAUSES: dict[str, Cause] = {cause.name: cause for cause in _TABLE}
"""Every cause, by name, in the order of the dimensions that draw them."""

DIMENSION: dict[str, int] = {cause.name: place for place, cause in enumerate(_TABLE)}
"""Dimension of each cause in the quasi-random sequence."""

PROCESSES = ("road.friction_along", "road.grade_along", "road.bank_along")
"""Causes that are noise along the path: their `std` is its standard deviation."""

SIDES = "drive.side"
SHAPES_OF_TYRES = "tyre.shape"
