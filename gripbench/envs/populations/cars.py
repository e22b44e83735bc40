"""The car on the road: from the car on paper and the deviations of causes, the car they make."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from gripbench.envs.vehicles import VEHICLE_PARAMETERS, CarOnRoad

if TYPE_CHECKING:
    from gripbench.envs.populations.population import Effects

_RELATIVE = {
    "wheel_inertia": "car.wheel_inertia",
    "drag": "car.drag",
    "rolling_resistance": "car.rolling_resistance",
    "track_front": "car.track",
    "track_rear": "car.track",
    "roll_share_front": "car.roll_share",
    "brake_share_front": "car.brake_share",
    "load_lag": "car.load_lag",
    "steering_ratio": "car.steering_ratio",
    "stiffness_load_exponent": "tyre.load_exponent",
    "magic_c": "tyre.curve",
    "magic_e": "tyre.curvature",
}
"""Parameters that a cause of their own scales."""


def car_on_road(
    paper: Mapping[str, float], deviations: Mapping[str, float], effects: Effects
) -> CarOnRoad:
    """Return the car that a plant integrates.

    Parameters
    ----------
    paper
        Parameters of the car on paper, SI units.
    deviations
        Deviation by cause; causes that it does not name do not deviate, and with none at all the
        car is that on paper to the last bit.
    effects
        What the state of a tyre does to it.
    """

    def d(name: str) -> float:
        return deviations.get(name, 0.0)

    car = dict(paper)
    for parameter, cause in _RELATIVE.items():
        if parameter in car:
            car[parameter] *= 1.0 + d(cause)
    _load(car, d)
    heavier = _ratio(car, paper, "mass")
    if "cg_height" in car:
        taller = heavier * _ratio(car, paper, "cg_height")
        for parameter in ("roll_gradient", "pitch_gradient"):
            if parameter in car:
                car[parameter] *= taller / (1.0 + d("car.springs"))
    if "roll_frequency" in car:
        car["roll_frequency"] *= math.sqrt(max(1.0 + d("car.springs"), 0.0))
        car["roll_damping"] *= 1.0 + d("car.dampers")
    return _tyres(car, paper, d, effects)


def faults_of(car: CarOnRoad) -> str:
    """Return in words what makes a car none; empty: it is one."""
    for name, value in car.parameters.items():
        allowed = VEHICLE_PARAMETERS[name]
        if name == "mass" and value <= 0.0:
            return f"a car of {value:.4g} kg; a mass is above 0"
        if name in ("cg_to_front", "cg_to_rear") and value < allowed.low:
            axle = name.removeprefix("cg_to_")
            return (
                f"a centre of gravity outside the wheelbase ({-value:.3g} m beyond the {axle} axle)"
            )
        if not allowed.low <= value <= allowed.high:
            return (
                f"{name} = {value:.4g} {allowed.unit}; "
                f"allowed is {allowed.low:g} to {allowed.high:g}"
            )
    for name in ("radius_front", "radius_rear", "peak_front", "peak_rear"):
        if getattr(car, name) <= 0.0:
            quantity, axle = name.split("_")
            return (
                f"tyres in the {axle} with {getattr(car, name):.3g} times the {quantity} on paper"
            )
    return ""


def _ratio(car: Mapping[str, float], paper: Mapping[str, float], name: str) -> float:
    return car[name] / paper[name] if name in paper else 1.0


def _load(car: dict[str, float], d) -> None:
    """Put the payload into the car: mass, centre of gravity, inertia and height move together."""
    if "mass" not in car:
        return
    kerb = car["mass"] * (1.0 + d("car.mass"))
    load = car["mass"] * d("car.payload")
    mass = kerb + load
    car["mass"] = mass
    if mass <= 0.0:
        return  # no car: the check of the support says so
    front, rear = car.get("cg_to_front"), car.get("cg_to_rear")
    if front is not None and rear is not None:
        base = front + rear
        empty = front + d("car.cg_place") * base
        behind = d("car.payload_place") * base - empty  # payload behind the empty car's centre
        shift = d("car.cg_place") * base + load / mass * behind
        car["cg_to_front"] = front + shift
        car["cg_to_rear"] = rear - shift
        if "yaw_inertia" in car:
            own = car["yaw_inertia"] * (1.0 + d("car.yaw_inertia")) * (1.0 + d("car.mass"))
            car["yaw_inertia"] = own + kerb * load / mass * behind**2
    if "cg_height" in car:
        car["cg_height"] *= 1.0 + d("car.cg_height")
        car["cg_height"] += load / mass * d("car.payload_height")


def _tyres(car, paper, d, effects) -> CarOnRoad:
    """Return the car with the tyres that wear, pressure and temperature make."""
    warmer = d("tyre.temperature")
    radii, peaks, stiffness = {}, {}, {}
    for axle in ("front", "rear"):
        wear, pressure = d(f"tyre.wear_{axle}"), d(f"tyre.pressure_{axle}")
        radius = 1.0 + effects.radius_per_pressure.value * pressure
        if "wheel_radius" in paper:
            radius -= effects.radius_per_wear.value * wear / paper["wheel_radius"]
        radii[axle] = radius
        peaks[axle] = (
            1.0 + effects.peak_per_wear.value * wear + effects.peak_per_kelvin.value * warmer
        )
        stiffness[axle] = (
            1.0
            + effects.stiffness_per_wear.value * wear
            + effects.stiffness_per_pressure.value * pressure
            + effects.stiffness_per_kelvin.value * warmer
        )
        name = f"cornering_stiffness_{axle}"
        if name in car:
            car[name] *= (1.0 + d(f"tyre.{name}")) * stiffness[axle]
            car[name] *= _under_load(car, paper, axle)
    common = (
        (1.0 + d("tyre.longitudinal_stiffness")) * 0.5 * (stiffness["front"] + stiffness["rear"])
    )
    if "longitudinal_stiffness" in car:
        car["longitudinal_stiffness"] *= common * _ratio(car, paper, "mass")
    if "magic_b" in car:
        car["magic_b"] *= common
    if "wheel_radius" in car:
        car["wheel_radius"] *= 1.0 + d("tyre.radius")
    return CarOnRoad(car, radii["front"], radii["rear"], peaks["front"], peaks["rear"])


def _under_load(car: Mapping[str, float], paper: Mapping[str, float], axle: str) -> float:
    """Return the stiffness of an axle under its static load over that on paper."""
    exponent = car.get("stiffness_load_exponent")
    other = "cg_to_rear" if axle == "front" else "cg_to_front"
    if exponent is None or other not in car:
        return 1.0
    load = _ratio(car, paper, "mass") * _ratio(car, paper, other)
    return load**exponent if load > 0.0 else 1.0
