"""What there is, as lines of text and as plain data; nothing here runs anything."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gripbench.bench.catalogue.registry import built_in_methods, choose_method, method_names
from gripbench.bench.catalogue.scenarios import PREFIX, all_scenario_files, find_scenario
from gripbench.bench.catalogue.suites import load_suite, suite_files
from gripbench.bench.ranking.marks import MARK, marked
from gripbench.configuration import read_toml
from gripbench.envs.instruments.sensors import Sensor
from gripbench.envs.populations.causes import CAUSES, SHAPES_OF_TYRES
from gripbench.envs.populations.draws import sensors_at
from gripbench.envs.populations.grades import grade_files, load_grade
from gripbench.envs.populations.population import (
    TABLES,
    Population,
    load_population,
    population_files,
)
from gripbench.envs.signals import all_signals, signal
from gripbench.envs.vehicles import VEHICLE_PARAMETERS, load_vehicle, vehicle_files
from gripbench.errors import InputError, unknown
from gripbench.methods.contract import CompiledMethod

Lines = list[tuple[str, ...]]


def listing(kind: str) -> tuple[tuple[str, ...], Lines]:
    """Return header and lines of a list of `scenarios`, `methods`, `vehicles`..."""
    return _LISTS[kind]()


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


def sensor_needs(target: str = "", everything: bool = False) -> tuple[tuple[str, ...], Lines]:
    """Return the methods against the instruments that they need.

    Parameters
    ----------
    target
        Only methods that estimate this signal; empty: any.
    everything
        All methods, or those of Li, Du & Li (2014), whose Table I this is.
    """
    methods = {
        marked(label, _idealised(method)): method
        for label, method in _with_sensor_variants()
        if (everything or "Li, Du" in method.reference)
        and (not target or target in method.estimates)
    }
    if not methods:
        raise InputError(f"no method estimates '{target}'")
    instruments = [
        name
        for name in dict.fromkeys(item.instrument for item in all_signals().values())
        if any(name in _instruments(method) for method in methods.values())
    ]
    names = [name + MARK if name == "idealised" else name for name in instruments]
    lines = [
        (label, *("x" if name in _instruments(method) else "" for name in instruments),
         ", ".join(method.estimates))
        for label, method in methods.items()
    ]  # fmt: skip
    return ("method", *names, "estimates"), lines


def _with_sensor_variants() -> list[tuple[str, CompiledMethod]]:
    """Return the built-in methods, also in the variants that read other channels."""
    found = []
    for name, method in built_in_methods().items():
        found.append((name, method()))
        found += [
            (f"{name}:{variant}", method(variant))
            for variant, changes in method.variants.items()
            if changes.sensors is not None
        ]
    return found


def _idealised(method: CompiledMethod) -> tuple[str, ...]:
    return tuple(name for name in method.sensors if signal(name).idealised)


def _instruments(method: CompiledMethod) -> set[str]:
    return {signal(name).instrument for name in method.sensors}


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


def _scenario_lines() -> tuple[tuple[str, ...], Lines]:
    lines: Lines = []
    for name in all_scenario_files():
        item = find_scenario(name)
        lines.append((name, item.world, item.vehicle, f"{item.horizon:g} s", item.description))
    return ("scenario", "world", "vehicle", "horizon", "description"), lines


def _method_lines() -> tuple[tuple[str, ...], Lines]:
    lines: Lines = []
    for name, origin in method_names().items():
        method = built_in_methods().get(name)
        if method is None:
            lines.append((name, origin, "", "", ""))
            continue
        title = marked(method.title, _idealised(method()))
        variants = ", ".join(method.variants)
        lines.append((name, title, ", ".join(method.estimates), variants, method.reference))
    return ("method", "title", "estimates", "variants", "reference"), lines


def _vehicle_lines() -> tuple[tuple[str, ...], Lines]:
    return ("vehicle", "description"), [
        (name, load_vehicle(name).description) for name in vehicle_files()
    ]


def _signal_lines() -> tuple[tuple[str, ...], Lines]:
    return ("signal", "unit", "axes", "positive", "instrument", "description"), [
        (item.name, item.unit, item.frame, item.sign, item.instrument, item.description)
        for item in all_signals().values()
    ]


def _environment_lines() -> tuple[tuple[str, ...], Lines]:
    from gripbench.bench.catalogue.environments import environment_lines  # Gymnasium

    return environment_lines()


def _suite_lines() -> tuple[tuple[str, ...], Lines]:
    lines: Lines = []
    for name in suite_files():
        suite = load_suite(name)
        size = f"{len(suite.scenarios)} x {len(suite.methods)} x {suite.seeds}"
        lines.append((name, size, suite.description))
    return ("suite", "scenarios x methods x seeds", "description"), lines


def _population_lines() -> tuple[tuple[str, ...], Lines]:
    lines: Lines = []
    for name in population_files():
        population = load_population(name)
        guesses = sum(spread.guess for spread in population.spreads.values())
        size = f"{len(population.spreads)} ({guesses} guesses)"
        lines.append((name, size, population.description))
    return ("population", "causes", "description"), lines


def _cause_lines() -> tuple[tuple[str, ...], Lines]:
    populations = [load_population(name) for name in population_files()]
    lines: Lines = [
        (
            cause.name,
            cause.unit,
            *(spread_text(population, cause.name) for population in populations),
            cause.description,
        )
        for cause in CAUSES.values()
    ]
    names = [f"{population.name}, level 1" for population in populations]
    return ("cause", "unit", *names, "description"), lines


def spread_text(population: Population, cause: str) -> str:
    """Return the spread of a cause at level 1 in words; `?` marks a guess, empty: none."""
    if cause == SHAPES_OF_TYRES:
        chosen = population.shape
        if chosen is None:
            return ""
        shares = ", ".join(f"{name} {share:g}" for name, share in chosen.shares.items() if share)
        return shares + (" ?" if chosen.guess else "")
    spread = population.spreads.get(cause)
    if spread is None:
        return ""
    if spread.std > 0.0:
        text = f"sd {spread.std:g}"
    else:
        text = f"{spread.centre + spread.low:g} to {spread.centre + spread.high:g}"
    return text + (" ?" if spread.guess else "")


def _instrument_lines() -> tuple[tuple[str, ...], Lines]:
    lines: Lines = []
    for name in grade_files():
        grade = load_grade(name)
        assert grade is not None
        nothing = Sensor().model_dump()
        for channel, sensor in grade.sensors.items():
            given = sensor.model_dump()
            said = [f"{key} {given[key]}" for key in given if given[key] != nothing[key]]
            lines.append((name, channel, signal(channel).unit, ", ".join(said)))
    return ("grade", "channel", "unit", "errors and sampling"), lines


_LISTS = {
    "populations": _population_lines,
    "causes": _cause_lines,
    "instruments": _instrument_lines,
    "scenarios": _scenario_lines,
    "methods": _method_lines,
    "vehicles": _vehicle_lines,
    "signals": _signal_lines,
    "suites": _suite_lines,
    "environments": _environment_lines,
}
