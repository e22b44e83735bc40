"""The tables of a channel map beyond columns: sensors, torques, positions, what is derived."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gripbench.configuration import Configuration
from gripbench.logs.mapping.map_tables import Column, Name


class Sensor(Configuration):
    """Where a sensor sits and how it is turned.

    Attributes
    ----------
    position
        Before, left of and above the centre of gravity [m].
    rotation
        Roll, pitch and yaw [deg] of its axes against the vehicle's.
    """

    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Level(Configuration):
    """Angles whose component of gravity is taken off the accelerometers.

    Attributes
    ----------
    roll, pitch
        Mapped signals that tell how the body, with it its accelerometers, rolls and pitches:
        `roll` and `pitch`, bank and grade included, or `suspension_roll`, or `road_bank`.
    """

    roll: Literal["", "roll", "suspension_roll", "road_bank"] = ""
    pitch: Literal["", "pitch", "road_grade"] = ""


class Brake(Configuration):
    """A brake torque that follows from a pressure.

    Attributes
    ----------
    pressure
        Column of the pressure, in a unit of pressure.
    torque_per_bar
        Torque on the axle for each bar [N m].
    """

    pressure: Column
    torque_per_bar: float = Field(gt=0.0)


class Drive(Configuration):
    """A drive torque that follows from engine and gear.

    Attributes
    ----------
    axle
        The axle that is driven.
    engine
        Column of the engine's torque.
    gear, ratios
        Column of the gear, and the gearbox's ratio of each gear by its number (0 for an open
        clutch, negative in reverse); without them the torque is behind the gearbox.
    final_drive, efficiency
        Ratio and efficiency behind the gearbox.
    """

    axle: Literal["front", "rear"]
    engine: Column
    gear: Column | None = None
    ratios: dict[str, float] = Field(default_factory=dict)
    final_drive: float = Field(default=1.0, gt=0.0)
    efficiency: float = Field(default=1.0, gt=0.0, le=1.0)


class Geodetic(Configuration):
    """Position from latitude and longitude, north and west of an origin.

    Attributes
    ----------
    latitude, longitude, height
        Columns; without a height it is that of the ellipsoid.
    origin
        Latitude and longitude [deg] and height [m] of the origin; by default the first sample.
    to
        Whether the position is for methods or to judge by.
    """

    latitude: Column
    longitude: Column
    height: Column | None = None
    origin: tuple[float, float, float] | None = None
    to: Literal["channels", "reference"] = "reference"


class Attitude(Configuration):
    """Yaw, pitch and roll of the reference from a quaternion.

    Attributes
    ----------
    quaternion
        Columns of x, y, z and w: from the vehicle's axes to those of the earth, z up.
    counts_from
        Where the earth's x axis points.
    file
        Which of the map's `files` has them.
    """

    quaternion: tuple[Name, Name, Name, Name]
    counts_from: Literal["north", "east"] = "north"
    file: Name = ""


class Derived(Configuration):
    """What is computed from other columns, said openly because no instrument gave it.

    Attributes
    ----------
    velocity_window
        Width [s] of the local straight line whose slope gives the reference's velocity and yaw
        rate from its position and yaw; 0: they are not derived.
    acceleration_window
        The same for its acceleration from velocity and yaw rate, and with it `mu_used`, the
        horizontal acceleration over gravity: what the road has given, so a lower bound of what
        it can give.
    sideslip_above
        Speed [m/s] from which the sideslip follows from v_y and v_x; below, it means nothing.
    reference_ahead
        Distance [m] of the point whose velocity the reference gives before the centre of gravity;
        its `speed_y` is brought there with the yaw rate.
    gps_velocity
        Whether the channels `velocity_north` and `velocity_west` follow from `speed_gps` and
        `course`.
    course_from_velocity
        Whether the channel `course` follows from `velocity_north` and `velocity_west`.
    instruments
        Channels that a method may read although they come from the reference: motion capture in
        the place of a speed sensor.
    """

    velocity_window: float = Field(default=0.0, ge=0.0, le=5.0)
    acceleration_window: float = Field(default=0.0, ge=0.0, le=5.0)
    sideslip_above: float = Field(default=1.0, gt=0.0)
    reference_ahead: float = Field(default=0.0, ge=-10.0, le=10.0)
    gps_velocity: bool = False
    course_from_velocity: bool = False
    instruments: tuple[str, ...] = ()
