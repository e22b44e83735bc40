"""A method that takes whole recordings only: estimates out, causal as far as random cuts can tell.

Such a method is given the samples at once, so nothing keeps it from the later ones by itself. It
therefore runs again over beginnings of the recording, each in a new process that holds no sample
behind the cut, and must give there what it gave with all of them. Where to cut is drawn anew for
every cell from the system's randomness; no process learns where the others were cut. Estimates that
look ahead by any number of samples differ at every cut; a method that looks ahead in a share f of
the samples passes a cell with (1 - f)^CUTS.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.scoring.scoring import EstimateError

CUTS = 5
"""Beginnings of a recording over which a method runs again."""

TOLERANCE = 1e-9
"""Difference over the largest value that rounding may make in sums of another length."""

Records = npt.NDArray[Any]

Perform = Callable[[str, Mapping[str, float], Records, float], list[Records]]
"""Makes a trial of a method in a new process; see `trials.FORMS`."""


class LooksAheadError(EstimateError):
    """Estimates of a sample depend on later ones."""


def run_over_prefixes(
    perform: Perform, vehicle: Mapping[str, float], observations: Records, period: float
) -> tuple[Records, float]:
    """Return the estimates over a recording, shape (n,), and the time of a step [s].

    Parameters
    ----------
    perform
        Runs the method in a new process.
    vehicle
        Vehicle parameters by name.
    observations
        Structured array, shape (n,): the declared channels and `time`.
    period
        Nominal time [s] between samples.

    Raises
    ------
    LooksAheadError
        If estimates change where later samples are cut off.
    """
    cuts = {2 + secrets.randbelow(max(len(observations) - 2, 1)) for _ in range(CUTS)}
    whole, timed = perform("whole", vehicle, observations, period)
    for length in sorted(cuts):
        if length < len(observations):
            part, _ = perform("whole", vehicle, observations[:length], period)
            check_beginning(whole, part)
    return whole, float(timed[0].item()[0])


def check_beginning(whole: Records, part: Records) -> None:
    """Raise LooksAheadError where the estimates of a beginning are others than those of all."""
    for name in part.dtype.names or ():
        one, other = whole[name][: len(part)], part[name]
        scale = float(np.nanmax(np.abs(one), initial=0.0))
        with np.errstate(invalid="ignore"):
            same = (np.abs(one - other) <= TOLERANCE * scale) | (one == other)
        same |= np.isnan(one) & np.isnan(other)
        if not same.all():
            raise LooksAheadError(
                f"not causal: its estimate '{name}' of sample {int(np.argmin(same))} changes when "
                f"the samples from {len(part)} on are cut off"
            )
