"""Every method on recordings of real vehicles, beside trivial estimators on the same windows.

A target with a reference is scored by the RMS of its error. Friction, which nothing measures, is
scored against the interval that is known: the mean estimate, and its mean distance from the
interval. Intervals of 95 % come from a bootstrap over blocks of time, for errors of neighbouring
samples are not independent.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gripbench.bench.catalogue.registry import MethodSpec, built_in_methods, choose_method
from gripbench.bench.running.execution import SkippedError, execute, missing
from gripbench.bench.running.yardsticks import YARDSTICKS
from gripbench.bench.scoring.metrics.utilisation import UTILISATION_BANDS
from gripbench.bench.scoring.scoring import DivergedError, score, targets_of
from gripbench.envs.recordings import Recording
from gripbench.errors import GripbenchError
from gripbench.logs.excitation import utilisation_bound
from gripbench.logs.importing import ImportedLog
from gripbench.logs.published import AbsentDataError, load_recording
from gripbench.logs.storing import load

Floats = npt.NDArray[np.float64]

TARGETS = ("sideslip", "yaw", "mu_used", "mu")
"""What is scored on a recording, in the order of the table."""

BLOCK = 2.0
"""Length [s] of the blocks of time that the bootstrap draws."""

FEWEST = 3
"""Blocks from which the bootstrap draws at least."""

RESAMPLES = 2000
"""Draws of the bootstrap."""

_ANGLES = ("sideslip", "yaw")


@dataclass(frozen=True)
class RecordedScore:
    """One estimator on one recording.

    Attributes
    ----------
    recording, target, estimator
        What was estimated, where, by which method or yardstick.
    kind
        `method` or `yardstick`.
    status, reason
        `ok`, or why there is no figure.
    measure
        `RMS error`, or `mean` for a target that only an interval is known of.
    unit
        Unit of the figures: degrees for angles.
    value, low, high
        The figure with its 95 % interval.
    outside
        Mean distance from the known interval, for `mean`.
    samples
        Samples that count.
    excitation
        Band of utilisation, of `UTILISATION_BANDS`, that these samples have; empty: all.
    """

    recording: str
    target: str
    estimator: str
    kind: str
    status: str
    reason: str = ""
    measure: str = ""
    unit: str = ""
    value: float | None = None
    low: float | None = None
    high: float | None = None
    outside: float | None = None
    samples: int = 0
    excitation: str = ""


def published_methods(imported: ImportedLog, methods: Sequence[str] = ()) -> list[MethodSpec]:
    """Return methods with the settings that a recording's map has for them.

    Parameters
    ----------
    imported
        The recording.
    methods
        Choices of methods, `name[:variant][@parameter=value,...]`, whose own settings come first;
        by default every built-in.
    """
    settings = imported.provenance.channel_map.get("settings", {})
    found = []
    for method in methods or list(built_in_methods()):
        plain = choose_method(method)
        local = settings.get(plain.declaration.name, {}) | plain.parameters
        found.append(replace(choose_method(method, parameters=local), shown=plain.label))
    return found


def score_published(
    names: Iterable[str],
    methods: Sequence[str] = (),
    folder: Path | None = None,
    by_excitation: bool = False,
) -> list[RecordedScore]:
    """Score methods and yardsticks on published or imported recordings.

    Parameters
    ----------
    names
        Names of published recordings, one whose files are absent gives one row that says so; or
        folders that `gripbench import` has written.
    methods
        Choices of methods, `name[:variant]`; by default every built-in. Those that the
        recording's map has settings for get them.
    folder
        Where the files lie, see `gripbench.logs.locations`.
    by_excitation
        See `score_recordings`.
    """
    scores: list[RecordedScore] = []
    for name in names:
        try:
            imported = load(Path(name)) if Path(name).is_dir() else load_recording(name, folder)
        except AbsentDataError as error:
            scores.append(RecordedScore(name, "", "", "", "skipped", str(error)))
            continue
        chosen = published_methods(imported, methods)
        scores += score_recordings(imported.recordings, chosen, by_excitation)
    return scores


def score_recordings(
    recordings: Sequence[Recording], methods: Sequence[MethodSpec], by_excitation: bool = False
) -> list[RecordedScore]:
    """Score methods and yardsticks on the runs of one recording.

    Parameters
    ----------
    recordings
        Its runs.
    methods
        The methods; one that lacks a sensor or a parameter gives a row with the reason.
    by_excitation
        Whether each figure comes once for each band of the utilisation, see
        `gripbench.logs.excitation`, instead of once for all samples.
    """
    bands = tuple(name for name, _, _ in UTILISATION_BANDS) if by_excitation else ("",)
    found: list[RecordedScore] = []
    for target, yardsticks in YARDSTICKS.items():
        for name, estimate in yardsticks.items():
            series = [estimate(recording) for recording in recordings]
            if any(one is None for one in series):
                continue
            given = [s for s in series if s is not None]
            rows = [_scored(recordings, target, name, "yardstick", given, band) for band in bands]
            found += [row for row in rows if row is not None]
    for spec in methods:
        found += _of_method(recordings, spec, bands)
    order = {target: index for index, target in enumerate(TARGETS)}
    places = {band: index for index, band in enumerate(bands)}
    return sorted(
        found,
        key=lambda row: (order.get(row.target, len(order)), places.get(row.excitation, 0)),
    )


def _of_method(
    recordings: Sequence[Recording], spec: MethodSpec, bands: Sequence[str]
) -> list[RecordedScore]:
    declaration = spec.declaration
    name = recordings[0].scenario
    estimated = [target for target in TARGETS if target in declaration.estimates]
    series: dict[str, list[Floats]] = {target: [] for target in estimated}
    for recording in recordings:
        channels = recording.observations.dtype.names or ()
        reason = missing(declaration, recording.vehicle, channels)
        status = "skipped"
        if not reason and estimated:
            try:
                period = float(np.median(np.diff(recording.observations["time"])))
                outcome = execute(
                    spec.make(), declaration, recording.vehicle, recording.observations,
                    period, False,
                )  # fmt: skip
                score(  # refuses what is not finite or not declared
                    outcome.estimates, declaration.outputs,
                    targets_of(declaration.estimates, recording), recording,
                )  # fmt: skip
                for target in estimated:
                    series[target].append(np.ascontiguousarray(outcome.estimates[target]))
                continue
            except DivergedError as error:
                reason, status = str(error), "diverged"
            except SkippedError as error:
                reason = str(error)
            except GripbenchError as error:
                reason, status = str(error), "failed"
        reason = reason or "estimates nothing that the recording has a reference for"
        return [RecordedScore(name, "", _label(spec), "method", status, reason)]
    rows = [
        _scored(recordings, target, _label(spec), "method", series[target], band)
        for target in estimated
        for band in bands
    ]
    kept = [row for row in rows if row is not None]
    reason = "the recording has no reference for any of its estimates"
    return kept or [RecordedScore(name, "", _label(spec), "method", "skipped", reason)]


def _label(spec: MethodSpec) -> str:
    """Return the method's name and variant; its settings are the recording's."""
    if spec.shown:
        return spec.shown
    name = spec.declaration.name
    return f"{name}:{spec.variant}" if spec.variant else name


def _scored(
    recordings: Sequence[Recording],
    target: str,
    name: str,
    kind: str,
    series: Sequence[Floats],
    band: str = "",
) -> RecordedScore | None:
    """Return the score over all runs, or None where nothing is known of the target."""
    bounded = [
        bound for recording in recordings for bound in recording.bounds if bound.signal == target
    ]
    parts: list[tuple[Floats, Floats]] = []
    outside: list[Floats] = []
    for recording, estimate in zip(recordings, series, strict=True):
        time = recording.truth["time"]
        inside = scored_samples(recording)
        if band:
            inside &= _in_band(recording, band)
        if bounded:
            for bound in (b for b in recording.bounds if b.signal == target):
                within = inside & (time >= bound.start) & (time <= bound.end)
                parts.append((time[within], estimate[within]))
                beyond = np.maximum(bound.low - estimate, estimate - bound.high)
                outside.append(np.maximum(beyond, 0.0)[within])
            continue
        if target not in (recording.truth.dtype.names or ()):
            return None
        truth = recording.truth[target]
        inside &= np.isfinite(truth)
        error = estimate[inside] - truth[inside]
        if target in _ANGLES:
            error = np.rad2deg(np.arctan2(np.sin(error), np.cos(error)))
        parts.append((time[inside], error**2))
    samples = sum(len(values) for _, values in parts)
    if not samples:
        return None
    seed = zlib.crc32(f"{recordings[0].scenario} {target}".encode())
    value, low, high = _block_mean(parts, seed)
    if not bounded:
        value, low, high = (float(np.sqrt(x)) for x in (value, low, high))
    return RecordedScore(
        recordings[0].scenario, target, name, kind, "ok",
        measure="mean" if bounded else "RMS error",
        unit="deg" if target in _ANGLES else "-",
        value=value, low=low, high=high,
        outside=float(np.concatenate(outside).mean()) if bounded else None,
        samples=samples, excitation=band,
    )  # fmt: skip


def _in_band(recording: Recording, band: str) -> npt.NDArray[np.bool_]:
    """Return where the utilisation lies in a band; nowhere without an accelerometer."""
    used = utilisation_bound(recording)
    if used is None:
        return np.zeros(len(recording.truth), dtype=bool)
    low, high = next((low, high) for name, low, high in UTILISATION_BANDS if name == band)
    return (used >= low) & (used < high)


def scored_samples(recording: Recording) -> npt.NDArray[np.bool_]:
    """Return which samples count: those of the window `test`, or all where no window is named."""
    time = recording.truth["time"]
    inside = time >= recording.score_from
    if not recording.windows:
        return inside
    within = np.zeros(len(time), dtype=bool)
    for start, end in recording.windows.get("test", ()):
        within |= (time >= start) & (time <= end)
    return inside & within


def _block_mean(parts: Sequence[tuple[Floats, Floats]], seed: int) -> tuple[float, float, float]:
    """Return the mean over all samples and its 95 % interval over blocks of time.

    The interval is NaN where there are fewer than `FEWEST` blocks to draw from.
    """
    sums, counts = [], []
    for time, values in parts:
        if not len(time):
            continue
        block = ((time - time[0]) / BLOCK).astype(np.int64)
        sums.append(np.bincount(block, weights=values))
        counts.append(np.bincount(block).astype(np.float64))
    total, count = np.concatenate(sums), np.concatenate(counts)
    total, count = total[count > 0.0], count[count > 0.0]
    if len(total) < FEWEST:
        return float(total.sum() / count.sum()), np.nan, np.nan
    drawn = np.random.default_rng(seed).integers(0, len(total), (RESAMPLES, len(total)))
    means = total[drawn].sum(axis=1) / count[drawn].sum(axis=1)
    low, high = np.percentile(means, (2.5, 97.5))
    return float(total.sum() / count.sum()), float(low), float(high)
