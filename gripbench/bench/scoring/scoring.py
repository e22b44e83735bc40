"""Estimates and truth of one run into the value of every metric, by target.

Samples before the recording's `score_from`, and those whose truth is not finite (a log without a
reference there), do not count. An estimate that is not finite, scored or not, makes the run
`diverged`. What a method has not said yet (`MISSING`, before its first estimate) does not count
either, for a second at most. Angles are compared on the circle: an estimate is moved by whole turns
to the branch of the truth, so that no metric sees an error beyond half a turn.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.scoring.distributions import Innovations, Quantiles
from gripbench.bench.scoring.metric import Context, Floats, Value
from gripbench.bench.scoring.metrics import metrics
from gripbench.envs.recordings import Recording
from gripbench.envs.signals import INNOVATION, VARIANCE, signal, wrapped
from gripbench.errors import GripbenchError
from gripbench.methods.outputs import quantile_levels

Scores = dict[str, Value]
"""Values of one target in one run, by the name of the metric."""

_LARGEST = math.sqrt(np.finfo(float).max)

_BITS = np.uint64(0x7FF8_0000_0067_7269)

MISSING = float(_BITS.view(np.float64))
"""Stands before a method's first estimate: a NaN with bits of its own."""

LATEST = 1.0
"""Time [s] into what counts by which the first estimate has to be there."""


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
) -> dict[str, Scores]:
    """Return the value of every metric that applies, by target and metric.

    Parameters
    ----------
    estimates
        Structured array, shape (n,), with the fields `outputs`.
    outputs
        Estimates and what else the method writes, see `gripbench.methods.outputs`.
    targets
        Estimates to score.
    recording
        The run; truth of shape (n,).

    Returns
    -------
    A target without a scored sample is left out, a metric that has nothing to say too.

    Raises
    ------
    EstimateError
        If the estimates have another shape or other fields, a variance is negative, or quantiles
        cross.
    DivergedError
        If one of them is not finite, or too large to be squared.
    MetricError
        If a metric fails.
    """
    check_estimates(estimates, outputs, len(recording.truth))
    truth = recording.truth
    times = np.ascontiguousarray(truth["time"])
    given = {name: _given(name, estimates[name], times, recording.score_from) for name in outputs}
    for name in outputs:
        first = _first_not_finite(np.where(given[name], estimates[name], 0.0))
        if first >= 0:
            raise DivergedError(f"{name} is {estimates[name][first]} from t = {times[first]:.6g} s")
    _check_variances(estimates, outputs, times)
    for name in targets:
        _check_quantiles(name, quantile_levels(name, outputs), estimates, times)
    inside = times >= recording.score_from
    innovations = _innovations(estimates, outputs, inside)
    scores = {}
    for name in targets:
        counted = inside & np.isfinite(truth[name]) & given[name]
        counted &= given.get(name + VARIANCE, True)
        if not counted.any():
            continue
        estimate, true, context = context_of(name, estimates, outputs, recording, counted)
        if _too_large(estimate, true):
            raise DivergedError(f"{name} is too large to be squared")
        context = replace(context, innovations=innovations)
        values = {
            metric.name: metric.of_run(times[counted], estimate, true, context)
            for metric in metrics().values()
        }
        scores[name] = {key: value for key, value in values.items() if value is not None}
    return scores


def _quantiles(
    name: str, levels: dict[str, float], estimates: npt.NDArray[Any], truth: Floats
) -> Quantiles | None:
    if not levels:
        return None
    offsets = np.array([_offset(name, field, estimates) for field in levels])
    return Quantiles(truth, tuple(levels.values()), offsets)


def _offset(name: str, field: str, estimates: npt.NDArray[Any]) -> Floats:
    """Return a quantile less the estimate: of an angle the shorter way round."""
    offset: Floats = estimates[field] - estimates[name]
    return wrapped(offset) if signal(name).angle else offset


def _check_variances(estimates: npt.NDArray[Any], outputs: tuple[str, ...], times: Floats) -> None:
    for name in outputs:
        if name.endswith(VARIANCE) and (estimates[name] < 0.0).any():
            first = int(np.argmax(estimates[name] < 0.0))
            raise EstimateError(
                f"{name} is {estimates[name][first]:g} at t = {times[first]:.6g} s; a variance is "
                "not negative"
            )


def _check_quantiles(
    name: str, levels: dict[str, float], estimates: npt.NDArray[Any], times: Floats
) -> None:
    for low, high in pairwise(levels):
        crossed = _offset(name, low, estimates) > _offset(name, high, estimates)
        if crossed.any():
            first = int(np.argmax(crossed))
            raise EstimateError(
                f"{low} is above {high} at t = {times[first]:.6g} s; quantiles must not cross"
            )


def _innovations(
    estimates: npt.NDArray[Any], outputs: tuple[str, ...], inside: npt.NDArray[np.bool_]
) -> Innovations | None:
    shown = [name for name in outputs if name.endswith(INNOVATION) and name + VARIANCE in outputs]
    if not shown:
        return None
    return Innovations(
        {name: estimates[name][inside] for name in shown},
        {name: estimates[name + VARIANCE][inside] for name in shown},
    )


def context_of(
    name: str,
    estimates: npt.NDArray[Any],
    outputs: tuple[str, ...],
    recording: Recording,
    counted: npt.NDArray[np.bool_],
) -> tuple[Floats, Floats, Context]:
    """Return estimate, truth and what a metric may look at besides, in the samples that count.

    Parameters
    ----------
    name
        Signal that is estimated.
    estimates, outputs, recording
        As `score` takes them.
    counted
        Which samples count, shape (n,).
    """
    truth = recording.truth
    true = truth[name][counted]
    estimate = on_branch(name, estimates[name][counted], true)
    variance = name + VARIANCE
    levels = quantile_levels(name, outputs)
    return (
        estimate,
        true,
        Context(
            target=name,
            score_from=recording.score_from,
            notes=recording.notes,
            variance=estimates[variance][counted] if variance in outputs else None,
            channels=_Channels(truth, counted),
            bounded=name in {bound.signal for bound in recording.bounds},
            quantiles=_quantiles(name, levels, estimates[counted], true - estimate),
        ),
    )


def at_lag(recording: Recording, lag: float) -> Recording:
    """Return a recording whose truth at each sample is that of `lag` seconds before.

    A method that tells of the past is compared with the past. There is no truth [NaN] where the
    recording had not begun.

    Parameters
    ----------
    lag
        Age of the estimates [s].
    """
    if not lag:
        return recording
    times = recording.truth["time"]
    places = np.searchsorted(times, times - lag + 1e-9, side="right") - 1
    truth = recording.truth[np.maximum(places, 0)]
    for name in truth.dtype.names or ():
        if name == "time":
            truth[name] = times
        else:
            truth[name][places < 0] = np.nan
    return replace(recording, truth=truth)


class _Channels:
    """Channels of the truth at the samples that count; each is cut out once."""

    def __init__(self, truth: npt.NDArray[Any], counted: npt.NDArray[np.bool_]) -> None:
        self._truth, self._counted = truth, counted
        self._found: dict[str, Floats] = {}

    def __call__(self, name: str) -> Floats | None:
        if name not in (self._truth.dtype.names or ()):
            return None
        if name not in self._found:
            self._found[name] = self._truth[name][self._counted]
        return self._found[name]


def on_branch(name: str, estimate: Floats, truth: Floats) -> Floats:
    """Return an angle's estimate moved by whole turns to within half a turn of the truth.

    Parameters
    ----------
    name
        Signal; of one that is no angle the estimate comes back as it is.
    estimate, truth
        Shape (n,).

    Examples
    --------
    >>> on_branch("mu", np.array([7.0]), np.array([0.5]))
    array([7.])
    >>> float(on_branch("yaw", np.array([3.1]), np.array([-3.1]))[0])
    -3.1831853071795863
    """
    if not signal(name).angle:
        return estimate
    turns = np.round((estimate - truth) / (2.0 * np.pi))
    return np.where(turns == 0.0, estimate, estimate - 2.0 * np.pi * turns)


def _too_large(estimate: Floats, truth: Floats) -> bool:
    with np.errstate(over="ignore"):
        return bool(np.abs(estimate - truth).max() * math.sqrt(len(truth)) > _LARGEST)


def check_estimates(estimates: Any, outputs: tuple[str, ...], length: int) -> None:
    """Raise EstimateError unless estimates have the declared fields and one value a sample."""
    names = getattr(getattr(estimates, "dtype", None), "names", None)
    if names is None:
        raise EstimateError(
            f"estimates are {type(estimates).__name__}, not a structured array with the fields "
            f"{', '.join(outputs)}"
        )
    if isinstance(estimates, np.ma.MaskedArray):
        raise EstimateError("estimates are a masked array; return a plain one")
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


def missing_at_first(values: npt.NDArray[np.float64]) -> int:
    """Return the number of samples before the first estimate."""
    said = np.ascontiguousarray(values).view(np.uint64) != _BITS
    return int(np.argmax(said)) if said.any() else len(values)


def _given(
    name: str, values: npt.NDArray[np.float64], times: npt.NDArray[np.float64], start: float
) -> npt.NDArray[np.bool_]:
    """Return for each sample whether a method had said anything by then."""
    first = missing_at_first(values)
    if first == len(values):
        raise EstimateError(f"update never returned the estimate '{name}': return a number")
    if first and not times[first] <= max(start, times[0]) + LATEST:
        raise EstimateError(
            f"the first estimate of '{name}' comes at t = {times[first]:.6g} s; give one, a guess, "
            f"by t = {max(start, times[0]) + LATEST:g} s"
        )
    return np.arange(len(values)) >= first


def _first_not_finite(values: npt.NDArray[np.float64]) -> int:
    finite = np.isfinite(values)
    return -1 if finite.all() else int(np.argmin(finite))
