"""A name in; everything that is set for the scenario, method, vehicle or suite of it out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gripbench.bench.catalogue.registry import built_in_methods, choose_method, method_names
from gripbench.bench.catalogue.scenarios import PREFIX, all_scenario_files, find_scenario
from gripbench.bench.catalogue.suites import load_suite, suite_files
from gripbench.configuration import read_toml
from gripbench.envs.populations.draws import sensors_at
from gripbench.envs.populations.grades import grade_files, load_grade
from gripbench.envs.populations.population import TABLES, load_population, population_files
from gripbench.envs.signals import all_signals, signal
from gripbench.envs.vehicles import VEHICLE_PARAMETERS, load_vehicle, vehicle_files
from gripbench.errors import unknown


def settings(name: str) -> dict[str, Any]:
    """Return everything that is set for the scenario, method, vehicle, suite or signal `name`.

    Raises
    ------
    InputError
        If nothing has this name; the message names the nearest one.
    """
    kind = _kind_of_file(name) if name.endswith(".toml") else ""
    if name in vehicle_files() or kind == "vehicle":
        return {"kind": "vehicle", **_vehicle(name)}
    if name in suite_files() or kind == "suite":
        return {"kind": "suite", **load_suite(name).model_dump(mode="json")}
    if name in population_files() or kind == "population":
        return {"kind": "population", **load_population(name).model_dump(mode="json")}
    if name in grade_files():
        return {"kind": "instruments", **load_grade(name).model_dump(mode="json")}  # type: ignore[union-attr]
    place = name if name.startswith(PREFIX) else name.rpartition("@")[0] or name
    if place in all_scenario_files() or place.endswith(".toml") or name.startswith(PREFIX):
        scenario = find_scenario(name)
        sensors = {key: item.model_dump() for key, item in sensors_at(scenario).items()}
        return {"kind": "scenario", **scenario.model_dump(mode="json"), "sensors": sensors}
    if name.startswith("gripbench/"):
        from gripbench.bench.catalogue.environments import environment_settings  # Gymnasium

        return {"kind": "environment", **environment_settings(name)}
    if name in all_signals():
        entry = signal(name)
        shown = {"angle": entry.angle, "display_unit": entry.display_unit}
        return {"kind": "signal", **vars(entry), **shown}
    if ".py" in name or name.partition(":")[0].partition("@")[0] in method_names():
        return {"kind": "method", **_method(name)}
    known = [
        *all_scenario_files(), *method_names(), *suite_files(), *vehicle_files(), *all_signals(),
        *population_files(), *grade_files(),
    ]  # fmt: skip
    raise unknown("name", name, known)


def _kind_of_file(name: str) -> str:
    """Tell what a TOML file holds by the keys that only its kind has; empty: a scenario."""
    content = read_toml(Path(name))
    if "world" not in content:
        for kind, keys in _KEYS_OF_FILES.items():
            if keys & set(content):
                return kind
    return ""


_KEYS_OF_FILES = {
    "vehicle": {"parameters"},
    "suite": {"scenarios", "methods"},
    "population": {"friction_prior", "effects", *TABLES},
}


def _method(name: str) -> dict[str, Any]:
    spec = choose_method(name)
    declaration = spec.declaration
    content: dict[str, Any] = {
        "name": declaration.name,
        "title": declaration.title,
        "reference": declaration.reference,
        "variant": declaration.variant,
        "sensors": list(declaration.sensors),
        "idealised": list(declaration.idealised),
        "estimates": list(declaration.estimates),
        "variances": list(declaration.variances),
        "quantiles": {name: list(levels) for name, levels in declaration.quantiles.items()},
        "innovations": list(declaration.innovations),
        "vehicle_parameters": list(declaration.vehicle_parameters),
        "settings": declaration.settings,
    }
    built_in = built_in_methods().get(declaration.name)
    if built_in is not None:
        content["parameters"] = {
            item.name: {
                "default": item.default,
                "unit": item.unit,
                "low": item.low if abs(item.low) != float("inf") else None,
                "high": item.high if abs(item.high) != float("inf") else None,
                "choices": list(item.choices),
                "description": item.description,
            }
            for item in built_in.parameters
        }
        content["variants"] = {
            key: dict(value.settings) for key, value in built_in.variants.items()
        }
    return content


def _vehicle(name: str) -> dict[str, Any]:
    vehicle = load_vehicle(name)
    parameters = {
        key: {**item.model_dump(), "unit": VEHICLE_PARAMETERS[key].unit}
        for key, item in vehicle.parameters.items()
    }
    return {"name": vehicle.name, "description": vehicle.description, "parameters": parameters}
