"""The kind of what is asked for in; what there is of it out, as lines of text: nothing is run."""

from __future__ import annotations

from gripbench.bench.catalogue.registry import built_in_methods, method_names
from gripbench.bench.ranking.marks import MARK, marked
from gripbench.envs.signals import all_signals, signal
from gripbench.envs.vehicles import load_vehicle, vehicle_files
from gripbench.errors import InputError
from gripbench.methods.contract import CompiledMethod

Lines = list[tuple[str, ...]]


def listing(kind: str) -> tuple[tuple[str, ...], Lines]:
    """Return header and lines of a list of `scenarios`, `methods`, `vehicles`..."""
    if kind in _LISTS:
        return _LISTS[kind]()
    from gripbench.bench.catalogue.scenario_listing import LISTS  # the world, half of the time

    return LISTS[kind]()


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


_LISTS = {
    "methods": _method_lines,
    "vehicles": _vehicle_lines,
    "signals": _signal_lines,
    "environments": _environment_lines,
}
