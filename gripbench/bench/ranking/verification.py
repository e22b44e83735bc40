"""A pack in, a verdict out: its method run again here on drives that its author could not know.

Two questions. Do packed rows of public seeds come out again? A few of them, chosen by chance, are
run anew and must give the same figures. And does the method do as well elsewhere? It runs on fresh
seeds under a secret that is drawn for this verification alone, and its errors must be those of the
packed rows within their common uncertainty. Who wrote false figures fails the first, who carries
the truth of the packed drives, or simulates them, the second.
"""

from __future__ import annotations

import math
import secrets
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.catalogue.registry import MethodSpec
from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.ranking.plans import level_of
from gripbench.bench.ranking.resolution import resolution
from gripbench.bench.running.backends import Backend
from gripbench.bench.running.cells import Task, cell_of, run_task
from gripbench.bench.running.fingerprints import scenario_digest, scoring_digest, world_digest
from gripbench.bench.running.fitting import fitted
from gripbench.bench.running.isolation.limits import Limits
from gripbench.bench.running.packs import Pack
from gripbench.bench.running.recorded_scenarios import PREFIX
from gripbench.bench.running.rows import Row
from gripbench.bench.running.runner import Plan, run_plan
from gripbench.bench.running.store import Store
from gripbench.bench.scoring.metric import pooled_rms
from gripbench.envs.hidden_draws import drawn_with
from gripbench.envs.scenarios import Scenario
from gripbench.errors import InputError
from gripbench.sources import digest

CONFIDENCE = 0.99
"""Confidence with which a pack whose figures are true is verified."""

TOLERANCE = 1e-3
"""Relative difference of an RMS that another processor or library may make."""

ATTEMPTS = 3
"""How often a cell is run that something outside the method ended."""

REPEATED = 3
"""Packed rows of each scenario that are run again."""


@dataclass(frozen=True)
class Comparison:
    """What fresh drives say of the packed figures of one scenario and target.

    Attributes
    ----------
    packed, fresh
        Pooled RMS of the packed runs and of the fresh ones that are `ok`; NaN: there are none.
    packed_runs, fresh_runs, failed
        Number of these runs, and of fresh ones that failed.
    ratio, low, high
        Fresh over packed, geometric mean of the runs' RMS, with its interval.
    fault
        What is wrong; empty: they agree.
    """

    scenario: str
    target: str
    packed: float
    packed_runs: int
    fresh: float
    fresh_runs: int
    failed: int
    ratio: float
    low: float
    high: float
    fault: str


@dataclass(frozen=True)
class Verdict:
    """What became of a pack.

    Attributes
    ----------
    comparisons
        By scenario and target.
    repeated
        Number of packed rows that were run again.
    different
        What came out otherwise, a sentence each.
    notes
        What the verdict does not say.
    """

    comparisons: tuple[Comparison, ...]
    repeated: int
    different: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def verified(self) -> bool:
        """Whether nothing speaks against the pack."""
        return not self.faults

    @property
    def faults(self) -> list[str]:
        """Return what speaks against it, a sentence each."""
        return [*self.different, *(one.fault for one in self.comparisons if one.fault)]


def verify(
    pack: Pack,
    folder: Path,
    seeds: int = 20,
    scenarios: Iterable[str] = (),
    limits: Limits | None = None,
    backend: Backend | None = None,
    on_run: Callable[[int], Any] = lambda of: None,
) -> Verdict:
    """Run the method of a pack again and compare.

    Parameters
    ----------
    pack
        As `packs.read_pack` returns it.
    folder
        Where the fresh rows may be kept, a folder that is not there yet.
    seeds
        Number of fresh seeds of each scenario.
    scenarios
        Only these, names or TOML files; by default all of the pack's rows.
    limits, backend
        What a cell may take, and where cells run.
    on_run
        Called after each run with the number of all.

    Raises
    ------
    InputError
        If the pack cannot be compared here: an unknown scenario, rows of another gripbench.
    """
    if seeds < 2:
        raise InputError(f"seeds: {seeds} say nothing of the spread; give 2 or more")
    limits = limits or Limits()
    spec = fitted(pack.method(), folder, limits)
    chosen, notes = _scenarios(pack, scenarios)
    rows = [row for row in pack.rows if row.scenario in chosen]
    again = _to_repeat(rows)
    total = len(again) + seeds * len(chosen)
    with drawn_with(""):
        different = [
            text for row in again
            for text in (_difference(row, chosen[row.scenario], spec, limits), on_run(total))
            if text
        ]  # fmt: skip
    with drawn_with(secrets.token_hex(32)):
        plan = Plan(tuple(chosen.values()), (spec,), range(seeds))
        fresh: list[Row] = []

        def on_row(row: Row) -> None:
            fresh.append(row)
            on_run(total)

        for _ in range(ATTEMPTS):
            fresh.clear()
            run_plan(plan, Store(folder), backend, limits, on_row=on_row)
            if not any(row.passing for row in fresh):  # what was killed from outside runs again
                break
    notes += _of_environment(pack, fresh)
    return Verdict(tuple(compare(rows, fresh)), len(again), tuple(different), tuple(notes))


def _scenarios(pack: Pack, only: Iterable[str]) -> tuple[dict[str, Scenario], list[str]]:
    """Return the scenarios that can be compared, by name, and what is left out."""
    given = {scenario.name: scenario for scenario in map(find_scenario, only)}
    packed = {row.scenario for row in pack.rows if row.status != "skipped"}
    for name in given:
        if name not in packed:
            raise InputError(f"{pack.path}: holds no rows of '{name}'")
    found, notes = {}, []
    for name in sorted(set(given) or packed):
        if name.startswith(PREFIX):
            notes.append(f"{name}: a recording has no fresh drives; not compared.")
            continue
        try:
            scenario = given.get(name) or find_scenario(name)
        except InputError as error:
            raise InputError(
                f"{pack.path}: has rows of '{name}', and there is none here ({error}); give its "
                "file with --scenario"
            ) from None
        for row in pack.rows:
            if row.scenario == name and row.world != _world(scenario, row.salt):
                raise InputError(
                    f"{pack.path}: its rows of '{name}' are of another version of the scenario or "
                    "of the scoring; run and pack it again with this gripbench"
                )
        if not level_of(name):
            notes.append(
                f"{name}: level 0 has fresh noise only; whoever knows the scenario knows its truth."
            )
        found[name] = scenario
    if not found:
        raise InputError(f"{pack.path}: no row in it can be compared: all are skipped or recorded")
    return found, notes


def _world(scenario: Scenario, salt: str) -> str:
    """Return the world that a row of a scenario must have; see `fingerprints.world_digest`."""
    if not salt:
        with drawn_with(""):
            return world_digest(scenario)
    return digest(scenario_digest(scenario), scoring_digest(), salt)


def _to_repeat(rows: Sequence[Row]) -> list[Row]:
    """Return a few rows of public seeds of each scenario, chosen by chance."""
    chosen = []
    for name in dict.fromkeys(row.scenario for row in rows):
        own = [row for row in rows if row.scenario == name and row.status == "ok" and not row.salt]
        chosen += secrets.SystemRandom().sample(own, min(REPEATED, len(own)))
    return chosen


def _difference(row: Row, scenario: Scenario, spec: MethodSpec, limits: Limits) -> str:
    """Return how a packed row comes out otherwise when it is run again; empty: it does not."""
    cell = cell_of(scenario, row.seed, spec, world_digest(scenario))
    (found,) = run_task(Task((cell,), limits, timed=False))
    where = f"{row.scenario}, seed {row.seed}"
    if found.status != "ok":
        return f"{where}: {found.status} here ({found.reason})"
    for target, values in row.scores.items():
        packed = values["rms"].value
        here = found.scores[target]["rms"].value if target in found.scores else None
        if packed is None or here is None or not math.isclose(packed, here, rel_tol=TOLERANCE):
            return f"{where}: {target} has RMS {_shown(here)} here, {_shown(packed)} in the pack"
    return ""


def _shown(value: float | None) -> str:
    return "none" if value is None else f"{value:.6g}"


def compare(packed: Sequence[Row], fresh: Sequence[Row]) -> list[Comparison]:
    """Return the comparisons of packed and fresh rows of the same scenarios, by target."""
    before, after = _by_target(packed), _by_target(fresh)
    confidence = 1.0 - (1.0 - CONFIDENCE) / max(len(before), 1)
    return [
        _compared(*key, rows, after.get(key, []), confidence)
        for key, rows in sorted(before.items())
    ]


def _by_target(rows: Iterable[Row]) -> dict[tuple[str, str], list[Row]]:
    found: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        for target in (row.scores or row.targets) if row.status != "skipped" else ():
            found.setdefault((row.scenario, target), []).append(row)
    return found


def _compared(
    scenario: str, target: str, packed: list[Row], fresh: list[Row], confidence: float
) -> Comparison:
    sums = [_sums(rows, target) for rows in (packed, fresh)]
    pooled = [pooled_rms(*each) if each.size else math.nan for each in sums]
    smallest = max(resolution(target), float(np.finfo(float).tiny))
    logs = [np.log(np.maximum(np.sqrt(each[0] / each[1]), smallest)) for each in sums]
    failed = sum(row.status not in ("ok", "skipped") for row in fresh)
    difference, half = difference_of(logs[0], logs[1], confidence)
    where = f"{target} in {scenario}"
    fault = ""
    if failed and not _as_often(len(packed) - len(logs[0]), len(packed), failed, len(fresh)):
        reason = next(row.reason for row in fresh if row.status not in ("ok", "skipped"))
        fault = f"{where}: {failed} of {len(fresh)} fresh runs failed ({reason})"
    elif not len(logs[1]) and len(logs[0]):
        fault = f"{where}: no fresh run has a result"
    elif len(logs[0]) and not abs(difference) <= half + math.log1p(TOLERANCE):
        ends = [math.exp(difference + sign * half) for sign in (-1.0, 1.0)]
        fault = (
            f"{where}: RMS {pooled[1]:.4g} on fresh seeds, {pooled[0]:.4g} in the pack; ratio "
            f"{math.exp(difference):.3g}, within {ends[0]:.3g} to {ends[1]:.3g}"
        )
    ratio, low, high = (math.exp(difference + shift) for shift in (0.0, -half, half))
    return Comparison(
        scenario, target, pooled[0], len(logs[0]), pooled[1], len(logs[1]), failed,
        ratio, low, high, fault,
    )  # fmt: skip


def _sums(rows: Iterable[Row], target: str) -> npt.NDArray[np.float64]:
    """Return sums of squares and counts of the runs that are `ok`, shape (2, runs)."""
    found = [row.scores[target]["rms"] for row in rows if row.status == "ok"]
    return np.array([[one.total for one in found], [one.count for one in found]], float)


def difference_of(
    packed: npt.NDArray[np.float64], fresh: npt.NDArray[np.float64], confidence: float
) -> tuple[float, float]:
    """Return the mean of `fresh` less that of `packed`, and half the width of its interval.

    Student's interval for two samples of one distribution: that both are of one is what is in
    question, so their spread is pooled, and one packed run is enough.
    """
    from scipy.stats import t

    runs = len(packed) + len(fresh)
    if not len(packed) or not len(fresh) or runs < 3:
        return math.nan, math.nan
    squares = sum(float(((each - each.mean()) ** 2).sum()) for each in (packed, fresh))
    spread = math.sqrt(squares / (runs - 2) * (1.0 / len(packed) + 1.0 / len(fresh)))
    width = float(t.ppf(0.5 + 0.5 * confidence, runs - 2)) * spread
    return float(fresh.mean() - packed.mean()), width


def _as_often(failed_before: int, before: int, failed: int, runs: int) -> bool:
    """Return whether fresh runs fail no more often than packed ones, by Fisher's exact test."""
    from scipy.stats import fisher_exact

    if failed == runs and failed_before < before:
        return False
    table = np.array([[failed, runs - failed], [failed_before, before - failed_before]])
    return bool(fisher_exact(table, alternative="greater").pvalue > 1.0 - CONFIDENCE)


def _of_environment(pack: Pack, fresh: Sequence[Row]) -> list[str]:
    """Return what differs between where a pack was made and here, and what nobody can follow."""
    notes = []
    here: Mapping[str, str] = fresh[0].versions if fresh else {}
    before = pack.rows[0].versions
    changed = [
        f"{name} {before.get(name)} -> {version}"
        for name, version in here.items() if before.get(name) not in (None, version)
    ]  # fmt: skip
    if changed:
        notes.append(f"Packed with other versions: {', '.join(changed)}.")
    untracked = sorted({word for row in fresh for word in row.untracked})
    if untracked:
        notes.append(f"It reads what cannot be followed: {', '.join(untracked)}.")
    return notes
