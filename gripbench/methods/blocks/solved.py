"""Samples in, estimates of a solver of another package out: a method in plain Python.

It declares itself as a compiled method does, and is given the samples that a compiled step would
be given (`gripbench.methods.samples`); its solver may call what numba cannot compile. The package
is an extra; where it is not installed the method's cells are skipped, with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from gripbench.errors import InputError
from gripbench.methods.contract import CompiledMethod
from gripbench.methods.drivers import fill
from gripbench.methods.samples import admit, select_channels


class Solver(Protocol):
    """What runs between two resets of a method."""

    def advance(
        self, state: npt.NDArray[Any], obs: npt.NDArray[Any], est: npt.NDArray[Any]
    ) -> None:
        """Take a sample and write its estimates; all records have shape (1,)."""
        ...


class SolvedMethod(CompiledMethod):
    """Base of the methods whose step is plain Python.

    Attributes
    ----------
    solver
        Makes what takes the samples from the parameters, a record of shape (1,).
    """

    solver: ClassVar[Callable[..., Solver]]
    step = None  # type: ignore[assignment]
    _running: Solver | None = None

    def reset(self, vehicle: Mapping[str, float], dt: float) -> None:
        """Start afresh for a vehicle; `dt` is not used, every sample carries its time."""
        self._records = self._fresh(vehicle, 1)
        self._running = type(self).solver(self._records.params)

    def update(self, obs: Mapping[str, float]) -> dict[str, float]:
        """Take one sample, `time` and the declared channels; return the estimates."""
        records, running = self._records, self._running
        if records is None or running is None:
            raise InputError(f"{self.name}: call reset(vehicle, dt) before update(obs)")
        fill(self, records, obs)
        values = records.obs.view(np.float64)
        if admit(values, records.memory, records.layout):
            running.advance(records.state, records.obs, records.est)
        return dict(zip(self.outputs, records.est[0].item(), strict=True))

    def run(self, vehicle: Mapping[str, float], observations: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Run over a whole recording and return its estimates, shape (n,)."""
        selected = select_channels(observations, self.sensors)
        self.reset(vehicle, 0.0)
        found = np.zeros(len(selected), self.record_types.est)
        names = selected.dtype.names or ()
        for k, sample in enumerate(selected.tolist()):
            found[k] = (*self.update(dict(zip(names, sample, strict=True))).values(),)
        return found

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the solver, which cannot be pickled: a copy has to be reset."""
        return self.__dict__ | {"_running": None}
