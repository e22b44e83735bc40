"""Scenarios, seeds, sensors and targets in; their bounds from several processes out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from gripbench.bench.bounds.bound import Bound, bounds, channels_of, check_target
from gripbench.bench.bounds.model import STEP, reason_for_none
from gripbench.envs.scenarios import Scenario
from gripbench.envs.worlds import known_worlds
from gripbench.errors import InputError

USUAL = ("mu_front", "mu", "sideslip")
"""Targets where none is given: those of them that the truth has."""

ALL = "all"
"""Name of the set of all instruments that the car has."""


def bounds_of(
    scenarios: Sequence[Scenario],
    seeds: Iterable[int],
    sensors: Sequence[str],
    targets: Sequence[str] = (),
    step: float = STEP,
    workers: int = 0,
) -> tuple[dict[str, list[Bound]], dict[str, str]]:
    """Return the bounds of every run.

    Parameters
    ----------
    scenarios, seeds
        The runs.
    sensors
        Sets of instruments or channels, each one text with commas; empty: all.
    targets
        Signals; empty: those of `USUAL` that the truth of the first scenario has.
    step
        Time between samples [s].
    workers
        Processes; 0: one a core.

    Returns
    -------
    The bounds by the name of their set of sensors, and why there is none by scenario.

    Raises
    ------
    InputError
        If a target is unknown or a scenario lacks a sensor.
    """
    import joblib

    missing = {one.name: reason for one in scenarios if (reason := reason_for_none(one))}
    ran = [one for one in scenarios if one.name not in missing]
    sets = {text or ALL: [name.strip() for name in text.split(",") if name.strip()]
            for text in sensors}  # fmt: skip
    tasks = []
    for one in ran:
        truth = known_worlds()[one.world].truth_type.names or ()
        wanted = list(targets) or [name for name in USUAL if name in truth]
        for target in wanted:
            check_target(one, target)
        channels = [channels_of(one, names) for names in sets.values()]
        tasks += [(one, seed, channels, wanted, step) for seed in seeds]
    call = joblib.delayed(_bounds)
    parts = joblib.Parallel(n_jobs=workers or -1)(call(*task) for task in tasks)
    found: dict[str, list[Bound]] = {}
    for part, task in zip(parts, tasks, strict=True):
        if isinstance(part, str):
            missing.setdefault(task[0].name, part)
            continue
        for place, name in enumerate(sets):
            width = len(task[3])
            found.setdefault(name, []).extend(part[place * width : (place + 1) * width])
    return found, missing


def _bounds(
    scenario: Scenario, seed: int, sets: list[tuple[str, ...]], targets: list[str], step: float
) -> list[Bound] | str:
    """Return the bounds of one run, or why it has none."""
    try:
        return bounds(scenario, seed, sets, targets, step)
    except InputError as error:
        return str(error)
