"""A recording: what one run of a scenario, or one log of a vehicle, left behind."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.envs.vehicles import CarOnPaper


@dataclass(frozen=True)
class Bounds:
    """What is known of a signal where no instrument gave it: it lay within an interval.

    Attributes
    ----------
    signal
        Name of the signal.
    low, high
        The interval, SI units; one side may be infinite.
    start, end
        When it holds [s].
    """

    signal: str
    low: float
    high: float
    start: float = -np.inf
    end: float = np.inf


@dataclass(frozen=True)
class Recording:
    """Observations and truth of one run.

    Attributes
    ----------
    scenario
        Name of the scenario.
    seed
        Seed of the run.
    vehicle
        Values of the vehicle's parameters by name, SI units: what an engineer knows on paper.
    observations
        Structured array, shape (n,): `time` and every channel that a sensor of the scenario
        gives. This is all that a method may see.
    truth
        Structured array, shape (n,): the plant's own values at the same times.
    score_from
        Samples before this time [s] do not count in any score.
    termination
        Why the run ended before its horizon; empty if it did not.
    notes
        Further facts of the run that a score may need (such as the time of a friction step).
    windows
        Named lists of intervals [s], such as `train` and `test`; empty for a simulated run.
    clean
        The observations without the faults of the instruments; None where there are none.
    bounds
        Intervals in which signals are known to lie where the truth is not known.
    """

    scenario: str
    seed: int
    vehicle: CarOnPaper
    observations: npt.NDArray[Any]
    truth: npt.NDArray[Any]
    score_from: float = 0.0
    termination: str = ""
    notes: dict[str, float] = field(default_factory=dict)
    windows: dict[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    bounds: tuple[Bounds, ...] = ()
    clean: npt.NDArray[Any] | None = None
