"""Estimate of the available friction in one run into its response to excitation.

Without excitation the friction of the road cannot be seen, whatever the method: an estimate is
then its first guess. So besides the error over all samples there are the error where the tyres
are excited, the error from the first excitation on, and the time that the estimate takes.

Excitation
    |a_y| above `EXCITED` mu g, a_y as an accelerometer in the vehicle feels it; for
    `rms_excited`, utilisation |a|/(mu g) above `EXCITED`.
Delay
    Time [s] from the first excited sample to the first one from which the estimate stays within
    `BAND` of the true friction for `HOLD` seconds. Where the friction jumps it has to get there
    before the jump.
Delay after a jump
    The same from the time at which the first wheel stands on the other friction.
"""

from __future__ import annotations

import math

import numpy as np

from gripbench.bench.scoring.metric import Context, Floats, Metric, running_total
from gripbench.bench.scoring.settling import TICK, first_stay
from gripbench.envs.vehicles import GRAVITY

EXCITED = 0.3
"""Share of mu g above which an acceleration excites the tyres."""

BAND = 0.2
"""Largest relative error of an estimate that has settled."""

HOLD = 1.0
"""Time [s] for which it has to stay there."""


def is_available_friction(target: str) -> bool:
    """Tell whether a signal is the friction that the road has, not the one that is used."""
    return target == "mu" or (target.startswith("mu_") and not target.startswith("mu_used"))


def first_excited(truth: Floats, context: Context) -> int | None:
    """Return the first sample that excites the tyres sideways; None: none, or another target."""
    accel_y = context.channels("accel_y") if is_available_friction(context.target) else None
    if accel_y is None:
        return None
    excited = np.abs(accel_y) > EXCITED * truth * GRAVITY
    return int(np.argmax(excited)) if excited.any() else None


def _jump(time: Floats, context: Context) -> int:
    """Return the first sample after the jump of the friction, the number of samples without one."""
    at = context.notes.get("mu_jump_time", math.nan)
    return len(time) if math.isnan(at) else int(np.searchsorted(time, at - TICK))


def squares_from_excitation(
    time: Floats, estimate: Floats, truth: Floats, context: Context
) -> tuple[float, int] | None:
    """Return squares and samples from the first excitation on."""
    first = first_excited(truth, context)
    if first is None:
        return None
    error = (estimate - truth)[first:]
    return running_total(error * error), len(error)


def squares_while_excited(
    time: Floats, estimate: Floats, truth: Floats, context: Context
) -> tuple[float, int] | None:
    """Return squares and samples of those at which the tyres are excited."""
    used = context.utilisation if is_available_friction(context.target) else None
    if used is None:
        return None
    error = (estimate - truth)[used > EXCITED]
    return running_total(error * error), len(error)


def delay(time: Floats, estimate: Floats, truth: Floats, context: Context) -> float | None:
    """Return the time [s] from the first excitation until the estimate has settled."""
    first = first_excited(truth, context)
    if first is None:
        return None
    jump = _jump(time, context)
    return _settling(time, estimate, truth, first, jump if jump > first else len(time))


def jump_delay(time: Floats, estimate: Floats, truth: Floats, context: Context) -> float | None:
    """Return the time [s] from the jump of the friction until the estimate has settled again."""
    jumps = not math.isnan(context.notes.get("mu_jump_time", math.nan))
    if not jumps or first_excited(truth, context) is None:
        return None
    return _settling(time, estimate, truth, _jump(time, context), len(time))


def _settling(time: Floats, estimate: Floats, truth: Floats, start: int, end: int) -> float:
    part = slice(start, end)
    within = np.abs(estimate[part] - truth[part]) <= BAND * truth[part]
    since = first_stay(time[part], within, HOLD - TICK)
    return math.inf if math.isnan(since) else since - float(time[start])


METRICS = (
    Metric(
        "rms_excited",
        "RMS excited",
        "RMS where more than .3 of the available friction is used",
        squares_while_excited,
        "root_mean",
    ),
    Metric(
        "excited_rms",
        "RMS from excitation",
        "RMS from the first lateral excitation on",
        squares_from_excitation,
        "root_mean",
    ),
    Metric(
        "friction_delay",
        "Delay",
        "Median time from the first excitation until the estimate stays within 20 %",
        delay,
        "median",
        "s",
        reached="settled",
        format=".2f",
    ),
    Metric(
        "jump_delay",
        "Delay after a jump",
        "Median time from a jump of the friction until the estimate stays within 20 %",
        jump_delay,
        "median",
        "s",
        reached="jump_settled",
        format=".2f",
    ),
)
