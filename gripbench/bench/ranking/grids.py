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
    sums_of_squares, counts
        Of the complete methods, shape (scenarios, seeds, labels).
    single_rms
        RMS of the complete methods in the single runs, shape (single, labels).
    notes
        What was left out, one sentence each.
    """

    target: str
    labels: tuple[str, ...]
    incomplete: dict[str, int]
    scenarios: tuple[str, ...]
    seeds: tuple[int, ...]
    single: tuple[str, ...]
    rows: pd.DataFrame
    sums_of_squares: npt.NDArray[np.float64]
    counts: npt.NDArray[np.float64]
    single_rms: npt.NDArray[np.float64]
    notes: tuple[str, ...]

    @property
    def cells(self) -> int:
        """Number of runs of each method."""
        return len(self.scenarios) * len(self.seeds) + len(self.single)


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
    """Return the different sets of instruments that the methods of these rows read."""
    found = {instruments(channels) for channels in rows["sensors"].unique()}
    return sorted(found, key=lambda names: (len(names), names))


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

    Methods that share no scenario, not even by way of others, come in different parts: those of
    a longitudinal and of a lateral suite that estimate the same signal, say. Being skipped in a
    scenario does not count as sharing it. Each recording of a real vehicle is a part of its own:
    its runs are windows of one drive, which have no counterpart in another scenario.

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
        If no method estimates the target with these instruments, or every run was skipped.
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
    homes = ran.groupby("label")["scenario"].agg(set)
    real = {name for name in ran["scenario"].unique() if name.startswith(PREFIX)}
    simulated = _connected(home - real for home in homes if home - real)
    parts = []
    for scenarios in [*simulated, *({name} for name in sorted(real))]:
        part = lines[lines["scenario"].isin(scenarios)]
        # what is at home in another part is a stranger here
        elsewhere = {label for label, home in homes.items() if not home & scenarios}
        if scenarios <= real:  # what lacks the sensors of the one drive has no place on its board
            elsewhere |= set(part["label"]) - set(homes.index)
        parts.append(_where_all_run(part[~part["label"].isin(elsewhere)], set(homes.index)))
    return parts


def _where_all_run(part: pd.DataFrame, ran: set[str]) -> tuple[pd.DataFrame, list[str]]:
    """Leave out the scenarios in which a method was skipped that ran elsewhere."""
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


def grid_of(lines: pd.DataFrame, target: str, notes: Iterable[str] = ()) -> Grid:
    """Return the common runs of the methods of a board.

    Parameters
    ----------
    lines
        Rows of a board, one of the parts that `on_board` returns.
    target
        Signal that is estimated.
    notes
        What was left out already.

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
        sums_of_squares=tables.of("sum_of_squares", repeated, len(seeds)),
        counts=tables.of("count", repeated, len(seeds)),
        single_rms=tables.of("rms", single, 1)[:, 0, :],
        notes=(*notes, *more_notes),
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
