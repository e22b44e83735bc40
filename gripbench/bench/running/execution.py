"""Run one method over one recording: only its declared channels in, only its estimates out."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from numbers import Real
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.catalogue.declarations import Declaration
from gripbench.bench.running.rows import Runtime
from gripbench.bench.scoring.scoring import MISSING, EstimateError
from gripbench.envs.signals import record_type
from gripbench.errors import GripbenchError, UndeclaredChannelError, nearest
from gripbench.methods.samples import is_given, select_channels

ONLINE_SAMPLES = 2000
"""Number of single calls whose time is taken where the batch form made the estimates."""


class SkippedError(GripbenchError):
    """The scenario does not give what the method needs."""


class Observation(dict[str, float]):
    """One sample: `time` and the declared channels; reading another channel names it."""

    method = "the method"

    def __missing__(self, channel: str) -> float:
        raise UndeclaredChannelError(
            f"{self.method} reads the channel '{channel}', which is not among its sensors"
        )


class VehicleOnPaper(dict[str, float]):
    """Vehicle parameters; reading one that the vehicle's file does not give skips the cell."""

    def __missing__(self, parameter: str) -> float:
        raise SkippedError(f"the vehicle does not give the parameter '{parameter}'")


@dataclass(frozen=True)
class Outcome:
    """Estimates of one run and the time that they took.

    Attributes
    ----------
    estimates
        Structured array, shape (n,).
    runtime
        Times of its steps [s].
    read
        What an isolated method was seen to read, see `running.isolation.audit.report`.
    over_prefixes
        Whether it was given whole recordings and its causality is that of `isolation.prefixes`.
    """

    estimates: npt.NDArray[Any]
    runtime: Runtime
    read: Mapping[str, Any] = field(default_factory=dict)
    over_prefixes: bool = False


def missing(
    declaration: Declaration, vehicle: Mapping[str, float], channels: tuple[str, ...]
) -> str:
    """Return why a method cannot run here, given only these channels; empty: it can."""
    sensors, parameters = lacking(declaration, vehicle, channels)
    if sensors:
        return "the scenario has no sensor for " + ", ".join(f"'{name}'" for name in sensors)
    if parameters:
        return "the vehicle does not give " + ", ".join(f"'{name}'" for name in parameters)
    absent = [name for name in declaration.packages if find_spec(name) is None]
    if absent:
        return f"the package '{absent[0]}' is not installed: pip install {absent[0]}"
    return ""


def lacking(
    declaration: Declaration, vehicle: Mapping[str, float], channels: tuple[str, ...]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the channels and the vehicle parameters that a method needs and is not given."""
    return (
        tuple(name for name in declaration.sensors if not is_given(name, channels)),
        tuple(name for name in declaration.vehicle_parameters if name not in vehicle),
    )


def execute(
    method: Any,
    declaration: Declaration,
    vehicle: Mapping[str, float],
    observations: npt.NDArray[Any],
    period: float,
    timed: bool,
) -> Outcome:
    """Run a method over a recording.

    Parameters
    ----------
    method
        An estimator.
    declaration
        What it declares.
    vehicle
        Vehicle parameters by name.
    observations
        Structured array, shape (n,), with at least the declared channels.
    period
        Nominal time [s] between samples.
    timed
        Whether single calls are timed where the batch form makes the estimates.
    """
    selected = select_channels(observations, declaration.sensors)
    paper = VehicleOnPaper(vehicle)
    online = takes_samples(method)
    if callable(getattr(method, "run", None)):
        if online:
            method.run(paper, selected[:2])  # compiles; its time is no step's time
        began = time.perf_counter()
        estimates = method.run(paper, selected)
        batch = (time.perf_counter() - began) / max(len(selected), 1)
        estimates = estimates_of(estimates, declaration.outputs, len(selected))
        calls = np.empty(0)
        if timed and online:
            _, calls = _online(method, declaration, paper, selected[: ONLINE_SAMPLES + 10])
            calls = calls[10:]
    else:
        estimates, calls = _online(method, declaration, paper, selected)
        batch = float(calls.mean())
    return Outcome(estimates, runtime_of(calls, period, batch))


def takes_samples(method: Any) -> bool:
    """Return whether a method takes samples one by one; otherwise it takes whole recordings."""
    return callable(getattr(method, "update", None))


def estimates_of(given: Any, outputs: tuple[str, ...], length: int) -> Any:
    """Return what `run` returned as a structured array; a mapping of arrays by name is made one.

    Raises
    ------
    EstimateError
        If an array in a mapping is not one of `length` real numbers, or one is missing.
    UndeclaredChannelError
        If there is one that was not declared.
    """
    if isinstance(given, np.ndarray) or not isinstance(given, Mapping):
        return given
    if set(given) != set(outputs):
        raise _wrong(given, outputs)
    estimates = np.empty(length, record_type(outputs))
    for name in outputs:
        values = np.asarray(given[name])
        if isinstance(given[name], np.ma.MaskedArray) or values.dtype.kind not in "iuf":
            raise EstimateError(f"the estimate '{name}' is {_kind(given[name])} of no real numbers")
        if values.shape != (length,):
            raise EstimateError(
                f"the estimate '{name}' has shape {values.shape}; it should be ({length},)"
            )
        estimates[name] = values
    return estimates


def run_online(
    method: Any,
    declaration: Declaration,
    vehicle: Mapping[str, float],
    observations: npt.NDArray[Any],
) -> npt.NDArray[Any]:
    """Return the estimates of a method that is given one sample at a time."""
    selected = select_channels(observations, declaration.sensors)
    return _online(method, declaration, VehicleOnPaper(vehicle), selected)[0]


def _online(
    method: Any,
    declaration: Declaration,
    vehicle: VehicleOnPaper,
    observations: npt.NDArray[Any],
) -> tuple[npt.NDArray[Any], npt.NDArray[np.float64]]:
    names = observations.dtype.names or ()
    outputs = declaration.outputs
    estimates = np.empty(len(observations), record_type(outputs))
    values = estimates.view(np.float64).reshape(len(observations), len(outputs))
    times = observations["time"]
    step = float(times[1] - times[0]) if len(times) > 1 else 0.0
    took = np.empty(len(observations), np.int64)
    clock = time.perf_counter_ns
    method.reset(VehicleOnPaper(vehicle), step)
    update = method.update
    last = [MISSING] * len(outputs)
    for k, sample in enumerate(observations.tolist()):
        obs = Observation(zip(names, sample, strict=True))
        obs.method = declaration.name
        began = clock()
        given = update(obs)
        took[k] = clock() - began
        values[k] = last = numbers_of(given, outputs, last)
    return estimates, took.astype(np.float64) * 1e-9


def numbers_of(given: Any, outputs: tuple[str, ...], last: Sequence[float]) -> list[float]:
    """Return what `update` returned as floats, in the order of the declared outputs.

    Where it returned None, as a whole or for an estimate, the last value holds.

    Only a real number counts as one: no text that looks like one, no bool, no array, no masked,
    complex or date value. NaN and infinity are numbers here; scoring finds them.

    Parameters
    ----------
    given
        The mapping that `update` returned, or None.
    outputs
        The declared estimates and variances.
    last
        What this returned for the sample before; at first `scoring.MISSING`.

    Raises
    ------
    EstimateError
        If an estimate is missing or is no number.
    UndeclaredChannelError
        If there is one that was not declared.
    """
    if given is None:
        return list(last)
    try:
        values = [given[name] for name in outputs]
    except (KeyError, TypeError, IndexError):
        raise _wrong(given, outputs) from None
    if len(given) != len(outputs):
        raise _wrong(given, outputs)
    return [
        value if type(value) is float else before if value is None else _number(name, value)
        for name, value, before in zip(outputs, values, last, strict=True)
    ]


def _number(name: str, value: Any) -> float:
    if not isinstance(value, Real) or isinstance(value, bool):
        shape = f" of shape {value.shape}" if isinstance(value, np.ndarray) else ""
        raise EstimateError(f"the estimate '{name}' is {_kind(value)}{shape}; return a number")
    try:
        return float(value)
    except OverflowError:
        raise EstimateError(f"the estimate '{name}' is too large for a float") from None


def _kind(value: Any) -> str:
    return "masked" if value is np.ma.masked else type(value).__name__


def _wrong(given: Any, outputs: tuple[str, ...]) -> GripbenchError:
    """Return what is wrong with the mapping that `update` returned."""
    if not isinstance(given, Mapping):
        return EstimateError(
            f"update returned {type(given).__name__}; return a dict with {', '.join(outputs)}"
        )
    for name in outputs:
        if name not in given:
            hint = nearest(name, [str(key) for key in given]) if given else "it is empty"
            return EstimateError(
                f"the estimate '{name}' is declared but update does not return it: {hint}"
            )
    surplus = next((name for name in given if name not in outputs), "")
    return UndeclaredChannelError(
        f"update returns the estimate '{surplus}', which is not among its estimates"
    )


def runtime_of(
    calls: npt.NDArray[np.float64], period: float, batch: float | None = None
) -> Runtime:
    """Return the times of single calls [s], shape (n,), as a runtime.

    Parameters
    ----------
    calls
        Times of single calls; may be empty.
    period
        Nominal time [s] between samples.
    batch
        Time of a step [s] in one loop; by default the mean of the calls.
    """
    if batch is None:
        batch = float(calls.mean())
    if not len(calls):
        return Runtime(batch=batch)
    return Runtime(
        batch=batch,
        p50=float(np.quantile(calls, 0.5)),
        p99=float(np.quantile(calls, 0.99)),
        maximum=float(calls.max()),
        samples=len(calls),
        deadline_misses=float(np.mean(calls > period)),
    )
