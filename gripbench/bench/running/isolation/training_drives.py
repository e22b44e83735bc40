"""Training drives: a recording in, what a method's `fit` is given of it out, and over a pipe.

A method sees the channels that it declares, as in a run, and beside them the truth of what it
estimates and of the signals that it names in `training_truth`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.catalogue.declarations import Declaration
from gripbench.bench.running.isolation.messages import message_bytes
from gripbench.bench.scoring.scoring import at_lag
from gripbench.envs.recordings import Recording
from gripbench.envs.signals import record_type
from gripbench.methods.samples import select_channels


@dataclass(frozen=True)
class TrainingDrive:
    """One drive that a method is fitted on.

    Attributes
    ----------
    scenario
        Name of its scenario.
    vehicle
        The car on paper, by parameter.
    observations
        Structured array, shape (n,): the declared channels and `time`.
    truth
        Structured array, shape (n,): `time` and the truth of the estimates, and of the signals of
        `training_truth`, that the scenario has.
    score_from
        Samples before this time [s] count in no score.
    """

    scenario: str
    vehicle: dict[str, float]
    observations: npt.NDArray[Any]
    truth: npt.NDArray[Any]
    score_from: float = 0.0

    def messages(self) -> Iterator[bytes]:
        """Yield the drive as bytes: a message, then the content of both arrays."""
        yield message_bytes(
            {
                "scenario": self.scenario,
                "vehicle": self.vehicle,
                "observations": self.observations.dtype.names,
                "truth": self.truth.dtype.names,
                "samples": len(self.truth),
                "score_from": self.score_from,
            }
        )
        yield self.observations.tobytes()
        yield self.truth.tobytes()


def training_drive(recording: Recording, declaration: Declaration) -> TrainingDrive:
    """Return what a method's `fit` is given of a recording."""
    recording = at_lag(recording, declaration.lag)
    names = ("time", *declaration.estimates, *declaration.training_truth)
    known = [name for name in dict.fromkeys(names) if name in (recording.truth.dtype.names or ())]
    truth = np.empty(len(recording.truth), record_type(known))
    for name in known:
        truth[name] = recording.truth[name]
    return TrainingDrive(
        recording.scenario,
        dict(recording.vehicle),
        select_channels(recording.observations, declaration.sensors),
        truth,
        recording.score_from,
    )


def received(head: dict[str, Any], receive: Callable[[int], bytes]) -> TrainingDrive:
    """Return the drive that a message announces."""
    observations, truth = (
        np.frombuffer(receive(head["samples"] * kind.itemsize), kind)
        for kind in map(record_type, (head["observations"], head["truth"]))
    )
    return TrainingDrive(head["scenario"], head["vehicle"], observations, truth, head["score_from"])
