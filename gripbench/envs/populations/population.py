"""Populations: one TOML file each, read into spreads of causes, every one with its source.

A file has the tables `[car]`, `[tyre]`, `[road]` and `[drive]`, whose keys are the causes of
`gripbench.envs.populations.causes`; `[friction_prior]`, what an engineer knows of the friction
before a drive; `[effects]`, how the state of a tyre changes it; `[instruments]`, the grade of the
instruments at each level; and `[[correlations]]` between causes.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Self

import numpy as np
from pydantic import Field, model_validator

from gripbench.configuration import CONFIGS, Configuration, named_file, parse, read_toml
from gripbench.envs.populations.causes import CAUSES, DIMENSION, PROCESSES, SHAPES_OF_TYRES
from gripbench.envs.populations.grades import load_grade
from gripbench.envs.populations.spreads import Spread, TyreChoice
from gripbench.envs.scenarios import LEVELS
from gripbench.envs.vehicles import Value
from gripbench.errors import InputError, nearest

TABLES = ("car", "tyre", "road", "drive")

GROUPS = (
    ("car.payload", "car.payload_place", "car.cg_place", "car.mass", "car.yaw_inertia"),
    ("car.cg_height", "car.payload", "car.payload_height", "car.mass", "car.springs"),
    *(
        (
            "tyre.radius",
            f"tyre.wear_{axle}",
            f"tyre.pressure_{axle}",
            "tyre.temperature",
            f"tyre.cornering_stiffness_{axle}",
            "tyre.longitudinal_stiffness",
            "car.payload",
        )
        for axle in ("front", "rear")
    ),
)
"""Causes that act on the same quantities: a car is checked at all corners of each group."""


class FrictionPrior(Configuration):
    """What is known of the friction before a drive: mean and standard deviation."""

    mean: float = Field(ge=0.01, le=2.0)
    std: float = Field(ge=0.0, le=2.0)
    source: str
    guess: bool = False


class Effects(Configuration):
    """What the state of a tyre does to it.

    Attributes
    ----------
    radius_per_wear
        Rolling radius [m] that a millimetre of tread is worth.
    radius_per_pressure
        Relative rolling radius over relative pressure.
    stiffness_per_wear, stiffness_per_pressure, stiffness_per_kelvin
        Relative stiffness over worn tread [1/mm], relative pressure and temperature [1/K].
    peak_per_wear, peak_per_kelvin
        Relative friction over worn tread [1/mm] and temperature [1/K].
    """

    radius_per_wear: Value = Value(value=1e-3, source="geometry")
    radius_per_pressure: Value
    stiffness_per_wear: Value
    stiffness_per_pressure: Value
    stiffness_per_kelvin: Value
    peak_per_wear: Value
    peak_per_kelvin: Value


class Instruments(Configuration):
    """Grade of the instruments at each level; `ideal`: those of the scenario, as in the papers."""

    level_1: str = "production"
    level_2: str = "worn"

    def grade(self, level: int) -> str:
        """Return the grade at a level."""
        return "ideal" if level == 0 else str(getattr(self, f"level_{level}"))


class Correlation(Configuration):
    """Correlation between the normal scores of two causes."""

    causes: tuple[str, str]
    value: float = Field(gt=-1.0, lt=1.0)
    source: str
    guess: bool = False


class Population(Configuration):
    """Cars, roads, drives and instruments from which a seed draws.

    Attributes
    ----------
    name
        Unique name; the file has the same.
    description
        One sentence.
    friction_prior
        What methods know of the friction.
    car, tyre, road, drive
        Spread of each cause.
    shape
        How often each shape of the tyres' force curve occurs; none: the scenario's own.
    effects
        What the state of a tyre does to it.
    instruments
        Grade at each level.
    correlations
        Between causes; those not named are independent.
    slip_limit
        Slip ratio from which a longitudinal car's traction control and anti-lock brakes act;
        0: it has none.
    usual_friction
        Friction coefficient around which roads are drawn, whatever the scenario's own is, so that
        no drive tells by itself what road it is on; 0: around the scenario's own.
    """

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    description: str
    friction_prior: FrictionPrior
    car: dict[str, Spread] = {}
    tyre: dict[str, Spread] = {}
    road: dict[str, Spread] = {}
    drive: dict[str, Spread] = {}
    shape: TyreChoice | None = None
    effects: Effects
    instruments: Instruments = Instruments()
    correlations: tuple[Correlation, ...] = ()
    slip_limit: float = Field(default=0.0, ge=0.0, le=0.5)
    usual_friction: float = Field(default=0.0, ge=0.0, le=1.0)

    @model_validator(mode="after")
    def _check_causes(self) -> Self:
        known = {name for name in CAUSES if name != SHAPES_OF_TYRES}
        for table in TABLES:
            for key, spread in getattr(self, table).items():
                name = f"{table}.{key}"
                if name not in known:
                    hint = nearest(name, known)
                    raise ValueError(f"key '{name}': unknown cause '{key}': {hint}")
                if name in PROCESSES and spread.high > spread.low:
                    raise ValueError(f"key '{name}': noise along the path has a 'std' only")
        return self

    @model_validator(mode="after")
    def _check_correlations(self) -> Self:
        for item in self.correlations:
            for name in item.causes:
                if name not in self.spreads:
                    hint = nearest(name, self.spreads)
                    raise ValueError(f"key 'correlations': unknown cause '{name}': {hint}")
            if item.causes[0] == item.causes[1]:
                raise ValueError(f"key 'correlations': '{item.causes[0]}' with itself")
        if np.linalg.eigvalsh(self.correlation_matrix())[0] <= 1e-9:
            raise ValueError("key 'correlations': no variables have these correlations together")
        return self

    @property
    def spreads(self) -> dict[str, Spread]:
        """Spread by the full name of the cause."""
        return {
            f"{table}.{key}": spread
            for table in TABLES
            for key, spread in getattr(self, table).items()
        }

    def correlation_matrix(self) -> np.ndarray:
        """Return the correlations of all dimensions' normal scores."""
        matrix = np.eye(len(CAUSES))
        for item in self.correlations:
            first, second = (DIMENSION[name] for name in item.causes)
            matrix[first, second] = matrix[second, first] = item.value
        return matrix


def population_files() -> dict[str, Path]:
    """Return the populations that ship with gripbench, by name."""
    return {path.stem: path for path in sorted((CONFIGS / "populations").glob("*.toml"))}


def load_population(name: str) -> Population:
    """Return a population by the name of a file that ships, or by the path of a TOML file.

    It is checked at every corner of its support with each vehicle that ships and can be simulated.

    Raises
    ------
    InputError
        If there is no such population, its file has a mistake or allows what is no car.
    """
    path = population_path(name)
    return _load(path, path.stat().st_mtime_ns if path.is_file() else 0)


def population_path(name: str) -> Path:
    """Return the file of a population.

    Raises
    ------
    InputError
        If none that ships has this name.
    """
    return named_file("population", name, population_files())


@lru_cache(maxsize=16)
def _load(path: Path, changed: int) -> Population:
    from gripbench.envs.vehicles import load_vehicle, vehicle_files

    del changed  # part of the cache's key only: the file may be edited while a notebook runs
    population = parse(Population, read_toml(path), path)
    for level in LEVELS[1:]:
        try:
            load_grade(population.instruments.grade(level))
        except InputError as error:
            raise InputError(f"{path}: key 'instruments.level_{level}': {error}") from None
    for name in vehicle_files():
        paper = load_vehicle(name).values()
        if "wheel_inertia" in paper:  # no plant drives one of which it is not known
            check_support(population, paper, path)
    return population


def check_support(population: Population, paper: Mapping[str, float], source: str | Path) -> None:
    """Check that every draw from a population is a car, whatever the level.

    Raises
    ------
    InputError
        If a corner of the support is none; the message names file and key.
    """
    from gripbench.envs.populations.cars import car_on_road, faults_of

    spreads = population.spreads
    grouped = {name for group in GROUPS for name in group}
    single = [(name,) for name in spreads if name.startswith(("car.", "tyre."))]
    for group in (*GROUPS, *(item for item in single if item[0] not in grouped)):
        names = [name for name in group if name in spreads]
        ends = [_ends(spreads[name]) for name in names]
        for corner in itertools.product(*ends):
            drawn = dict(zip(names, corner, strict=True))
            fault = faults_of(car_on_road(paper, drawn, population.effects))
            if fault:
                key = _blame(paper, drawn, population.effects)
                raise InputError(f"{source}: key '{key}': its spread allows {fault}")


def _ends(spread: Spread) -> tuple[float, float]:
    low, high = spread.support
    return spread.centre + LEVELS[-1] * low, spread.centre + LEVELS[-1] * high


def _blame(paper: Mapping[str, float], drawn: Mapping[str, float], effects: Effects) -> str:
    """Return the cause without which the car would be one; the first if it takes several."""
    from gripbench.envs.populations.cars import car_on_road, faults_of

    for name in drawn:
        others = {key: value for key, value in drawn.items() if key != name}
        if not faults_of(car_on_road(paper, others, effects)):
            return name
    return next(iter(drawn))
