"""A population, or scenarios, in; the drives that methods are trained and tuned on out.

They are at level 1, from seeds that no test may touch, and the same for every method that asks.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from gripbench.bench.catalogue.declarations import Declaration
from gripbench.bench.catalogue.scenarios import all_scenario_files, find_scenario
from gripbench.bench.catalogue.training import TRAINING_LEVEL, TRAINING_SEEDS
from gripbench.bench.running.execution import missing
from gripbench.bench.running.fingerprints import scenario_digest
from gripbench.bench.running.isolation import training_drives
from gripbench.bench.running.recorded_scenarios import RecordedScenario
from gripbench.bench.scoring.scoring import targets_of
from gripbench.envs.plants.longitudinal.scenario import PAPER_SOLVER
from gripbench.envs.populations.population import population_files
from gripbench.envs.recordings import Recording
from gripbench.envs.scenarios import Scenario
from gripbench.envs.worlds import at_level, record
from gripbench.errors import InputError, unknown
from gripbench.sources import digest

EACH = 4
"""Drives of each scenario."""


@dataclass(frozen=True)
class Course:
    """Drives to train on: scenarios, and of each a number of seeds.

    Attributes
    ----------
    name
        Population or scenarios, with their level.
    scenarios
        All at the level of training.
    each
        Drives of each scenario.
    first
        First seed.
    """

    name: str
    scenarios: tuple[Scenario, ...]
    each: int = EACH
    first: int = TRAINING_SEEDS.start

    @property
    def seeds(self) -> tuple[int, int]:
        """First seed, and the one behind the last."""
        return self.first, self.first + self.each * len(self.scenarios)

    @property
    def digest(self) -> str:
        """Digest of all that the drives depend on."""
        worlds = [scenario_digest(scenario) for scenario in self.scenarios]
        return digest(*worlds, repr((self.first, self.each)), inspect.getsource(training_drives))

    def recordings(self, declaration: Declaration, target: str = "") -> Iterator[Recording]:
        """Yield the drives that give a method its channels and the truth of what it estimates.

        Every drive has a seed, and so a car, of its own.

        Parameters
        ----------
        declaration
            What the method declares.
        target
            The estimate whose truth is needed; by default any.

        Raises
        ------
        InputError
            If no drive does.
        """
        reason, served = "", False
        targets = (target,) if target else declaration.estimates
        for index, scenario in enumerate(self.scenarios):
            for seed in range(self.each):
                recording = record(scenario, self.first + index * self.each + seed)
                channels = recording.observations.dtype.names or ()
                lacking = missing(declaration, recording.vehicle, channels)
                if lacking or not targets_of(targets, recording):
                    reason = reason or lacking or f"no scenario has the truth of {targets[0]}"
                    break
                served = True
                yield recording
        if not served:
            raise InputError(f"{declaration.name}: no drive of {self.name} serves it: {reason}")


def course_of(names: Sequence[str], folder: Path, each: int = EACH) -> Course:
    """Return the drives of a population, or of scenarios.

    Parameters
    ----------
    names
        One population, of which every scenario that can be drawn counts, or scenarios.
    folder
        Where files of scenarios are looked for.
    each
        Drives of each scenario.

    Raises
    ------
    InputError
        If there is no such population or scenario, or one has no population.
    """
    if len(names) == 1 and names[0] in population_files():
        found = [find_scenario(name) for name in all_scenario_files()]
        chosen = [
            scenario
            for scenario in found
            if scenario.population == names[0] and scenario.integrator != PAPER_SOLVER
        ]
    else:
        chosen = [_scenario(name, folder) for name in names]
    scenarios = tuple(at_level(scenario, TRAINING_LEVEL) for scenario in chosen)
    shown = names if len(chosen) > len(names) else [scenario.name for scenario in chosen]
    text = ", ".join(name.partition("@")[0] for name in shown) + f"@{TRAINING_LEVEL}"
    return Course(text, scenarios, each)


def _scenario(name: str, folder: Path) -> Scenario:
    plain, mark, level = name.partition("@")
    if mark and level.partition("+")[0] != str(TRAINING_LEVEL):
        raise InputError(f"scenario '{name}': training drives are of level {TRAINING_LEVEL}")
    if not plain.endswith(".toml"):
        if plain not in all_scenario_files():
            raise unknown(
                "population or scenario", name, [*population_files(), *all_scenario_files()]
            )
    elif not Path(plain).is_absolute():
        name = str(folder / name)
    scenario = find_scenario(name)
    if isinstance(scenario, RecordedScenario) or scenario.faults:
        raise InputError(f"scenario '{name}': give a simulated one without faults to train on")
    return scenario
