"""A method and a recording in, its settings tuned on the training windows out, each method alike.

Every method gets the same budget of trials: half of them spread over the ranges that its parameters
declare (Sobol points), half of them a simplex search (Nelder & Mead) from the best of these. The
test windows are not looked at. Switches, whole numbers, choices and parameters without a finite
range stay as they are, and so does what is fixed.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.catalogue.registry import MethodSpec, choose_method
from gripbench.bench.catalogue.training import Training
from gripbench.bench.running.estimating import Estimates, estimating
from gripbench.bench.running.execution import SkippedError, missing
from gripbench.bench.running.isolation.limits import CellFailure, Limits
from gripbench.bench.running.recorded_logs import imported_of
from gripbench.bench.running.recorded_scenarios import judged
from gripbench.bench.scoring.scoring import DivergedError, at_lag
from gripbench.envs.recordings import Recording
from gripbench.envs.signals import signal
from gripbench.errors import InputError
from gripbench.logs.vehicle.identification import inside
from gripbench.writing import write_atomically

BUDGET = 60
"""Trials of each method beside its settings as they are."""

NOISE_LEVELS = ("_noise", "_walk", "_std", "_density")
"""Endings of the parameters that are noise levels."""

_WIDE = 10.0  # ratio of a range's ends from which it is searched by its logarithm

Floats = npt.NDArray[np.float64]
Ranges = Mapping[str, tuple[float, float, float]]


@dataclass(frozen=True)
class Tuned:
    """The best settings found, and how.

    Attributes
    ----------
    method
        Choice that was tuned.
    target
        The signal whose error counted.
    settings
        Parameters that were set, the fixed ones included.
    before, after
        RMS error on the training windows with the settings before and after, SI units.
    draws
        How many settings were tried.
    recording
        Name of the recording, or what the drives are called.
    windows
        Training windows [s] on the log's clock, by run.
    undetermined
        Parameters that ended at an end of their range: the drives do not bound them.
    training, seconds
        Of simulated drives, which, and how long the search took [s].
    """

    method: str
    target: str
    settings: dict[str, float]
    before: float
    after: float
    draws: int
    recording: str = ""
    windows: tuple[tuple[float, float], ...] = ()
    undetermined: tuple[str, ...] = field(default=())
    training: Training | None = None
    seconds: float = 0.0


def searched(method: str, fixed: Mapping[str, Any] = {}) -> Ranges:
    """Return low end, value and high end of each parameter that a search may change, by name."""
    ranges = choose_method(method).declaration.ranges
    return {name: ends for name, ends in ranges.items() if name not in fixed}


@dataclass(frozen=True)
class Found:
    """What a search found.

    Attributes
    ----------
    settings
        Parameters that are better than the present ones; empty: none are.
    before, after
        Error with the settings before and after.
    undetermined
        Parameters that ended at an end of their range.
    """

    settings: dict[str, float]
    before: float
    after: float
    undetermined: tuple[str, ...]


def search(
    name: str,
    ranges: Ranges,
    error_of: Callable[[Mapping[str, float]], float],
    draws: int,
    seed: int = 0,
) -> Found:
    """Look for the settings with the smallest error.

    Parameters
    ----------
    name
        The method; the draws depend on it and the seed only.
    ranges
        Low end, present value and high end of each parameter.
    error_of
        Returns the error of a method with some settings; infinite where it fails.
    draws
        Settings to try beside the present ones.
    seed
        Of the draws.
    """
    from scipy.optimize import minimize
    from scipy.stats import qmc

    scale = _Scale(ranges)
    before = error_of({})
    best: tuple[float, Floats] = (before, scale.start)
    failed = 1e6 * (1.0 + (before if np.isfinite(before) else 1.0))

    def error(point: Floats) -> float:
        nonlocal best
        found = error_of(scale.settings(np.clip(point, 0.0, 1.0)))
        if found < best[0]:
            best = found, np.clip(point, 0.0, 1.0)
        return found if np.isfinite(found) else failed

    spread = (draws + 1) // 2
    random = np.random.default_rng([seed, zlib.crc32(name.encode())])
    points = qmc.Sobol(len(ranges), rng=random).random(1 << (spread - 1).bit_length())
    for point in points[:spread]:
        error(point)
    if draws > spread:
        minimize(
            error, best[1], method="Nelder-Mead", bounds=[(0.0, 1.0)] * len(ranges),
            options={"maxfev": draws - spread, "initial_simplex": _simplex(best[1])},
        )  # fmt: skip
    after, point = best
    if not after < before:
        return Found({}, before, before, ())
    ends = [name for name, at in zip(ranges, point, strict=True) if at < 0.01 or at > 0.99]
    return Found(scale.settings(point), before, after, tuple(ends))


def tune(
    method: str,
    recordings: Sequence[Recording],
    target: str,
    fixed: dict[str, float] | None = None,
    draws: int = BUDGET,
    seed: int = 0,
) -> Tuned:
    """Tune a method for one target.

    Parameters
    ----------
    method
        Choice as `choose_method` takes it.
    recordings
        Runs of a recording with a window `train`.
    target
        The signal whose error counts.
    fixed
        Settings that are known and not searched.
    draws
        Settings to try beside the present ones.
    seed
        Of the draws; they depend on it and the method's name only.

    Raises
    ------
    InputError
        If there is no training window, or the method has nothing to tune or cannot run.
    """
    name = recordings[0].scenario
    training = [one for one in recordings if one.windows.get("train")]
    if not training:
        raise InputError(f"{name}: has no window 'train' to tune on")
    known = dict(fixed or {})
    ranges = searched(method, known)
    if not ranges:
        raise InputError(f"{method}: has no parameter with a range to tune")

    def error_of(chosen: Mapping[str, float]) -> float:
        try:
            tried = choose_method(method, parameters={**known, **chosen})
            return training_error(tried, training, target)
        except DivergedError:
            if not chosen:
                raise
            return np.inf

    found = search(method, ranges, error_of, draws, seed)
    windows = tuple(
        (start + one.notes.get("time_origin", 0.0), end + one.notes.get("time_origin", 0.0))
        for one in training
        for start, end in one.windows["train"]
    )
    return Tuned(
        method, target, known | found.settings, found.before, found.after, draws, name, windows,
        found.undetermined,
    )  # fmt: skip


def training_error(spec: MethodSpec, recordings: Sequence[Recording], target: str) -> float:
    """Return a method's RMS error [SI] over all training windows.

    Raises
    ------
    InputError
        If it cannot run or nothing is known of the target there.
    DivergedError
        If an estimate is not finite.
    """
    declaration = spec.declaration
    if target not in declaration.estimates:
        raise InputError(
            f"{spec.label}: does not estimate '{target}' but {', '.join(declaration.estimates)}"
        )
    with estimating(spec, Limits()) as run:
        total, count = _summed(spec, run, recordings, target)
    if not count:
        raise InputError(f"{spec.label}: nothing is known of '{target}' on the training windows")
    return float(np.sqrt(total / count))


def _summed(
    spec: MethodSpec, run: Estimates, recordings: Sequence[Recording], target: str
) -> tuple[float, int]:
    """Return the sum of squared errors over all training windows, and the number of samples."""
    declaration = spec.declaration
    total, count = 0.0, 0
    for recording in recordings:
        reason = missing(declaration, recording.vehicle, recording.observations.dtype.names or ())
        if reason:
            raise InputError(f"{spec.label}: {reason}")
        last = max(end for _, end in recording.windows["train"])
        kept = int(np.searchsorted(recording.truth["time"], last, side="right"))
        part = at_lag(cut(recording, kept), declaration.lag)
        try:
            estimates = run(part.vehicle, part.observations)
        except (SkippedError, CellFailure) as error:
            raise InputError(f"{spec.label}: {error}") from None
        estimate = estimates[target]
        if not np.isfinite(estimate).all():
            raise DivergedError(f"{target} is not finite")
        truth = judged(part, estimates).truth
        if target not in (truth.dtype.names or ()):
            known = [name for name in declaration.estimates if name in (truth.dtype.names or ())]
            raise InputError(
                f"{spec.label}: nothing is known of '{target}' on the training windows; known is "
                f"{', '.join(known) or 'nothing that it estimates'}"
            )
        counted = inside(part, "train") & np.isfinite(truth[target])
        difference = estimate[counted] - truth[target][counted]
        total += float(difference @ difference)
        count += len(difference)
    return total, count


def cut(recording: Recording, rows: int) -> Recording:
    """Return the first rows of a recording, with a place for each signal that has bounds."""
    from dataclasses import replace

    from gripbench.envs.signals import record_type

    truth = recording.truth[:rows]
    names = list(truth.dtype.names or ())
    bounded = [one.signal for one in recording.bounds if one.signal not in names]
    if bounded:
        wider = np.empty(rows, record_type([*names, *dict.fromkeys(bounded)]))
        for name in names:
            wider[name] = truth[name]
        for name in bounded:
            wider[name] = np.nan
        truth = wider
    return replace(recording, observations=recording.observations[:rows], truth=truth)


class _Scale:
    """Parameters to points of the unit cube and back; wide ranges by their logarithm."""

    def __init__(self, ranges: Ranges) -> None:
        self.names = list(ranges)
        self.low, start, self.high = np.array(list(ranges.values())).T
        lowest = np.where(self.low > 0.0, self.low, 1e-4 * np.abs(start))
        self.wide = (self.low >= 0.0) & (lowest > 0.0) & (self.high > _WIDE * lowest)
        self.low = np.where(self.wide, lowest, self.low)
        self.start = self.unit(start)

    def unit(self, values: Floats) -> Floats:
        """Return values as a point of the unit cube."""
        low, high, at = (self._scaled(each) for each in (self.low, self.high, values))
        return np.clip((at - low) / (high - low), 0.0, 1.0)

    def settings(self, point: Floats) -> dict[str, float]:
        """Return the values at a point, rounded to five digits as a file shows them."""
        low, high = self._scaled(self.low), self._scaled(self.high)
        at = low + point * (high - low)
        values = np.where(self.wide, np.exp(np.where(self.wide, at, 0.0)), at)
        values = np.clip([float(f"{value:.5g}") for value in values], self.low, self.high)
        return dict(zip(self.names, values.tolist(), strict=True))

    def _scaled(self, values: Floats) -> Floats:
        return np.where(
            self.wide, np.log(np.where(self.wide, np.maximum(values, 1e-300), 1.0)), values
        )


def _simplex(start: Floats) -> Floats:
    """Return a simplex around a point of the unit cube, inside of it."""
    steps = np.where(start > 0.5, -0.1, 0.1)
    return np.vstack([start, start + np.diag(steps)])


def tune_recording(place: str, method: str, target: str, draws: int = BUDGET) -> Tuned:
    """Tune a method on a recording; settings of its map that are no noise level stay.

    Parameters
    ----------
    place
        Name, folder or map of the recording, see `recorded_scenarios.recorded_scenario`.
    method, target, draws
        See `tune`.
    """
    imported = imported_of(place)
    settings = imported.provenance.channel_map.get("settings", {})
    known = settings.get(method.partition(":")[0], {})
    fixed = {key: value for key, value in known.items() if not key.endswith(NOISE_LEVELS)}
    return tune(method, imported.recordings, target, fixed, draws)


def settings_text(tuned: Tuned) -> str:
    """Return the settings as the lines of a channel map."""
    lines = [f"[settings.{tuned.method.partition(':')[0]}]"]
    for key, value in tuned.settings.items():
        shown = f"{value:.5g}" if isinstance(value, float) else json.dumps(value)
        lines.append(f"{key} = {shown}")
    return "\n".join(lines)


def variant_name(tuned: Tuned) -> str:
    """Return the name of the variant that a recording's tuning makes."""
    return f"tuned_{tuned.recording}_{tuned.target}"


def write_variant(tuned: Tuned, path: Path) -> None:
    """Write the settings as a variant with its record: `--method FILE.toml` chooses it."""
    unit = signal(tuned.target).unit
    drives = (
        [f'recording = "{tuned.recording}"', f"windows = {[list(one) for one in tuned.windows]}"]
        if tuned.training is None
        else [f"seconds = {tuned.seconds:.6g}"]
    )
    lines = [
        f"method = {json.dumps(tuned.method)}",
        f'name = "{variant_name(tuned)}"',
        "",
        "[settings]",
        *(f"{key} = {json.dumps(value)}" for key, value in tuned.settings.items()),
        "",
        "[record]",
        f'target = "{tuned.target}"',
        *drives,
        f"trials = {tuned.draws}",
        f'unit = "{unit}"',
        f"before = {tuned.before:.6g}",
        f"after = {tuned.after:.6g}",
        f"at_an_end_of_its_range = {json.dumps(tuned.undetermined)}",
    ]
    if tuned.training is not None:
        said = tuned.training.model_dump(mode="json")
        lines += ["", "[record.training]", *(f"{key} = {json.dumps(said[key])}" for key in said)]
    write_atomically(path, "\n".join(lines) + "\n")
