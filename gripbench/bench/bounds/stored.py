"""Stored bounds: computed once for what boards need, kept beside the rows, read for ranking.

`<results>/bounds/<scenario>/<seed>.json`, written whole or not at all. Each has the key of what it
was made from (scenario, population, plant, instruments, the secret of hidden seeds and the code of
the bound); a file with
another key, or a damaged one, counts as none and is computed again.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from gripbench.bench.bounds.bound import bounds, channels_of
from gripbench.bench.bounds.model import reason_for_none
from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.running.fingerprints import salt_of, scenario_digest, versions
from gripbench.envs.scenarios import Scenario
from gripbench.envs.signals import signal
from gripbench.envs.worlds import known_worlds, sensors_of
from gripbench.errors import InputError
from gripbench.sources import digest, source_digest
from gripbench.writing import write_atomically

STEP = 0.02
"""Time between samples of a bound that is stored [s]."""

EVERYTHING = "any"
"""The set of all instruments that the car has."""


@dataclass(frozen=True)
class Least:
    """The bound of one run, target and set of instruments.

    Attributes
    ----------
    mean_square
        Mean of the least variance over the samples that count.
    known
        Share of them in which the target can be known.
    """

    mean_square: float
    known: float


Stored = Mapping[tuple[str, int, str, str], Least]
"""Bounds by scenario, seed, set of instruments and target."""


def key_of(scenario: Scenario) -> str:
    """Return the digest of all that a stored bound of a scenario is made from."""
    code = source_digest(Path(__file__).parent / "bound.py")
    parts = (json.dumps(versions()), repr(STEP), salt_of(scenario))
    return digest(scenario_digest(scenario), code, *parts)


def instruments_of(text: str, scenario: Scenario) -> tuple[str, ...]:
    """Return the channels that a set of instruments, one text with commas, has in a scenario."""
    present = {signal(channel).instrument for channel in sensors_of(scenario, 0)}
    if text == EVERYTHING:
        return channels_of(scenario)
    names = [name for name in text.split(", ") if name in present]
    return channels_of(scenario, names) if names else ()


def read_bounds(
    results: Path, scenarios: Iterable[Scenario]
) -> dict[tuple[str, int, str, str], Least]:
    """Return the stored bounds of scenarios that are up to date."""
    found: dict[tuple[str, int, str, str], Least] = {}
    for scenario in scenarios:
        folder = _folder(results, scenario.name)
        paths = sorted(folder.glob("*.json")) if folder.is_dir() else []
        key = key_of(scenario) if paths else ""
        for path in paths:
            content = _read(path, key)
            for text, by_target in content.items():
                for target, (mean_square, known) in by_target.items():
                    if path.stem.isdigit():
                        place = (scenario.name, int(path.stem), text, target)
                        found[place] = Least(mean_square, known)
    return found


def bounds_beside(results: Path, names: Iterable[str]) -> dict[tuple[str, int, str, str], Least]:
    """Return the up-to-date bounds that are stored beside the rows of scenarios, by their names."""
    known = []
    for name in names:
        if _folder(results, name).is_dir():
            with contextlib.suppress(InputError):
                known.append(find_scenario(name))
    return read_bounds(results, known)


def store_bounds(
    results: Path,
    wanted: Mapping[str, tuple[Scenario, Iterable[int], Iterable[str], Iterable[str]]],
    workers: int = 0,
    tell: Callable[[str], None] = lambda text: None,
) -> int:
    """Compute the bounds that are not stored yet, store them, and return of how many runs.

    Parameters
    ----------
    results
        The results folder.
    wanted
        By scenario: itself, its seeds, sets of instruments (each one text with commas) and targets.
    workers
        Processes; 0: one a core.
    tell
        Is told why a scenario has none.
    """
    import joblib

    tasks = []
    for name, (scenario, seeds, sets, targets) in wanted.items():
        reason = reason_for_none(scenario)
        if reason:
            tell(f"{name}: n/a: {reason}")
            continue
        key, truth = key_of(scenario), known_worlds()[scenario.world].truth_type.names or ()
        known = sorted(target for target in targets if target in truth)
        for seed in seeds:
            path = _folder(results, name) / f"{seed}.json"
            had = _read(path, key)
            lacking = sorted({text for text in sets if set(known) - set(had.get(text, {}))})
            if lacking and known:
                tasks.append((path, key, scenario, seed, lacking, known))
    call = joblib.delayed(_store)
    for reason in joblib.Parallel(n_jobs=workers or -1)(call(*task) for task in tasks):
        if reason:
            tell(reason)
    return len(tasks)


def _store(
    path: Path, key: str, scenario: Scenario, seed: int, sets: list[str], targets: list[str]
) -> str:
    """Compute and store the bounds of one run; return why there is none."""
    try:
        found = bounds(
            scenario, seed, [instruments_of(text, scenario) for text in sets], targets, STEP
        )
    except InputError as error:
        return str(error)
    content = _read(path, key)
    for text in sets:
        content.setdefault(text, {})
    for place, bound in enumerate(found):
        pair = [bound.rms**2, bound.knowable_share]
        content[sets[place // len(targets)]][bound.target] = pair
    body = json.dumps({"key": key, "bounds": content}, indent=1, sort_keys=True)
    write_atomically(path, body + "\n")
    return ""


def _read(path: Path, key: str) -> dict[str, dict[str, list[float]]]:
    """Return what a file holds; nothing where it is of something else, or damaged."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["key"] != key:
            return {}
        return {
            str(text): {str(target): [float(part) for part in pair] for target, pair in one.items()}
            for text, one in content["bounds"].items()
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}


def _folder(results: Path, scenario: str) -> Path:
    return results / "bounds" / quote(scenario, safe="")
