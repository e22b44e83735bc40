"""How an estimate of the available friction answers lateral excitation.

Without excitation the friction of the road cannot be seen, whatever the method: an estimate is
then its first guess. So besides the error over all samples there is one that counts from the
first excitation on, and the time that the estimate takes to get there.

Excitation
    |a_y| above `EXCITED` mu g, a_y as an accelerometer in the vehicle feels it.
Delay
    Time [s] from the first excited sample to the first one from which the estimate stays within
    `BAND` of the true friction for `HOLD` seconds. Where the friction jumps it has to get there
    before the jump.
Delay after a jump
    The same from the time at which the first wheel stands on the other friction.
"""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

from gripbench.bench.running.rows import FrictionResponse
from gripbench.envs.vehicles import GRAVITY

EXCITED = 0.3
"""Share of mu g above which a lateral acceleration excites the tyres."""

BAND = 0.2
"""Largest relative error of an estimate that has settled."""

HOLD = 1.0
"""Time [s] for which it has to stay there."""

_TICK = 1e-9  # s; times are sums of steps


def is_available_friction(target: str) -> bool:
    """Tell whether a signal is the friction that the road has, not the one that is used."""
    return target == "mu" or (target.startswith("mu_") and not target.startswith("mu_used"))


def friction_response(
    times: npt.NDArray[np.float64],
    estimate: npt.NDArray[np.float64],
    truth: npt.NDArray[np.float64],
    accel_y: npt.NDArray[np.float64],
    score_from: float,
    jump_time: float,
) -> FrictionResponse | None:
    """Return the response of one run, None where nothing excites the tyres.

    Parameters
    ----------
    times, estimate, truth, accel_y
        Time [s], estimated and true friction [-], lateral acceleration [m/s^2], shape (n,).
    score_from
        Samples before this time [s] do not count.
    jump_time
        When the friction jumps [s]; NaN: it does not.
    """
    jumped = not math.isnan(jump_time)
    found = _respond(times, estimate, truth, accel_y, score_from, jump_time)
    squares, count, delay, jump_delay = found
    if count == 0.0:
        return None
    return FrictionResponse(
        sum_of_squares=squares,
        count=int(count),
        delay=None if math.isnan(delay) else delay,
        jumped=jumped,
        jump_delay=None if math.isnan(jump_delay) else jump_delay,
    )


@numba.njit(cache=True, error_model="numpy", nogil=True)
def _respond(times, estimate, truth, accel_y, score_from, jump_time):  # type: ignore[no-untyped-def]
    """Return squares and samples from the first excitation on, delay and delay after a jump."""
    size = times.size
    first = size
    jump = size
    squares = 0.0
    count = 0.0
    for k in range(size):
        if times[k] < score_from:
            continue
        if first == size and abs(accel_y[k]) > EXCITED * truth[k] * GRAVITY:
            first = k
        if jump == size and times[k] >= jump_time - _TICK:
            jump = k
        if first < size and np.isfinite(truth[k]):
            squares += (estimate[k] - truth[k]) ** 2
            count += 1.0
    delay = _settling(times, estimate, truth, first, jump if jump > first else size)
    return squares, count, delay, _settling(times, estimate, truth, jump, size)


@numba.njit(cache=True, error_model="numpy", nogil=True)
def _settling(times, estimate, truth, start, end):  # type: ignore[no-untyped-def]
    """Return the time from sample `start` until the estimate stays, NaN if it does not."""
    since = np.nan
    for k in range(start, end):
        if not abs(estimate[k] - truth[k]) <= BAND * truth[k]:
            since = np.nan
            continue
        if np.isnan(since):
            since = times[k]
        if times[k] - since >= HOLD - _TICK:
            return since - times[start]
    return np.nan
