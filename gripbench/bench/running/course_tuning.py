"""A method and training drives of populations in, its settings tuned on them out.

Every method gets the same drives and the same number of trials. What counts is what a board ranks
by: the geometric mean over the scenarios of the RMS error pooled over the drives of each.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gripbench.bench.catalogue.registry import MethodSpec, choose_method
from gripbench.bench.catalogue.training import TRAINING_SEEDS, Training
from gripbench.bench.running.courses import course_of
from gripbench.bench.running.estimating import estimating
from gripbench.bench.running.execution import SkippedError
from gripbench.bench.running.fitting import fitted
from gripbench.bench.running.isolation.limits import CellFailure, Limits
from gripbench.bench.running.isolation.training_drives import TrainingDrive, training_drive
from gripbench.bench.running.tuning import BUDGET, Tuned, search
from gripbench.bench.scoring.scoring import EstimateError, on_branch
from gripbench.errors import InputError

EACH = 8
"""Drives of each scenario."""


def tune_on(
    method: str,
    names: Sequence[str],
    target: str,
    called: str = "",
    budget: int = BUDGET,
    each: int = EACH,
    limits: Limits | None = None,
) -> Tuned:
    """Tune a method, built in or not, for one target.

    Parameters
    ----------
    method
        Choice as `choose_method` takes it; settings in it are not searched.
    names
        Scenarios; their drives are at level 1, from seeds that no test may touch.
    target
        The signal whose error counts.
    called
        What to call the drives in the variant's name; by default the first scenario.
    budget
        Settings to try beside the present ones.
    each
        Drives of each scenario.
    limits
        What one drive of a method that is not built in may take.

    Raises
    ------
    InputError
        If the method has nothing to tune, does not estimate the target, or no drive serves it.
    """
    limits = limits or Limits()
    spec = choose_method(method)
    declaration = spec.declaration
    if target not in declaration.estimates:
        raise InputError(
            f"{spec.label}: does not estimate '{target}' but {', '.join(declaration.estimates)}"
        )
    ranges = {key: ends for key, ends in declaration.ranges.items() if key not in spec.parameters}
    if not ranges:
        raise InputError(f"{spec.label}: has no parameter with a range to tune")
    course = replace(course_of(names, Path(), each), first=_FIRST)
    drives = [training_drive(one, declaration) for one in course.recordings(declaration, target)]
    began = time.monotonic()

    def error_of(chosen: Mapping[str, float]) -> float:
        tried = choose_method(method, parameters=chosen)
        return _error(tried, drives, target, limits)

    found = search(method, ranges, error_of, budget)
    if not math.isfinite(found.before) and not math.isfinite(found.after):
        raise InputError(f"{spec.label}: fails on a drive with all settings that were tried")
    training = Training(
        how="tuned", on=course.name, seeds=course.seeds, drives=len(drives), budget=budget
    )
    settings = spec.parameters | found.settings
    return Tuned(
        method.partition("@")[0], target, settings, found.before, found.after, budget,
        called or course.scenarios[0].name.partition("@")[0], (), found.undetermined, training,
        time.monotonic() - began,
    )  # fmt: skip


_FIRST = TRAINING_SEEDS.start + len(TRAINING_SEEDS) // 2
"""First seed for tuning, far from those of fits: what was fitted is tuned on other drives."""


def _error(spec: MethodSpec, drives: Sequence[TrainingDrive], target: str, limits: Limits) -> float:
    """Return the error of a method over all drives; infinite where it fails on one."""
    spec = fitted(spec, None, limits)
    if spec.unfitted:
        return math.inf
    totals: dict[str, list[float]] = {}
    with estimating(spec, limits) as run:
        for drive in drives:
            try:
                estimate = run(drive.vehicle, drive.observations)[target]
            except (CellFailure, SkippedError, EstimateError):
                return math.inf
            truth = drive.truth[target]
            counted = (drive.truth["time"] >= drive.score_from) & np.isfinite(truth)
            error = on_branch(target, estimate[counted], truth[counted]) - truth[counted]
            total = float(error @ error)
            if not math.isfinite(total):
                return math.inf
            sums = totals.setdefault(drive.scenario, [0.0, 0.0])
            sums[0] += total
            sums[1] += len(error)
    logs = [0.5 * math.log(max(total, 1e-300) / count) for total, count in totals.values() if count]
    return math.exp(math.fsum(logs) / len(logs)) if logs else math.inf
