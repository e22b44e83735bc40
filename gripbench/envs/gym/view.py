"""From one sample of the truth to what a picture of it shows; pure functions, nothing drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gripbench.envs.vehicles import GRAVITY

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")


@dataclass(frozen=True)
class Body:
    """Size of a vehicle seen from above [m]; wheels in the order of `WHEELS`.

    Attributes
    ----------
    wheels
        Places of the wheels ahead and to the left of the centre of gravity, shape (4, 2).
    outline
        Corners of the body, shape (5, 2), closed.
    wheel_length
        Diameter of a wheel.
    loads
        Static load of each wheel [N], shape (4,).
    """

    wheels: npt.NDArray[np.float64]
    outline: npt.NDArray[np.float64]
    wheel_length: float
    loads: npt.NDArray[np.float64]

    @classmethod
    def of(cls, vehicle: dict[str, float]) -> Body:
        """Return the size of a vehicle; a width that it does not give follows its wheelbase."""
        front, rear = vehicle["cg_to_front"], vehicle["cg_to_rear"]
        base = front + rear
        left_front = 0.5 * vehicle.get("track_front", 0.57 * base)
        left_rear = 0.5 * vehicle.get("track_rear", 0.57 * base)
        wheels = np.array(
            [[front, left_front], [front, -left_front], [-rear, left_rear], [-rear, -left_rear]]
        )
        nose, tail = front + 0.3 * base, -rear - 0.3 * base
        side = max(left_front, left_rear) + 0.06 * base
        outline = np.array([[nose, side], [nose, -side], [tail, -side], [tail, side], [nose, side]])
        half = 0.5 * vehicle["mass"] * GRAVITY / base
        loads = np.array([half * rear, half * rear, half * front, half * front])
        return cls(wheels, outline, 2.0 * vehicle.get("wheel_radius", 0.115 * base), loads)


@dataclass(frozen=True)
class View:
    """What a picture shows of one sample; SI units, one value a wheel in the order of `WHEELS`.

    Attributes
    ----------
    time, steer, speed_x, speed_y, yaw_rate
        Of the vehicle.
    heading, place
        Direction of the x axis from north to west; north and west. None where the world has no
        plane: it drives straight on.
    force
        Tyre forces ahead and to the left in the wheel's axes, shape (4, 2).
    load
        Vertical loads.
    mu
        Available friction; NaN where the tyres have no limit.
    """

    time: float
    steer: float
    speed_x: float
    speed_y: float
    yaw_rate: float
    heading: float | None
    place: tuple[float, float] | None
    force: npt.NDArray[np.float64]
    load: npt.NDArray[np.float64]
    mu: npt.NDArray[np.float64]

    @property
    def used(self) -> npt.NDArray[np.float64]:
        """Share of the available friction that each wheel uses; NaN where there is no limit."""
        limit = self.mu * self.load
        force = np.hypot(self.force[:, 0], self.force[:, 1])
        return np.where(limit > 0.0, force / np.where(limit > 0.0, limit, 1.0), np.nan)


def view_of(truth: np.void, body: Body) -> View:
    """Return what a picture shows of one sample of any world's truth.

    A world that lumps the wheels of an axle gives each wheel half of the axle's force.
    """
    names = truth.dtype.names or ()

    def at(name: str) -> float:
        return float(truth[name]) if name in names else 0.0

    def wheels(quantity: str, missing: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        if f"{quantity}_front_left" in names:
            return np.array([at(f"{quantity}_{wheel}") for wheel in WHEELS])
        if f"{quantity}_front" in names:
            share = 0.5 if quantity.startswith("force") else 1.0
            axles = [share * at(f"{quantity}_front"), share * at(f"{quantity}_rear")]
            return np.repeat(axles, 2)
        return missing

    nothing = np.zeros(4)
    plane = "position_x" in names
    return View(
        time=at("time"),
        steer=at("steer_angle"),
        speed_x=at("speed_x"),
        speed_y=at("speed_y"),
        yaw_rate=at("yaw_rate"),
        heading=at("yaw") if plane else None,
        place=(at("position_x"), at("position_y")) if plane else None,
        force=np.column_stack([wheels("force_x", nothing), wheels("force_y", nothing)]),
        load=wheels("force_z", body.loads),
        mu=wheels("mu", np.full(4, np.nan)),
    )


def turned(points: npt.NDArray[np.float64], angle: float) -> npt.NDArray[np.float64]:
    """Return points, shape (n, 2), turned to the left by an angle [rad]."""
    sin, cos = np.sin(angle), np.cos(angle)
    return np.asarray(points @ np.array([[cos, sin], [-sin, cos]]))
