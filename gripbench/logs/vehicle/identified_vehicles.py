"""A recording's vehicle and what was identified in; the vehicle with it, and its file, out."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gripbench.envs.recordings import Recording
from gripbench.envs.vehicles import Value, Vehicle, load_vehicle, vehicle_files
from gripbench.logs.vehicle.identification import Identified
from gripbench.writing import write_atomically


def vehicle_of(channel_map: Mapping[str, Any], recording: Recording) -> Vehicle:
    """Return a recording's vehicle: that of its map, else one of the values stored with it."""
    name = str(channel_map.get("vehicle", ""))
    if name in vehicle_files():
        return load_vehicle(name)
    source = f"vehicle of the recording {recording.scenario}"
    values = {key: Value(value=value, source=source) for key, value in recording.vehicle.items()}
    return Vehicle(name=recording.scenario, description=source, parameters=values)


def identified_vehicle(vehicle: Vehicle, found: Identified, source: str) -> Vehicle:
    """Return a vehicle with the tyres and the yaw inertia that were identified.

    Parameters
    ----------
    vehicle
        The vehicle as known before; its mass turns ratios into forces.
    found
        What `identify_tyres` returned.
    source
        The log, for the source of every value.
    """
    mass = vehicle.parameters["mass"].value
    values = {
        "cornering_stiffness_front": ("stiffness_front", mass),
        "cornering_stiffness_rear": ("stiffness_rear", mass),
        "yaw_inertia": ("gyration_squared", mass),
    }
    parameters = dict(vehicle.parameters)
    for name, (key, factor) in values.items():
        if key in found.values:
            value, spread = factor * found.values[key], factor * found.deviations[key]
            text = f"identified from {source}, standard deviation {spread:.2g}"
            parameters[name] = Value(value=float(f"{value:.4g}"), source=text)
    return vehicle.model_copy(update={"parameters": parameters})


def write_vehicle(vehicle: Vehicle, path: Path) -> None:
    """Write a vehicle's TOML file."""
    text = json.dumps
    lines = [f"name = {text(vehicle.name)}", f"description = {text(vehicle.description)}", ""]
    lines.append("[parameters]")
    for name, given in vehicle.parameters.items():
        guess = ", guess = true" if given.guess else ""
        lines.append(
            f"{name} = {{ value = {given.value!r}, source = {text(given.source)}{guess} }}"
        )
    write_atomically(path, "\n".join(lines) + "\n")
