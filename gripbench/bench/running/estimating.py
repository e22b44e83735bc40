"""A method and what it is given in, its estimates out: a plug-in's come from its sandbox."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Protocol

import numpy.typing as npt

from gripbench.bench.catalogue.registry import MethodSpec
from gripbench.bench.running.execution import execute
from gripbench.bench.running.isolation.limits import Limits
from gripbench.bench.running.isolation.sandbox import Sandbox
from gripbench.bench.scoring.scoring import check_estimates


class Estimates(Protocol):
    """Returns a method's estimates, shape (n,)."""

    def __call__(
        self, vehicle: Mapping[str, float], observations: npt.NDArray[Any]
    ) -> npt.NDArray[Any]:
        """Run the method over the observations, shape (n,), of a vehicle."""
        ...


@contextmanager
def estimating(spec: MethodSpec, limits: Limits) -> Iterator[Estimates]:
    """Give a function that runs a method, to be called often.

    Raises, when called, as `execute`, and for a plug-in as `Sandbox.execute`; EstimateError where
    the estimates are not as declared.
    """
    sandbox = Sandbox(limits)

    def run(vehicle: Mapping[str, float], observations: npt.NDArray[Any]) -> npt.NDArray[Any]:
        said = spec.declaration
        if spec.isolated:
            outcome = sandbox.execute(
                spec.source, said, spec.variant, spec.parameters, vehicle, observations, 0.0,
                spec.state,
            )  # fmt: skip
        else:
            outcome = execute(spec.make(), said, vehicle, observations, 0.0, timed=False)
        check_estimates(outcome.estimates, said.outputs, len(observations))
        return outcome.estimates

    try:
        yield run
    finally:
        sandbox.close()
