"""Recordings and estimates that pictures are drawn from, each made once."""

from __future__ import annotations

from typing import Any

import numpy.typing as npt

from gripbench.bench.catalogue.registry import MethodSpec, choose_method
from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.running.execution import execute, missing
from gripbench.bench.running.fitting import fitted
from gripbench.bench.running.isolation.limits import Limits
from gripbench.bench.running.recorded_scenarios import on_recording, recording_of
from gripbench.envs.recordings import Recording
from gripbench.envs.scenarios import Scenario
from gripbench.errors import InputError
from gripbench.writing import DEFAULT_RESULTS


class Runs:
    """A cache of recordings and of what methods make of them."""

    def __init__(self) -> None:
        self._scenarios: dict[str, Scenario] = {}
        self._recordings: dict[tuple[str, int], Recording] = {}
        self._methods: dict[str, MethodSpec] = {}
        self._estimates: dict[tuple[str, str, int], npt.NDArray[Any]] = {}

    def scenario(self, name: str) -> Scenario:
        """Return a scenario, whose file and population are read and checked once."""
        if name not in self._scenarios:
            self._scenarios[name] = find_scenario(name)
        return self._scenarios[name]

    def recording(self, scenario: str, seed: int = 0) -> Recording:
        """Return the recording of a scenario's run."""
        key = (scenario, seed)
        if key not in self._recordings:
            self._recordings[key] = recording_of(self.scenario(scenario), seed)
        return self._recordings[key]

    def method(self, name: str) -> MethodSpec:
        """Return a method by `name[:variant][@parameter=value,...]` or `file.py:Class`."""
        if name not in self._methods:
            spec = fitted(choose_method(name), DEFAULT_RESULTS, Limits())
            if spec.unfitted:
                raise InputError(f"{spec.label}: its fit failed: {spec.unfitted}")
            self._methods[name] = spec
        return self._methods[name]

    def forget(self) -> None:
        """Drop recordings and estimates, so that the memory of a long series of runs is bounded."""
        self._recordings.clear()
        self._estimates.clear()

    def estimates(self, scenario: str, method: str, seed: int = 0) -> npt.NDArray[Any]:
        """Return a method's estimates over a run.

        Parameters
        ----------
        scenario, seed
            The run.
        method
            A choice as `method` takes it.

        Returns
        -------
        Structured array, shape (n,), at the times of the recording's truth.

        Raises
        ------
        InputError
            If the method is unknown or needs what the scenario does not give.
        """
        key = (scenario, method, seed)
        if key not in self._estimates:
            recording = self.recording(scenario, seed)
            spec = on_recording(self.method(method), self.scenario(scenario))
            channels = tuple(recording.observations.dtype.names or ())
            lacking = missing(spec.declaration, recording.vehicle, channels)
            if lacking:
                raise InputError(f"{spec.label} cannot run on {scenario}: {lacking}")
            self._estimates[key] = execute(
                spec.make(),
                spec.declaration,
                recording.vehicle,
                recording.observations,
                period=0.0,
                timed=False,
            ).estimates
        return self._estimates[key]
