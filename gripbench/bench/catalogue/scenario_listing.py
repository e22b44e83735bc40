"""Scenarios, suites and populations in; lines of text that tell what there is of them out."""

from __future__ import annotations

from gripbench.bench.catalogue.scenarios import all_scenario_files, find_scenario
from gripbench.bench.catalogue.suites import load_suite, suite_files
from gripbench.envs.instruments.sensors import Sensor
from gripbench.envs.populations.causes import CAUSES, SHAPES_OF_TYRES
from gripbench.envs.populations.grades import grade_files, load_grade
from gripbench.envs.populations.population import Population, load_population, population_files
from gripbench.envs.signals import signal

Lines = list[tuple[str, ...]]


def _scenario_lines() -> tuple[tuple[str, ...], Lines]:
    lines: Lines = []
    for name in all_scenario_files():
        item = find_scenario(name)
        lines.append((name, item.world, item.vehicle, f"{item.horizon:g} s", item.description))
    return ("scenario", "world", "vehicle", "horizon", "description"), lines


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


LISTS = {
    "populations": _population_lines,
    "causes": _cause_lines,
    "instruments": _instrument_lines,
    "scenarios": _scenario_lines,
    "suites": _suite_lines,
}
"""Header and lines by kind."""
