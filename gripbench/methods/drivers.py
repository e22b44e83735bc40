"""Two drivers of one compiled step: one sample at a time, and a whole recording in one loop.

Both give a step only what `gripbench.methods.samples` admits.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from gripbench.envs.signals import NEW
from gripbench.errors import GripbenchError, UndeclaredChannelError
from gripbench.methods.samples import (
    CLOCK_FIELDS,
    admit,
    layout_of,
    memory_of,
    regular,
    select_channels,
)

if TYPE_CHECKING:
    from gripbench.methods.contract import CompiledMethod


@dataclass
class Records:
    """The arrays that a step reads and writes; `state`, `obs` and `params` have length 1."""

    state: npt.NDArray[Any]
    obs: npt.NDArray[Any]
    params: npt.NDArray[Any]
    est: npt.NDArray[Any]
    memory: npt.NDArray[np.float64] = field(init=False)
    layout: npt.NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        channels = (self.obs.dtype.names or ())[: -len(CLOCK_FIELDS)]
        self.memory, self.layout = memory_of(channels), layout_of(channels)


def observation_type(channels: tuple[str, ...]) -> np.dtype[Any]:
    """Return the type of the observations that a step sees."""
    # The clock last: numba takes a record for a subtype of one that it begins with.
    return np.dtype([(name, np.float64) for name in (*channels, *CLOCK_FIELDS)])


def online(method: CompiledMethod, records: Records, obs: Mapping[str, float]) -> dict[str, float]:
    """Advance a method by one sample and return its estimates by name."""
    fill(method, records, obs)
    _call(method, _single(method.step), *_arrays(records, records.obs))
    return dict(zip(method.outputs, records.est[0].item(), strict=True))


def fill(method: CompiledMethod, records: Records, obs: Mapping[str, float]) -> None:
    """Copy what a method reads of a sample into its records."""
    sample = records.obs
    names = (sample.dtype.names or ())[:-2]
    try:
        given = [obs[name] for name in names]
    except KeyError:
        given = [_reading(method, obs, name) for name in names]
    sample[0] = (*given, 0.0, 0.0)


def compile_single(method: CompiledMethod) -> None:
    """Compile what `online` calls, without a call of the step."""
    import numba

    types = method.record_types
    names = ("state", "obs", "params", "est")
    records = Records(*(np.zeros(1, getattr(types, name)) for name in names))
    signature = tuple(map(numba.typeof, _arrays(records, records.obs)))
    _single(method.step).compile(signature)  # type: ignore[attr-defined]


def batch(
    method: CompiledMethod, records: Records, observations: npt.NDArray[Any]
) -> npt.NDArray[Any]:
    """Run a method over a recording and return its estimates, shape (n,)."""
    selected = select_channels(observations, method.sensors)
    samples = np.empty(len(selected), observation_type(method.sensors))
    for name in selected.dtype.names or ():
        samples[name] = selected[name]
    times = samples["time"]
    with np.errstate(invalid="ignore"):  # of infinite times, which are not taken
        samples["elapsed"] = np.diff(times, prepend=times[:1])
    samples["first"] = np.arange(len(times)) == 0
    arrays = _arrays(records, samples)
    _call(method, _loop(method.step), *arrays, np.array(regular(arrays[4])))
    return records.est


def _arrays(records: Records, samples: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], ...]:
    """Return what a compiled loop takes; `values` are the samples again, as a matrix."""
    values = samples.view(np.float64).reshape(len(samples), -1)
    return (
        records.state, samples, records.params, records.est, values, records.memory, records.layout
    )  # fmt: skip


def _reading(method: CompiledMethod, obs: Mapping[str, float], name: str) -> float:
    """Return a channel's value; of a sensor as fast as the samples every one is new."""
    if name in obs:
        return obs[name]
    if name.endswith(NEW) and name.removesuffix(NEW) in obs:
        return float(np.isfinite(obs[name.removesuffix(NEW)]))
    raise UndeclaredChannelError(
        f"{method.name}: the observation lacks the declared channel '{name}'"
    )


@cache
def _single(step: Callable[..., Any]) -> Callable[..., Any]:
    # Arrays of length 1 pass numba's dispatcher four times faster than single records do.
    import numba

    @numba.njit(nogil=True, error_model="numpy")
    def single(state, obs, params, est, values, memory, layout):
        if admit(values[0], memory, layout):
            step(state[0], obs[0], params[0], est[0])

    return single


@cache
def _loop(step: Callable[..., Any]) -> Callable[..., Any]:
    import numba

    @numba.njit(nogil=True, error_model="numpy")
    def loop(state, obs, params, est, values, memory, layout, whole):
        for k in range(obs.shape[0]):
            if k > 0 and not whole[()]:
                est[k] = est[k - 1]
            if whole[()] or admit(values[k], memory, layout):
                step(state[0], obs[k], params[0], est[k])

    return loop


def _call(method: CompiledMethod, function: Callable[..., Any], *records: npt.NDArray[Any]) -> None:
    try:
        function(*records)
    except KeyError as error:  # numba, typing a record that has no such field
        raise _undeclared(method, str(error.args[0])) from None
    except Exception as error:
        if type(error).__module__ != "numba.core.errors":
            raise
        found = re.search(r"Field '(\w+)' was not found in record", str(error))
        if found:
            raise _undeclared(method, found.group(1)) from None
        plain = re.sub(r"\x1b\[\d*m", "", str(error))  # numba's colours
        lines = [line.strip() for line in plain.splitlines() if line.strip()]
        raise GripbenchError(
            f"{method.name}: step cannot be compiled: {' '.join(lines[:4])}"
        ) from None


_KINDS = {
    "state": "uses '{}', which is not a field of its state",
    "obs": "reads the channel '{}', which is not among its sensors",
    "params": "reads the parameter '{}', which it does not declare",
    "est": "writes the estimate '{}', which is not among its estimates",
}


def _undeclared(method: CompiledMethod, field: str) -> UndeclaredChannelError:
    """Return the error for a field that no record has, saying which record was meant."""
    source = inspect.getsource(method.step.py_func)  # type: ignore[attr-defined]
    for record, message in _KINDS.items():
        if re.search(rf"\b{record}\.{field}\b", source):
            return UndeclaredChannelError(f"{method.name} {message.format(field)}")
    return UndeclaredChannelError(f"{method.name} uses '{field}', which it does not declare")
