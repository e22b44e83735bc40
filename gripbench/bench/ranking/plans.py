"""Scenario names in, the plan and setting that their board belongs to and the kind of road out.

A board belongs to a plan: a suite, or what is left at one level of population. Rows outside a plan
do not touch its boards.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any

from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.catalogue.suites import load_suite, suite_files
from gripbench.bench.running.recorded_scenarios import PREFIX
from gripbench.envs.populations.drives import friction_of
from gripbench.envs.populations.population import load_population
from gripbench.envs.scenarios import Scenario
from gripbench.errors import GripbenchError

ROADS: tuple[tuple[str, float], ...] = (("ice", 0.2), ("snow", 0.4), ("wet", 0.7))
"""Kind of road and the friction below which it is one; above all of them it is dry."""


@cache
def _plans() -> dict[str, str]:
    """Return the suite of each scenario that a shipped suite names."""
    found: dict[str, str] = {}
    for name in suite_files():
        for scenario in load_suite(name).names():
            found.setdefault(scenario, name)
    return found


def plan_of(scenario: str) -> str:
    """Return the plan of a scenario: its suite, `level N`, or empty for one of level 0.

    Each recording of a real vehicle is a plan of its own: its runs are windows of one drive, which
    have no counterpart in another scenario.
    """
    if scenario.startswith(PREFIX):
        return scenario
    level = scenario.partition("@")[2]
    return _plans().get(scenario) or (f"level {level}" if level else "")


def level_of(scenario: str) -> int:
    """Return the level of a scenario's population, 0 where it has none."""
    level = scenario.partition("@")[2]
    return int(level) if level.isdigit() and not scenario.startswith(PREFIX) else 0


def setting_of(scenario: str) -> str:
    """Return in words what cars a scenario has; empty for one outside the shipped suites."""
    if scenario.startswith(PREFIX):
        return "real vehicle"
    level = level_of(scenario)
    if level:
        return "production spread" if level == 1 else f"wide spread, level {level}"
    return "the papers' setting" if plan_of(scenario) else ""


def hiding_of(scenarios: Iterable[str], salt: str) -> str:
    """Return what a board has to say of its drives: whether anybody could simulate them before.

    Parameters
    ----------
    scenarios
        Names of the board's scenarios.
    salt
        Digest of the secret that they were drawn with; empty: none.
    """
    names = list(scenarios)
    if not names or names[0].startswith(PREFIX):
        return ""
    if not any(map(level_of, names)):
        return (
            "Level 0, for reproduction only: the car on paper is driven, and anybody can simulate "
            "these drives."
        )
    if salt:
        return (
            f"Hidden seeds: drawn with a secret (digest {salt[:8]}), which nobody who lacks it can "
            "simulate."
        )
    return "Public seeds: anybody can simulate these drives beforehand."


def standing(scenario: str) -> int:
    """Return where the boards of a scenario stand among all: level 1 first, no spread last.

    Without a spread a method is given the very car that it is tested on: that repeats a paper and
    tells nothing of another car.
    """
    level = level_of(scenario)
    if level:
        return level
    return 1_000 if scenario.startswith(PREFIX) else 1_001


def standing_of(board: Any) -> int:
    """Return where a board stands among all, see `standing`."""
    return min(map(standing, board.scenarios), default=0)


@cache
def road_of(scenario: str) -> str:
    """Return the kind of road of a scenario: `dry`, `wet`, `snow`, `ice`, `changing`.

    Where a population draws roads of several kinds it is `any`. A real drive is a `real drive`; a
    scenario that is no longer at hand is on an `unknown` road.
    """
    if scenario.startswith(PREFIX):
        return "real drive"
    try:
        plain = find_scenario(scenario)
        drawn = _drawn(plain)
    except GripbenchError:
        return "unknown"
    found = sorted(drawn or _frictions(plain))
    if not found:
        return "unknown"
    kinds = [_kind(value) for value in (found[0], found[-1])]
    return kinds[0] if kinds[0] == kinds[1] else "any" if drawn else "changing"


def _drawn(scenario: Scenario) -> list[float]:
    """Return the least and the largest friction that seeds may draw; none where none is drawn."""
    if not (scenario.level and scenario.population):
        return []
    population = load_population(scenario.population)
    spread = population.spreads.get("road.friction")
    if spread is None or spread.support[0] == spread.support[1]:
        return []
    usual = [population.usual_friction] if population.usual_friction else _frictions(scenario)
    ends = (spread.centre + scenario.level * end for end in spread.support)
    return [friction_of(value, end) for end in ends for value in usual]


def _kind(friction: float) -> str:
    return next((name for name, below in ROADS if friction < below), "dry")


def _frictions(scenario: Any) -> list[float]:
    """Return the friction coefficients that a scenario's file names."""
    road = getattr(scenario, "road", None)
    if road is not None:
        values = (getattr(road, name, 0.0) for name in ("mu", "mu_right", "mu_after"))
        return [value for value in values if value]
    pieces = getattr(scenario, "friction", ())
    return [value for piece in pieces for value in (piece.first, piece.last)]
