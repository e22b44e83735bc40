"""Estimates and truth of one run into the value of every metric, by target.

Samples before the recording's `score_from`, and those whose truth is not finite (a log without a
reference there), do not count. An estimate that is not finite, scored or not, makes the run
`diverged`. Angles are compared on the circle: an estimate is moved by whole turns to the branch of
the truth, so that no metric sees an error beyond half a turn.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.scoring.metric import Context, Floats, Value
from gripbench.bench.scoring.metrics import metrics
from gripbench.envs.recordings import Recording
from gripbench.envs.signals import VARIANCE, signal
from gripbench.errors import GripbenchError

Scores = dict[str, Value]
"""Values of one target in one run, by the name of the metric."""

_LARGEST = math.sqrt(np.finfo(float).max)


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
        Estimates and variances that the method declares.
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
        If the estimates have another shape or other fields.
    DivergedError
        If one of them is not finite, or too large to be squared.
    MetricError
        If a metric fails.
    """
    check_estimates(estimates, outputs, len(recording.truth))
    truth = recording.truth
    times = np.ascontiguousarray(truth["time"])
    for name in outputs:
        first = _first_not_finite(estimates[name])
        if first >= 0:
            raise DivergedError(f"{name} is {estimates[name][first]} from t = {times[first]:.6g} s")
    inside = times >= recording.score_from
    bounded = {bound.signal for bound in recording.bounds}
    scores = {}
    for name in targets:
        counted = inside & np.isfinite(truth[name])
        if not counted.any():
            continue
        true = truth[name][counted]
        estimate = on_branch(name, estimates[name][counted], true)
        if _too_large(estimate, true):
            raise DivergedError(f"{name} is too large to be squared")
        variance = name + VARIANCE
        context = Context(
            target=name,
            score_from=recording.score_from,
            notes=recording.notes,
            variance=estimates[variance][counted] if variance in outputs else None,
            channels=_Channels(truth, counted),
            bounded=name in bounded,
        )
        values = {
            metric.name: metric.of_run(times[counted], estimate, true, context)
            for metric in metrics().values()
        }
        scores[name] = {key: value for key, value in values.items() if value is not None}
    return scores


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


def _first_not_finite(values: npt.NDArray[np.float64]) -> int:
    finite = np.isfinite(values)
    return -1 if finite.all() else int(np.argmin(finite))
