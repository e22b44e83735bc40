"""The contract between a method and everything that runs it.

A method's mathematics is one function over records::

    @compiled
    def step(state, obs, params, est):
        est.force_x_front = 0.5 * params.mass * obs.accel_x

`obs` holds `time` and the channels that the method declared, and two fields that the driver adds:
`elapsed`, the time since the sample before (0 for the first one, else positive), and `first`, 1 for
the first sample. Samples are whole and in order, see `gripbench.methods.samples`. `params` holds
the vehicle parameters and the method's own parameters that it declared, `state` whatever it keeps
between samples, `est` the estimates that it declared. Numba compiles the function; `step.py_func`
is the plain Python that a debugger can enter.

A plain class with `reset(vehicle, dt)` and `update(obs) -> dict`, and the attributes `name`,
`sensors` and `estimates`, is a full citizen too; it only runs slower (see `Estimator`).
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from gripbench.compilation import compiled, replacing
from gripbench.envs.signals import record_type, signal
from gripbench.envs.vehicles import require
from gripbench.errors import InputError, UndeclaredChannelError, unknown
from gripbench.methods import drivers
from gripbench.methods.outputs import checked_quantiles, fields_of
from gripbench.methods.settings import Parameter, Setting, Variant, Variants, checked_settings


@runtime_checkable
class Estimator(Protocol):
    """What every method is: the whole contract for a plain class."""

    name: str
    sensors: tuple[str, ...]
    estimates: tuple[str, ...]

    def reset(self, vehicle: Mapping[str, float], dt: float) -> None:
        """Forget everything; `vehicle` is what is known on paper, `dt` the sample time [s]."""
        ...

    def update(self, obs: Mapping[str, float]) -> Mapping[str, float]:
        """Take one sample, `time` and the declared channels; return the declared estimates."""
        ...


class CompiledMethod:
    """Base of the methods whose step is compiled.

    A subclass is a declaration: class attributes say what it is, `step` holds its mathematics.

    Parameters
    ----------
    variant
        Named settings: `corrected` is the default of every parameter, the others are listed in
        `variants`.
    **overrides
        Values of single parameters.

    Attributes
    ----------
    name
        Unique name, lower case with underscores.
    title
        Name as the literature gives it.
    reference
        Paper and equations.
    sensors
        Channels that it reads besides `time`.
    estimates
        Signals that it writes.
    variances
        Those of `estimates` for which it also writes `<name>_variance`.
    quantiles
        Levels by estimate, for those of which it writes quantiles instead (see
        `gripbench.methods.outputs`): `{"mu": (0.05, 0.5, 0.95)}`, in `est.mu_q05` and so on.
    innovations
        Channels whose innovation it shows: it writes `<channel>_innovation` and its variance.
    vehicle_parameters
        Vehicle parameters that it reads.
    unread
        `unread(settings) -> names`, or None: those of its vehicle parameters that it does not read
        under these settings. An instance does not declare them; its step finds NaN in their place.
    parameters
        Its own parameters.
    variants
        What differs in each variant, by name: a `Variant`, or only its settings.
    printed
        Module with the forms that its paper prints and gripbench corrects, see
        `gripbench.methods.printed`; empty: none.
    baseline
        Whether it is a trivial estimator that others are measured against.
    files
        Data files that it reads, relative to its own: their content is part of every row's key.
    packages
        Packages beside gripbench's own that it imports; without them its cells are skipped.
    lag
        Age of its estimates [s]: at time t it tells of t - lag, and is scored there.
    state
        Structured type of what it keeps between samples; all zero after `reset`.
    step
        `step(state, obs, params, est) -> None`, compiled.
    start
        `start(state, params) -> None`, compiled, or None: first values of the state.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    reference: ClassVar[str]
    sensors: tuple[str, ...]
    estimates: ClassVar[tuple[str, ...]]
    variances: ClassVar[tuple[str, ...]] = ()
    quantiles: ClassVar[Mapping[str, tuple[float, ...]]] = {}
    innovations: ClassVar[tuple[str, ...]] = ()
    vehicle_parameters: tuple[str, ...] = ()
    unread: ClassVar[Callable[..., Collection[str]] | None] = None
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    variants: ClassVar[Mapping[str, Any]] = {}
    printed: ClassVar[str] = ""
    files: tuple[str, ...] = ()
    packages: ClassVar[tuple[str, ...]] = ()
    lag: ClassVar[float] = 0.0
    baseline: ClassVar[bool] = False
    state: ClassVar[np.dtype[Any]]
    step: Callable[..., Any]
    start: ClassVar[Callable[..., Any] | None] = None

    def __init_subclass__(cls, **arguments: Any) -> None:
        super().__init_subclass__(**arguments)
        if not isinstance(cls.variants, Variants) or "printed" in vars(cls):
            printed = vars(cls).get("printed", "")
            cls.variants = Variants(getattr(cls, "name", ""), cls.variants, printed)

    def __init__(self, variant: str = "corrected", **overrides: Setting) -> None:
        if variant != "corrected" and variant not in self.variants:
            raise unknown(f"variant of {self.name}", variant, ["corrected", *self.variants])
        chosen: Variant = self.variants.get(variant, Variant())
        self.variant = variant
        self.settings = checked_settings(self.name, self.parameters, chosen.settings, overrides)
        if chosen.sensors is not None:
            self.sensors = chosen.sensors
        if chosen.vehicle_parameters is not None:
            self.vehicle_parameters = chosen.vehicle_parameters
        self.step = chosen.step or type(self).step
        if chosen.functions:
            self.step = replacing(self.step, chosen.functions, f"{self.name}.{variant}")
            self.files = (*self.files, *_files_of(type(self), chosen))
        self.record_types = _record_types(self)
        unread = chosen.unread or type(self).unread
        if unread is not None:
            names = unread(self.settings)
            self.vehicle_parameters = tuple(
                name for name in self.vehicle_parameters if name not in names
            )
        self._records: drivers.Records | None = None
        self._fitted: tuple[str, ...] = ()

    def reset(self, vehicle: Mapping[str, float], dt: float) -> None:
        """Start afresh for a vehicle; `dt` is not used, every sample carries its time."""
        self._records = self._fresh(vehicle, 1)

    def update(self, obs: Mapping[str, float]) -> dict[str, float]:
        """Take one sample and return the estimates.

        Parameters
        ----------
        obs
            `time` and the declared channels; others are not looked at.

        Raises
        ------
        UndeclaredChannelError
            If `obs` lacks a declared channel.
        """
        if self._records is None:
            raise InputError(f"{self.name}: call reset(vehicle, dt) before update(obs)")
        return drivers.online(self, self._records, obs)

    def run(self, vehicle: Mapping[str, float], observations: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Run over a whole recording in one compiled loop.

        Parameters
        ----------
        vehicle
            Vehicle parameters by name.
        observations
            Structured array, shape (n,), with `time` and at least the declared channels.

        Returns
        -------
        Structured array, shape (n,), one field for each output.
        """
        return drivers.batch(self, self._fresh(vehicle, len(observations)), observations)

    @property
    def fitted(self) -> dict[str, Setting]:
        """Parameters that its `fit` found, where it has one: settings from then on."""
        return {name: self.settings[name] for name in self._fitted}

    @fitted.setter
    def fitted(self, found: Mapping[str, Setting]) -> None:
        self.settings = checked_settings(self.name, self.parameters, self.settings, found)
        self._fitted = tuple(found)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Fields that a step writes: estimates, variances, quantiles, innovations."""
        return fields_of(self.estimates, self.variances, self.quantiles, self.innovations)

    def _fresh(self, vehicle: Mapping[str, float], length: int) -> drivers.Records:
        params = np.full(1, np.nan, self.record_types.params)
        for name, value in require(dict(vehicle), self.vehicle_parameters, self.name).items():
            params[name] = value
        for parameter in self.parameters:
            params[parameter.name] = parameter.number(self.settings[parameter.name])
        records = drivers.Records(
            state=np.zeros(1, self.record_types.state),
            obs=np.zeros(1, self.record_types.obs),
            params=params,
            est=np.zeros(length, self.record_types.est),
        )
        if self.start is not None:
            type(self).start(records.state[0], records.params[0])  # type: ignore[misc]
        return records


@dataclass(frozen=True)
class RecordTypes:
    """Types of the four records of a step."""

    state: np.dtype[Any]
    obs: np.dtype[Any]
    params: np.dtype[Any]
    est: np.dtype[Any]


def _files_of(method: type[CompiledMethod], variant: Variant) -> set[str]:
    """Return the files of a variant's functions, relative to the method's own."""
    own = os.path.dirname(inspect.getfile(method))
    plain = (getattr(each, "py_func", each) for each in variant.functions.values())
    return {Path(os.path.relpath(inspect.getfile(each), own)).as_posix() for each in plain}


def _record_types(method: CompiledMethod) -> RecordTypes:
    for name in (*method.sensors, *method.estimates):
        signal(name)
    checked_quantiles(method.name, method.quantiles, method.estimates, method.variances)
    own = tuple(parameter.name for parameter in method.parameters)
    clash = set(own) & set(method.vehicle_parameters)
    if clash:
        raise InputError(f"{method.name}: parameter '{clash.pop()}' is also a vehicle parameter")
    params = [(name, np.float64) for name in (*method.vehicle_parameters, *own)]
    return RecordTypes(
        state=method.state,
        obs=drivers.observation_type(method.sensors),
        params=np.dtype(params or [("none", np.float64)]),
        est=record_type(method.outputs),
    )


__all__ = [
    "CompiledMethod",
    "Estimator",
    "Parameter",
    "UndeclaredChannelError",
    "Variant",
    "compiled",
]
