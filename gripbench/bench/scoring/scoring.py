"""Scores of one run: estimates against truth, every target, in two compiled passes.

Samples before the recording's `score_from`, and those whose truth is not finite (a log without a
reference there), do not count. An estimate that is not finite, scored or not, makes the run
`diverged`.

Convergence time
    Time [s] from the start of scoring, or from the recording's note `friction_step` if that is
    later, to the first sample from which the absolute error stays within `BAND` of the largest
    absolute truth for `HOLD` seconds.
Response of the friction
    See `gripbench.bench.scoring.friction_response`.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
import numpy.typing as npt

from gripbench.bench.running.rows import UTILISATION_BANDS, Stratum, TargetScore
from gripbench.bench.scoring.friction_response import friction_response, is_available_friction
from gripbench.envs.recordings import Recording
from gripbench.envs.signals import VARIANCE
from gripbench.errors import GripbenchError

BAND = 0.1
"""Width of the convergence band: share of the largest absolute truth."""

HOLD = 0.5
"""Time [s] for which the error has to stay within the band."""

_EDGES = np.array([edge for _, edge, _ in UTILISATION_BANDS[1:]])


class DivergedError(GripbenchError):
    """An estimate is not a number, or too large to be squared."""


class EstimateError(GripbenchError):
    """The estimates do not have the shape or the fields that the method declared."""


def targets_of(estimates: tuple[str, ...], recording: Recording) -> tuple[str, ...]:
    """Return those of a method's estimates that the truth knows."""
    known = recording.truth.dtype.names or ()
    return tuple(name for name in estimates if name in known)


def score(
    estimates: npt.NDArray[Any],
    outputs: tuple[str, ...],
    targets: tuple[str, ...],
    recording: Recording,
) -> dict[str, TargetScore]:
    """Return the scores of a run by target.

    Parameters
    ----------
    estimates
        Structured array, shape (n,), with the fields `outputs`.
    outputs
        Estimates and variances that the method declares.
    targets
        Estimates to score.
    recording
        The run; truth of shape (n,).

    Raises
    ------
    EstimateError
        If the estimates have another shape or other fields.
    DivergedError
        If one of them is not finite.
    """
    check_estimates(estimates, outputs, len(recording.truth))
    truth = recording.truth
    times = np.ascontiguousarray(truth["time"])
    for name in outputs:
        first = _first_not_finite(estimates[name])
        if first >= 0:
            raise DivergedError(f"{name} is {estimates[name][first]} from t = {times[first]:.6g} s")
    known = truth.dtype.names or ()
    nothing = np.empty(0)
    used = _column(truth, "utilisation") if "utilisation" in known else nothing
    start = max(recording.score_from, recording.notes.get("friction_step", 0.0))
    scores = {}
    for name in targets:
        variance = name + VARIANCE
        values = _column(estimates, variance) if variance in outputs else nothing
        sums = _sums(
            times,
            _column(estimates, name),
            _column(truth, name),
            used,
            values,
            recording.score_from,
            start,
        )
        scored = _score_of(sums)
        if scored is None:
            raise DivergedError(f"{name} is too large to be squared")
        if scored.count and is_available_friction(name) and "accel_y" in known:
            response = friction_response(
                times,
                _column(estimates, name),
                _column(truth, name),
                _column(truth, "accel_y"),
                recording.score_from,
                recording.notes.get("mu_jump_time", math.nan),
            )
            scored = scored.model_copy(update={"friction": response})
        if scored.count:
            scores[name] = scored
    return scores


def check_estimates(estimates: Any, outputs: tuple[str, ...], length: int) -> None:
    """Raise EstimateError unless estimates have the declared fields and one value a sample."""
    names = getattr(getattr(estimates, "dtype", None), "names", None)
    if names is None:
        raise EstimateError(
            f"estimates are {type(estimates).__name__}, not a structured array with the fields "
            f"{', '.join(outputs)}"
        )
    missing = [name for name in outputs if name not in names]
    if missing:
        raise EstimateError(f"the estimate '{missing[0]}' is declared but not given")
    surplus = [name for name in names if name not in outputs]
    if surplus:
        raise EstimateError(f"the estimate '{surplus[0]}' is given but not declared")
    if estimates.shape != (length,):
        raise EstimateError(f"estimates have shape {estimates.shape}; it should be ({length},)")
    for name in outputs:
        if estimates.dtype[name] != np.float64:
            raise EstimateError(f"the estimate '{name}' is not of type float64")


def _column(records: npt.NDArray[Any], name: str) -> npt.NDArray[np.float64]:
    return np.ascontiguousarray(records[name])


def _first_not_finite(values: npt.NDArray[np.float64]) -> int:
    finite = np.isfinite(values)
    return -1 if finite.all() else int(np.argmin(finite))


def _score_of(sums: npt.NDArray[np.float64]) -> TargetScore | None:
    """Return the score of a row that `_sums` made; None where a sum overflowed."""
    count, squares, total, peak, convergence, nees = sums[:6]
    if not np.isfinite(sums[:4]).all() or not np.isfinite(sums[6:]).all():
        return None
    bands = sums[6:].reshape(-1, 2)
    return TargetScore(
        rms=math.sqrt(squares / count) if count else 0.0,
        sum_of_squares=float(squares),
        count=int(count),
        peak=float(peak),
        bias=float(total / count) if count else 0.0,
        convergence_time=None if math.isnan(convergence) else float(convergence),
        by_utilisation={
            band[0]: Stratum(sum_of_squares=float(part), count=int(number))
            for band, (part, number) in zip(UTILISATION_BANDS, bands, strict=True)
            if number
        },
        mean_nees=float(nees / count) if count and math.isfinite(nees) else None,
    )


@numba.njit(cache=True, error_model="numpy", nogil=True)
def _sums(times, estimate, truth, used, variance, score_from, start):  # type: ignore[no-untyped-def]
    """Return count, sum of squares, sum, peak, convergence time, NEES, then squares by band."""
    out = np.zeros(6 + 2 * (_EDGES.size + 1))
    largest = 0.0
    nees = 0.0 if variance.size else np.nan
    for k in range(times.size):
        if times[k] < score_from or not np.isfinite(truth[k]):
            continue
        error = estimate[k] - truth[k]
        largest = max(largest, abs(truth[k]))
        out[0] += 1.0
        out[1] += error * error
        out[2] += error
        out[3] = max(out[3], abs(error))
        if variance.size:
            nees += error * error / variance[k] if variance[k] > 0.0 else np.nan
        if used.size and np.isfinite(used[k]):
            band = 0
            while band < _EDGES.size and used[k] >= _EDGES[band]:
                band += 1
            out[6 + 2 * band] += error * error
            out[7 + 2 * band] += 1.0
    out[5] = nees
    out[4] = np.nan
    since = np.nan
    for k in range(times.size):
        if times[k] < start or not np.isfinite(truth[k]):
            continue
        if abs(estimate[k] - truth[k]) > BAND * largest:
            since = np.nan
            continue
        if np.isnan(since):
            since = times[k]
        if times[k] - since >= HOLD:
            out[4] = since - start
            break
    return out
