"""A simulation: one run of a scenario's plant, advanced sample by sample or in one loop."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Action:
    """One input of a plant: its signal name, unit and range."""

    name: str
    unit: str
    low: float
    high: float
    description: str


class Simulation(ABC):
    """One run of a plant.

    The Gymnasium environment calls `reset`, `drive` and `advance` once a sample; a recording is
    made by `run`, one compiled loop. Both call the same compiled functions, so they give
    identical bytes.

    Attributes
    ----------
    actions
        The plant's inputs, in the order of an action vector.
    truth_type
        Structured type of one sample of the truth, `time` first.
    sample_time
        Time [s] between samples; None where the integrator chooses them.
    termination
        Why the run ended before its horizon (a spin, a roll-over); empty while it goes on.
    """

    actions: ClassVar[tuple[Action, ...]]
    truth_type: ClassVar[np.dtype[Any]]
    termination: str = ""
    sample_time: float | None

    @abstractmethod
    def reset(self, seed: int) -> npt.NDArray[Any]:
        """Start a run; return its first sample, a structured array of shape (1,)."""

    @abstractmethod
    def drive(self) -> npt.NDArray[np.float64]:
        """Return what the scenario's own driver commands next, shape (len(actions),)."""

    @abstractmethod
    def advance(self, action: npt.NDArray[np.float64]) -> npt.NDArray[Any]:
        """Hold an action for one sample time; return the sample at its end, shape (1,)."""

    @abstractmethod
    def run(self, seed: int) -> npt.NDArray[Any]:
        """Run to the horizon or termination under the scenario's driver.

        Returns
        -------
        Structured array, shape (n,): the truth at every sample, the first included.
        """

    def notes(self) -> dict[str, float]:
        """Return facts of the run that a score may need, by name."""
        return {}

    def path(self) -> npt.NDArray[np.float64]:
        """Return the path that the driver follows, north and west [m], shape (n, 2).

        No rows where there is none; known once the run has been started.
        """
        return np.zeros((0, 2))

    @classmethod
    def together(cls, simulations: Sequence[Any]) -> Lanes:
        """Return runs of one scenario that advance together."""
        return Lanes(simulations)


class Lanes:
    """Several runs of one scenario, advanced one after the other.

    A world whose plant can advance them in one compiled call derives from this.

    Parameters
    ----------
    simulations
        One simulation a lane.
    """

    def __init__(self, simulations: Sequence[Simulation]) -> None:
        self._simulations = list(simulations)

    @property
    def terminations(self) -> list[str]:
        """Why each lane has ended; empty while it goes on."""
        return [simulation.termination for simulation in self._simulations]

    def path(self, lane: int) -> npt.NDArray[np.float64]:
        """Return the path of a lane, see `Simulation.path`."""
        return self._simulations[lane].path()

    def replace(self, lane: int, simulation: Simulation) -> None:
        """Put another simulation into a lane; it has the same sample time and is reset next."""
        self._simulations[lane] = simulation

    def reset(self, lane: int, seed: int) -> npt.NDArray[Any]:
        """Start a lane; return its first sample, shape (1,)."""
        return self._simulations[lane].reset(seed)

    def drive(self) -> npt.NDArray[np.float64]:
        """Return what the scenario's driver commands in each lane, shape (lanes, inputs).

        Zero in a lane that the simulation has ended.
        """
        nothing = np.zeros(len(self._simulations[0].actions))
        return np.stack([nothing if one.termination else one.drive() for one in self._simulations])

    def advance(
        self, actions: npt.NDArray[np.float64], going: npt.NDArray[np.bool_]
    ) -> npt.NDArray[Any]:
        """Hold the actions for one sample time.

        Parameters
        ----------
        actions
            Shape (lanes, inputs).
        going
            Lanes that advance, shape (lanes,); the others' rows of the result are zero.

        Returns
        -------
        Structured array, shape (lanes,): the sample at the end.
        """
        truth = np.zeros(len(self._simulations), self._simulations[0].truth_type)
        for lane in np.flatnonzero(going):
            truth[lane] = self._simulations[lane].advance(actions[lane])[0]
        return truth
