"""Sensitivity: from methods, scenarios and causes to the error at each size of one cause alone.

One cause at a time leaves its value on paper, everything else stays there (level 0, ideal
instruments); every method meets the same recordings. A cause `paper.NAME` leaves the plant
untouched and hands methods a wrong vehicle parameter instead. The breaking point is the smallest
error at which the best baseline that reads no other channels overtakes the method.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from gripbench.bench.catalogue.registry import (
    MethodSpec,
    built_in_methods,
    choose_method,
)
from gripbench.bench.catalogue.suites import load_suite
from gripbench.bench.running.cells import cell_of, close_sandboxes, run_cell
from gripbench.bench.running.forms import runnable
from gripbench.bench.running.isolation.limits import Limits
from gripbench.bench.running.recorded_scenarios import RecordedScenario, on_recording, scored_runs
from gripbench.envs.populations.causes import CAUSES, PROCESSES, SHAPES_OF_TYRES, SIDES
from gripbench.envs.populations.population import load_population
from gripbench.envs.scenarios import Scenario
from gripbench.envs.vehicles import VEHICLE_PARAMETERS, CarOnPaper, load_vehicle
from gripbench.envs.worlds import at_level, record
from gripbench.errors import InputError, unknown

PAPER = "paper."
"""Prefix of the causes that are wrong on paper only."""

MULTIPLES = (-4.0, -2.0, -1.0, -0.5, -0.2, -0.05, 0.05, 0.2, 0.5, 1.0, 2.0, 4.0)
"""Sizes at which a cause is tried, over its range."""

RADIUS_CASE = 0.002
"""Relative error of the wheel radius on paper that is always printed: 0.7 mm of 0.35 m."""

_DEVIATIONS = 2.0  # a normal cause ranges so many standard deviations to each side
_PAPER_RANGE = {"wheel_radius": 0.01}  # wear and pressure; others: what data sheets leave open
_OTHER_PAPER_RANGE = 0.1


@dataclass(frozen=True)
class Range:
    """How far a cause reaches.

    Attributes
    ----------
    cause
        Name of a cause, or `paper.` and a vehicle parameter.
    unit
        Unit of its deviation.
    low, high
        Ends of its range: two standard deviations, or those of a uniform.
    """

    cause: str
    unit: str
    low: float
    high: float

    def at(self, multiple: float) -> float:
        """Return the deviation at a multiple of the range."""
        return multiple * self.high if multiple >= 0.0 else -multiple * self.low


def baselines(target: str, scenarios: Sequence[Scenario] = ()) -> tuple[MethodSpec, ...]:
    """Return the baselines that estimate a target, on recordings in the form that can run."""
    found = {
        name: choose_method(name)
        for name, method in built_in_methods().items()
        if getattr(method, "baseline", False) and target in method.estimates
    }
    for item in scenarios:
        if isinstance(item, RecordedScenario):
            fitting = runnable(scored_runs(item)[0], (target,))[0]
            found |= {name: spec for name, spec in fitting.items() if spec.declaration.baseline}
    return tuple(found.values())


def usual_methods(scenarios: Sequence[Scenario], suite: str, target: str) -> list[MethodSpec]:
    """Return the methods that estimate a target: of a suite, or those that recordings can run."""
    recorded = [item for item in scenarios if isinstance(item, RecordedScenario)]
    if recorded and len(recorded) == len(scenarios):
        fitting = runnable(scored_runs(recorded[0])[0], (target,))[0].values()
        return [spec for spec in fitting if not spec.declaration.baseline]
    specs = load_suite(suite).specs()
    return [spec for spec in specs if target in spec.declaration.estimates]


def ranges_of(
    scenarios: Sequence[Scenario], methods: Sequence[MethodSpec], chosen: Sequence[str] = ()
) -> list[Range]:
    """Return the causes of the scenarios' populations and what methods read on paper.

    Parameters
    ----------
    scenarios, methods
        What is run.
    chosen
        Only these causes; empty: all.

    Raises
    ------
    InputError
        If a cause is unknown, or the scenarios name no population.
    """
    found: dict[str, Range] = {}
    names = {name for method in methods for name in method.declaration.vehicle_parameters}
    given = {name for item in scenarios for name in _on_paper(item)}
    for name in VEHICLE_PARAMETERS:
        if name in names & given:
            size = _PAPER_RANGE.get(name, _OTHER_PAPER_RANGE)
            found[PAPER + name] = Range(PAPER + name, "relative", -size, size)
    driven = [item for item in scenarios if not isinstance(item, RecordedScenario)]
    for population in dict.fromkeys(item.population for item in driven):
        if not population:
            raise InputError(
                f"{driven[0].name}: key 'population' is missing, so no cause has a range"
            )
        for name, spread in load_population(population).spreads.items():
            if name in found or name in (SHAPES_OF_TYRES, SIDES):
                continue
            size = _DEVIATIONS * spread.std
            low, high = (-size, size) if spread.std > 0.0 else (spread.low, spread.high)
            if name in PROCESSES:
                low = 0.0
            if high > low:
                unit = CAUSES[name].unit
                found[name] = Range(name, unit, low + spread.centre, high + spread.centre)
    for name in chosen:
        if name not in found:
            if not driven and name in CAUSES:
                raise InputError(
                    f"cause '{name}': the car, road and sensors of a recording are what they were; "
                    f"only what methods are told of the car can differ: {', '.join(found)}"
                )
            raise unknown("cause", name, found)
    return [item for name, item in found.items() if not chosen or name in chosen]


def _on_paper(scenario: Scenario) -> Iterable[str]:
    """Return the vehicle parameters that methods are told of."""
    if isinstance(scenario, RecordedScenario):
        return scored_runs(scenario)[0].vehicle
    return load_vehicle(scenario.vehicle).parameters


def sensitivity(
    scenarios: Sequence[Scenario],
    methods: Sequence[MethodSpec],
    target: str,
    ranges: Sequence[Range],
    seeds: Iterable[int] = (0,),
    workers: int = 1,
) -> pd.DataFrame:
    """Return the pooled RMS error at each size of each cause.

    Parameters
    ----------
    scenarios
        What is driven; their levels are set to 0. Of a recording it is the whole test time.
    methods
        What is tried; the baselines of the target come on top.
    target
        Signal whose error counts.
    ranges
        Causes.
    seeds
        Seeds of the simulated runs.
    workers
        Processes; 0: one a core.

    Returns
    -------
    One line for each method, cause and multiple: `label, baseline, sensors, cause, unit, multiple,
    deviation, rms`. RMS is NaN where a method could not run, the car would be none, or the cause
    has no effect and was not tried further.
    """
    import joblib

    labels = {spec.label for spec in methods}
    trivial = baselines(target, scenarios)
    specs = [*methods, *(spec for spec in trivial if spec.label not in labels)]
    runs = [run for item in scenarios for run in _runs(item, seeds)]
    sums: _Sums = {}
    with joblib.Parallel(n_jobs=workers or -1) as parallel:

        def add(sizes: dict[Range, tuple[float, ...]]) -> None:
            jobs = [(item, seed, each) for item, seed in runs for each in sizes.items()]
            call = joblib.delayed(_measure)
            for part in parallel(
                call(item, seed, *each, specs, target) for item, seed, each in jobs
            ):
                for key, (total, count) in part.items():
                    held = sums.get(key, (0.0, 0, 0))
                    sums[key] = held[0] + total, held[1] + count, held[2] + 1

        add({_NOTHING: (0.0,)})
        add({given: tuple(size for size in _sizes(given) if abs(size) == 1.0) for given in ranges})
        moved = [given for given in ranges if _moves(sums, given)]
        add({given: tuple(size for size in _sizes(given) if abs(size) != 1.0) for given in moved})
    lines = []
    for spec in specs:
        for given in ranges:
            for size in sorted((0.0, *_sizes(given))):
                common = {
                    "label": spec.label,
                    "baseline": spec in trivial,
                    "sensors": " ".join(spec.declaration.sensors),
                    "cause": given.cause,
                    "unit": given.unit,
                    "multiple": size,
                    "deviation": given.at(size),
                }
                lines.append(common | {"rms": _rms(sums, spec.label, given, size)})
    return pd.DataFrame(lines)


def _runs(scenario: Scenario, seeds: Iterable[int]) -> list[tuple[Scenario, int]]:
    """Return the runs of a scenario without spread; of a recording those of the log."""
    if isinstance(scenario, RecordedScenario):
        return [(scenario, run) for run in range(len(scored_runs(scenario)))]
    plain = at_level(scenario, 0)
    return [(plain, seed) for seed in seeds]


_Sums = dict[tuple[str, str, float], tuple[float, int, int]]
"""Sum of squares, count and number of runs by label, cause and multiple."""

_NOTHING = Range("", "", 0.0, 0.0)

_NO_EFFECT = 0.01  # relative change of an RMS at both ends below which no more is tried


def _rms(sums: _Sums, label: str, given: Range, size: float) -> float:
    """Return the pooled RMS; NaN unless every run that succeeds without error does here, too."""
    nominal = sums.get((label, "", 0.0), (0.0, 0, 0))
    total, count, runs = sums.get((label, given.cause if size else "", size), (0.0, 0, 0))
    return math.sqrt(total / count) if count and runs == nominal[2] else math.nan


def _moves(sums: _Sums, given: Range) -> bool:
    """Return whether an end of a cause's range changes the error of any method."""
    for label in {label for label, _, _ in sums}:
        nominal = _rms(sums, label, given, 0.0)
        for size in (-1.0, 1.0):
            if (label, given.cause, size) in sums:
                found = _rms(sums, label, given, size)
                if not abs(found - nominal) <= _NO_EFFECT * nominal:
                    return True
    return False


def _sizes(given: Range) -> tuple[float, ...]:
    """Return the multiples of its range at which a cause is tried, besides none."""
    return tuple(one for one in MULTIPLES if given.low < 0.0 or one > 0.0)


def _measure(
    scenario: Scenario,
    seed: int,
    given: Range,
    sizes: Sequence[float],
    specs: Sequence[MethodSpec],
    target: str,
) -> dict[tuple[str, str, float], tuple[float, int]]:
    """Return sum of squares and count by label, cause and multiple, in runs of one seed."""
    found = {}
    on_paper = given.cause.startswith(PAPER)
    plain = None
    if isinstance(scenario, RecordedScenario):
        plain = scored_runs(scenario)[seed]
        specs = [on_recording(spec, scenario) for spec in specs]
    elif on_paper or not given.cause:
        plain = record(scenario, seed)
    for size in sizes:
        recording = plain
        if on_paper and plain is not None:
            name = given.cause.removeprefix(PAPER)
            if name in plain.vehicle:
                paper = CarOnPaper(plain.vehicle)
                paper[name] *= 1.0 + given.at(size)
                recording = replace(plain, vehicle=paper)
        elif plain is None:
            try:
                recording = record(scenario, seed, changes={given.cause: given.at(size)})
            except InputError:
                if abs(size) <= 1.0:
                    raise  # a population's own range holds cars only
                continue  # no car, or no drive, so far beyond it
        assert recording is not None
        if target not in (recording.truth.dtype.names or ()):
            continue
        # without the rest of the truth nothing else is scored, which takes most of the time
        bare = replace(recording, truth=recording.truth[["time", target]])
        for spec in specs:
            row = run_cell(cell_of(scenario, seed, spec, ""), bare, Limits(), timed=False)
            scores = row.scores.get(target, {})
            if row.status == "ok" and "rms" in scores:
                value = scores["rms"]
                found[spec.label, given.cause, size] = value.total, value.count
    close_sandboxes()
    return found


def summary_of(frame: pd.DataFrame, label: str) -> pd.DataFrame:
    """Return the causes of one method, the worst first.

    Returns
    -------
    Columns `cause, unit, low, rms_low, high, rms_high, nominal, baseline, rms_baseline,
    breaking_low, breaking_high`: RMS at both ends of the range and without error, the best
    baseline of the same sensors there, and the errors at which that overtakes (NaN: not within
    four times the range; 0: it is ahead without any).
    """
    own = frame[frame["label"] == label]
    if own.empty:
        raise unknown("method", label, frame["label"].unique())
    rivals = _rivals(frame, set(own["sensors"].iloc[0].split()))
    lines = []
    for cause, part in own.groupby("cause", sort=False):
        curve = part.set_index("multiple")
        best = rivals[rivals["cause"] == cause].set_index(["label", "multiple"])["rms"]
        floor = best.unstack("label").min(axis=1) if len(best) else pd.Series(dtype=float)
        floor = floor.reindex(curve.index)
        ratio = pd.Series(np.log(curve["rms"] / floor), curve.index)
        names = best.xs(0.0, level="multiple") if len(best) else best
        at = curve["deviation"]
        lines.append(
            {
                "cause": cause,
                "unit": part["unit"].iloc[0],
                "low": at.get(-1.0, 0.0),
                "rms_low": curve["rms"].get(-1.0, math.nan),
                "high": at[1.0],
                "rms_high": curve["rms"][1.0],
                "nominal": curve["rms"][0.0],
                "baseline": names.idxmin() if names.notna().any() else "",
                "rms_baseline": names.min() if len(names) else math.nan,
                "breaking_low": _crossing(at.iloc[::-1], ratio.iloc[::-1], -1.0),
                "breaking_high": _crossing(at, ratio, 1.0),
            }
        )
    table = pd.DataFrame(lines)
    worst = table[["rms_low", "rms_high"]].max(axis=1)
    return table.iloc[worst.fillna(-1.0).argsort(kind="stable")[::-1]].reset_index(drop=True)


def _rivals(frame: pd.DataFrame, sensors: set[str]) -> pd.DataFrame:
    allowed = [set(text.split()) <= sensors for text in frame["sensors"]]
    return frame[frame["baseline"] & np.array(allowed, bool)]


def _crossing(at: pd.Series, ratio: pd.Series, side: float) -> float:
    """Return the deviation at which a log ratio first exceeds zero, from the centre outwards."""
    before: tuple[float, float] | None = None
    for multiple in ratio.index:
        if multiple * side < 0.0 or math.isnan(ratio[multiple]):
            continue
        here = float(at[multiple]), float(ratio[multiple])
        if here[1] > 0.0:
            if before is None or not math.isfinite(here[1]) or not math.isfinite(before[1]):
                return here[0]
            share = before[1] / (before[1] - here[1])
            return before[0] + share * (here[0] - before[0])
        before = here
    return math.nan


def breaking_table(frame: pd.DataFrame) -> pd.DataFrame:
    """Return the smallest breaking point of each method and cause, shape (methods, causes).

    As a share of the cause's range; inf: none within four times of it, NaN: no baseline to compare.
    """
    rows = {}
    for label in frame.loc[~frame["baseline"], "label"].unique():
        table = summary_of(frame, label).set_index("cause")
        shares = []
        for side, end in (("breaking_low", "low"), ("breaking_high", "high")):
            shares.append((table[side] / table[end]).where(table[side] != 0.0, 0.0).abs())
        nearest = pd.concat(shares, axis=1).min(axis=1, skipna=True)
        rows[label] = nearest.fillna(math.inf).where(table["rms_baseline"].notna())
    return pd.DataFrame(rows).T
