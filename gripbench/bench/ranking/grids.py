"""Which runs a ranking compares: the same seeds of the same scenarios for every method.

A board is a target and a set of instruments. On it stand the methods that estimate the target and
read nothing but those instruments; one that reads fewer competes at its own disadvantage, one
that reads more is not on it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd

from gripbench.bench.ranking.measures import RMS, Measure
from gripbench.bench.ranking.plans import plan_of
from gripbench.bench.running.recorded_scenarios import PREFIX
from gripbench.envs.signals import SIGNALS, signal
from gripbench.errors import InputError, unknown

ANY = "any"
"""Instead of a set of instruments: all methods on one board, whatever they read."""


@dataclass(frozen=True)
class Grid:
    """The runs that the methods of one board have in common.

    Attributes
    ----------
    target
        Signal that is estimated.
    labels
        Methods with a result in every run, in alphabetical order.
    incomplete
        Methods that failed in a run, or were not run in a scenario, with the number of such runs.
    scenarios
        Scenarios that were run with the common seeds.
    seeds
        Seeds common to all methods and to those scenarios.
    single
        Scenarios with one common seed only, such as logs.
    rows
        The rows of all methods, failures among them, in these runs.
    totals, counts
        What the measure sums up, of the complete methods, shape (scenarios, seeds, labels).
    single_values
        Its value for the complete methods in the single runs, shape (single, labels).
    notes
        What was left out, one sentence each.
    measure
        What is compared.
    """

    target: str
    labels: tuple[str, ...]
    incomplete: dict[str, int]
    scenarios: tuple[str, ...]
    seeds: tuple[int, ...]
    single: tuple[str, ...]
    rows: pd.DataFrame
    totals: npt.NDArray[np.float64]
    counts: npt.NDArray[np.float64]
    single_values: npt.NDArray[np.float64]
    notes: tuple[str, ...]
    measure: Measure = RMS

    @property
    def cells(self) -> int:
        """Number of runs of each method."""
        return len(self.scenarios) * len(self.seeds) + len(self.single)


PRODUCTION = ("accelerometer", "gyroscope", "steering angle sensor", "wheel speed sensor")
"""What every production car has on its bus; its boards and answers stand first."""


def opening(sensors: tuple[str, ...]) -> int:
    """Return where a set of instruments stands: a production car's first, then parts of it."""
    if sensors == PRODUCTION:
        return 0
    return 1 if sensors and set(sensors) <= set(PRODUCTION) else 2


def instruments(channels: str | Iterable[str]) -> tuple[str, ...]:
    """Return what gives these channels, without repetition, in alphabetical order.

    Parameters
    ----------
    channels
        Names, or one text with spaces between them as in the rows. The clock is not counted, and
        channels that no sensor gives count as the instrument `idealised`.
    """
    names = channels.split() if isinstance(channels, str) else channels
    return tuple(sorted({signal(name).instrument or name for name in names} - {"clock"}))


def sensor_sets(rows: pd.DataFrame) -> list[tuple[str, ...]]:
    """Return the sets of instruments that have a board of their own, the smallest first.

    Each set that a method reads, but for those that tell nothing of their own: with fewer than two
    methods besides baselines, or with the same ones as a larger set. Their methods stand on the
    boards of the larger sets. What a production car has is never left out.
    """
    readers: dict[tuple[str, ...], set[str]] = {}
    for (channels, label), part in rows.groupby(["sensors", "label"]):
        own = readers.setdefault(instruments(str(channels)), set())
        if not part["baseline"].any():
            own.add(str(label))
    sets = sorted(readers, key=lambda names: (len(names), names))
    on_it = {names: _union(readers[less] for less in sets if set(less) <= set(names))
             for names in sets}  # fmt: skip
    kept = []
    for names in sets:
        larger = [other for other in sets if set(names) < set(other)]
        told = len(on_it[names]) > 1 and all(on_it[names] != on_it[other] for other in larger)
        if told or not larger or names == PRODUCTION:
            kept.append(names)
    real = [names for names in kept if on_it[names]]
    return real or kept


def _union(groups: Iterable[set[str]]) -> frozenset[str]:
    return frozenset().union(*groups)


def chosen_instruments(given: str | Iterable[str]) -> tuple[str, ...]:
    """Return a set of instruments from names or one text with commas between them.

    Raises
    ------
    InputError
        If there is no such instrument.
    """
    names = given.split(",") if isinstance(given, str) else given
    known = {item.instrument for item in SIGNALS.values()} - {"", "clock"}
    chosen = sorted({name.strip() for name in names} - {""})
    for name in chosen:
        if name not in known:
            raise unknown("instrument", name, known)
    return tuple(chosen)


def on_board(
    rows: pd.DataFrame, target: str, allowed: tuple[str, ...] | None = None
) -> list[tuple[pd.DataFrame, list[str]]]:
    """Return the rows of the methods of a board, in parts that can be compared.

    A scenario in which a method was skipped, because it lacks a sensor or a vehicle parameter, is
    left out: that is not the method's failure, and an easier set of scenarios no merit. Each part
    comes with notes on what was left out.

    Each plan (a suite, a level, a recording, see `ranking.plans`) is a part of its own, and so
    are methods of one plan that share no scenario, not even by way of others. Being skipped in a
    scenario does not count as sharing it. A scenario in which fewer than half of the methods of a
    part were run is left out of it: a stray run moves nobody behind.

    Parameters
    ----------
    rows
        Frame as `gripbench.bench.running.rows.frame_of` returns it.
    target
        Signal that is estimated.
    allowed
        Instruments of the board; None: any.

    Raises
    ------
    InputError
        If no method estimates the target with these instruments, every run was skipped, or rows
        of a scenario come from two versions of it.
    """
    lines = rows[rows["target"] == target]
    if allowed is not None:
        fits = {c: set(instruments(c)) <= set(allowed) for c in lines["sensors"].unique()}
        lines = lines[lines["sensors"].map(fits).astype(bool)]
    if lines.empty:
        raise InputError(f"{target}: no method estimates it with these instruments")
    ran = lines[lines["status"] != "skipped"]
    if ran.empty:
        raise InputError(f"{target}: every run was skipped")
    _check_worlds(ran, target)
    homes = ran.groupby("label")["scenario"].agg(set)
    plans: dict[str, set[str]] = {}
    for name in ran["scenario"].unique():
        plans.setdefault(plan_of(str(name)), set()).add(str(name))
    parts = []
    for plan, members in sorted(plans.items()):
        inside = (home & members for home in homes if home & members)
        for scenarios in _connected(inside):
            part = lines[lines["scenario"].isin(scenarios)]
            # what is at home in another part is a stranger here
            elsewhere = {label for label, home in homes.items() if not home & scenarios}
            if plan.startswith(PREFIX):  # what lacks the one drive's sensors has no place there
                elsewhere |= set(part["label"]) - set(homes.index)
            part = part[~part["label"].isin(elsewhere)]
            part, strays = _without_strays(part)
            part, notes = _where_all_run(part, set(homes.index))
            _check_salts(part, target)
            parts.append((part, [*strays, *notes]))
    return parts


def _check_worlds(ran: pd.DataFrame, target: str) -> None:
    """Raise InputError where rows of one scenario come from two versions of it."""
    for scenario, part in ran[ran["status"] == "ok"].groupby("scenario"):
        worlds = {str(world): sorted(set(rows["label"])) for world, rows in part.groupby("world")}
        if len(worlds) > 1:
            groups = sorted(worlds.values(), key=len)
            _check_salts(part, target)
            raise InputError(
                f"{target}: rows of '{scenario}' come from {len(worlds)} versions of the scenario "
                f"or of the scoring ({groups[0][0]} has another one than {groups[-1][0]}); run it "
                "again for all of them: 'gripbench run' replaces what is out of date"
            )


def salts_of(rows: pd.DataFrame) -> list[str]:
    """Return the digests of the secrets that rows were drawn with; a frame of old rows has none."""
    return sorted(set(rows["salt"])) if "salt" in rows else []


def _check_salts(part: pd.DataFrame, target: str) -> None:
    """Raise InputError where drives of a board were not all drawn with one secret, or none."""
    salts = salts_of(part[part["status"] != "skipped"])
    if len(salts) > 1:
        one, other = (part[part["salt"] == salt].iloc[0] for salt in (salts[0], salts[-1]))
        raise InputError(
            f"{target}: '{one['label']}' on '{one['scenario']}' and '{other['label']}' on "
            f"'{other['scenario']}' were not drawn with the same secret (GRIPBENCH_SALT); rank "
            "them apart, or run one of them again"
        )


def _without_strays(part: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """Leave out scenarios in which fewer than half of the methods were run."""
    tried = part[~part["baseline"].astype(bool)].groupby("scenario")["label"].nunique()
    everyone = part.loc[~part["baseline"].astype(bool), "label"].nunique()
    strays = sorted(name for name in tried.index if 2 * tried[name] < everyone)
    left_out = [
        f"Left out: {name}, in which {tried[name]} of {everyone} methods ran." for name in strays
    ]
    return part[~part["scenario"].isin(strays)], left_out


def _where_all_run(part: pd.DataFrame, ran: set[str]) -> tuple[pd.DataFrame, list[str]]:
    """Leave out the scenarios in which a method was skipped that ran elsewhere.

    A baseline that was skipped somewhere goes itself: it takes no scenario away from the others.
    """
    blind = part["baseline"].astype(bool) & (part["status"] == "skipped")
    rest = part[~part["label"].isin(part.loc[blind, "label"])]
    part = part if rest.empty else rest
    skipped = part[(part["status"] == "skipped") & part["label"].isin(ran)]
    left_out = sorted(skipped["scenario"].unique())
    rest = part[~part["scenario"].isin(left_out)]
    if not left_out:
        return part, []
    if rest.empty:
        return part, ["No scenario gives every method what it needs: skipped runs count as failed."]
    return rest, [f"Left out, as not every method can run there: {', '.join(left_out)}."]


def _connected(groups: Iterable[set[str]]) -> list[set[str]]:
    """Return the unions of the groups that overlap, directly or by way of others."""
    unions: list[set[str]] = []
    for group in groups:
        apart = [union for union in unions if not union & group]
        joined = set(group).union(*(union for union in unions if union & group))
        unions = [*apart, joined]
    return sorted(unions, key=min)


def grid_of(
    lines: pd.DataFrame, target: str, notes: Iterable[str] = (), measure: Measure = RMS
) -> Grid:
    """Return the common runs of the methods of a board.

    Parameters
    ----------
    lines
        Rows of a board, one of the parts that `on_board` returns.
    target
        Signal that is estimated.
    notes
        What was left out already.
    measure
        What is compared.

    Raises
    ------
    InputError
        If a run occurs twice, or the methods have no seed in common.
    """
    twice = lines.duplicated(["scenario", "label", "seed"])
    if twice.any():
        first = lines[twice].iloc[0]
        raise InputError(
            f"{target}: '{first['label']}' has two rows for seed {first['seed']} of "
            f"'{first['scenario']}'"
        )
    common, more_notes = _common_seeds(lines, target)
    repeated = sorted(name for name, seeds in common.items() if len(seeds) > 1)
    seeds = _over_scenarios({name: common[name] for name in repeated}, target)
    single = sorted(set(common) - set(repeated))
    kept = {name: set(seeds) if name in repeated else common[name] for name in common}
    inside = [
        seed in kept[name] for name, seed in zip(lines["scenario"], lines["seed"], strict=True)
    ]
    lines = lines[inside].sort_values(["label", "scenario", "seed"], ignore_index=True)
    cells = len(repeated) * len(seeds) + len(single)
    good = (lines["status"] == "ok").groupby(lines["label"]).sum()
    labels = tuple(str(label) for label in good.index[good == cells])
    incomplete = {str(label): int(cells - n) for label, n in good.items() if n < cells}
    tables = _Tables(lines[lines["label"].isin(labels)], labels)
    return Grid(
        target=target,
        labels=labels,
        incomplete=incomplete,
        scenarios=tuple(repeated),
        seeds=seeds,
        single=tuple(single),
        rows=lines,
        totals=tables.of(measure.total, repeated, len(seeds)),
        counts=tables.of(measure.count, repeated, len(seeds)),
        single_values=tables.of(measure.name, single, 1)[:, 0, :],
        notes=(*notes, *more_notes),
        measure=measure,
    )


class _Tables:
    """Columns of a sorted frame as arrays (scenarios, seeds, labels)."""

    def __init__(self, lines: pd.DataFrame, labels: tuple[str, ...]) -> None:
        self._lines, self._labels = lines, labels

    def of(self, column: str, scenarios: list[str], seeds: int) -> npt.NDArray[np.float64]:
        part = self._lines[self._lines["scenario"].isin(scenarios)]
        values = part[column].to_numpy(float).reshape(len(self._labels), len(scenarios), seeds)
        return np.ascontiguousarray(values.transpose(1, 2, 0))


def _common_seeds(lines: pd.DataFrame, target: str) -> tuple[dict[str, set[int]], list[str]]:
    """Return the seeds that all methods have, by scenario, and what that leaves out."""
    common: dict[str, set[int]] = {}
    notes = []
    everyone = set(lines["label"])
    for scenario, part in lines.groupby("scenario"):
        seeds = {str(label): set(group["seed"]) for label, group in part.groupby("label")}
        shared = set.intersection(*seeds.values())
        fewest = min(seeds, key=lambda label: len(seeds[label]))
        if not shared:
            raise InputError(
                f"{target}: the methods have no seed of '{scenario}' in common; "
                f"run '{fewest}' with the seeds of the others"
            )
        common[str(scenario)] = shared
        most = max(map(len, seeds.values()))
        if len(shared) < most:
            notes.append(
                f"{scenario}: {len(shared)} of up to {most} seeds are common to all methods "
                f"('{fewest}' has {len(seeds[fewest])})."
            )
        notes += [f"{label} was not run in {scenario}." for label in sorted(everyone - set(seeds))]
    return common, notes


def _over_scenarios(common: dict[str, set[int]], target: str) -> tuple[int, ...]:
    if not common:
        return ()
    shared = set.intersection(*common.values())
    if not shared:
        names = ", ".join(common)
        raise InputError(f"{target}: the scenarios have no seed in common: {names}")
    return tuple(sorted(shared))
