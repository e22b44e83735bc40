"""Slopes and noise along a run in, the least covariance of any estimate of its states out.

The recursion of Tichavsky, Muravchik & Nehorai (1998) for additive Gaussian noise, in terms of the
covariance J^-1 instead of the information J, so that states without noise (constants) and readings
without error are no special case. With

    x(k+1) = F x(k) + G r(k) + w,    r(k+1) = D r(k) + v,    y = C z + e,    z = (x, r)

their equations 21 and 22 read: predict P with (F, G, D), then for every reading
P <- P - P c c' P / (c' P c + R). Where the model is linear and Gaussian this is the Kalman
filter's covariance, and the bound is reached.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gripbench.compilation import compiled

Floats = npt.NDArray[np.float64]

DIRECT, NONE = -2, -1
"""Instead of a slot: the reading is of now, or there is none."""

_TERMS = 12  # of the exponential's series: below half an ulp for a matrix of norm 1/2


@dataclass(frozen=True)
class Motion:
    """How states move from each of n samples to the next.

    Attributes
    ----------
    transition
        F and G, shape (n - 1, states, states + those of the rest that act on them).
    noise
        Covariance of w, shape (n - 1, states, states).
    decay
        Diagonal of D, shape (n - 1, size); entries of the states are not used.
    spread
        Variance of v, shape (n - 1, size).
    driven
        Covariance of v of the first entries of the rest, in place of a diagonal,
        shape (n - 1, m, m).
    """

    transition: Floats
    noise: Floats
    decay: Floats
    spread: Floats
    driven: Floats


@dataclass(frozen=True)
class Readings:
    """What is read at each of n samples, by m instruments.

    Attributes
    ----------
    rows
        Slope of each reading to z, shape (n, m, size).
    variance
        R of each, shape (m,).
    take
        Slot of z into which a reading is taken to be given later, else `NONE`, shape (n, m).
    read
        Slot whose content is given, or `DIRECT`, or `NONE`, shape (n, m).
    """

    rows: Floats
    variance: Floats
    take: npt.NDArray[np.int64]
    read: npt.NDArray[np.int64]


@compiled
def discretise(slopes, step, parts, jumps):
    """Return transition and noise of a linear plant between samples.

    The matrix exponential of the slopes' mean over the interval, by scaling and squaring: exact
    for slopes that hold still, however stiff.

    Parameters
    ----------
    slopes
        Of the states' rates to the states, then to what acts on them, shape (n, states, all).
    step
        Time between samples [s].
    parts
        Steps of the plant in it; after each come the jumps.
    jumps
        Standard deviation of the states' jumps, shape (n, states).

    Returns
    -------
    Shapes (n - 1, states, all) and (n - 1, states, states).
    """
    n, states, size = slopes.shape
    moves = np.zeros((n - 1, states, size))
    noise = np.zeros((n - 1, states, states))
    eye = np.eye(states)
    for k in range(n - 1):
        mean = 0.5 * step / parts * (slopes[k] + slopes[k + 1])
        a = np.ascontiguousarray(mean[:, :states])
        largest = 0.0
        for i in range(states):
            total = 0.0
            for j in range(states):
                total += abs(a[i, j])
            largest = max(largest, total)
        halvings = int(min(max(math.ceil(math.log2(max(largest, 1e-300))) + 1, 0), 60))
        a = a * 0.5**halvings
        b = np.ascontiguousarray(mean[:, states:]) * 0.5**halvings
        series = eye.copy()
        for j in range(_TERMS, 0, -1):
            series = eye + np.dot(a, series) / (j + 1)
        hold = eye + np.dot(a, series)
        push = np.dot(series, b)
        for _ in range(halvings):
            push = push + np.dot(hold, push)
            hold = np.dot(hold, hold)
        whole, pushed, spread = hold.copy(), push.copy(), np.zeros((states, states))
        for part in range(parts):
            if part > 0:
                whole = np.dot(hold, whole)
                pushed = np.dot(hold, pushed) + push
            spread = np.dot(np.dot(hold, spread), hold.T)
            for i in range(states):
                spread[i, i] += jumps[k, i] ** 2
        moves[k, :, :states] = whole
        moves[k, :, states:] = pushed
        noise[k] = spread
    return moves, noise


def least_variance(
    start: Floats, motion: Motion, readings: Readings, targets: Floats
) -> tuple[Floats, Floats]:
    """Return the least variance of targets after each sample, and the information gained there.

    Parameters
    ----------
    start
        Covariance of z before the first reading, shape (size, size).
    motion, readings
        Of n samples.
    targets
        Slope of each target to z, shape (n, t, size).

    Returns
    -------
    Both of shape (n, t): variance, and what the readings of a sample add to its inverse.
    """
    covariance = np.array(start, dtype=np.float64)
    return _recursion(
        covariance, motion.transition, motion.noise, motion.decay, motion.spread, motion.driven,
        readings.rows, readings.variance, readings.take, readings.read, targets,
    )  # fmt: skip


@compiled
def _recursion(
    p, moves, noise, decay, spread, driven, rows, variance, take, read, targets
):  # fmt: skip
    n = targets.shape[0]
    found = np.zeros((n, targets.shape[1]))
    gained = np.zeros((n, targets.shape[1]))
    column = np.zeros(p.shape[0])
    for k in range(n):
        if k > 0:
            _predict(p, moves[k - 1], noise[k - 1], decay[k - 1], spread[k - 1], driven[k - 1])
        for t in range(targets.shape[1]):
            found[k, t] = _form(p, targets[k, t])
        for j in range(rows.shape[1]):
            slot = read[k, j]
            if slot == NONE:
                continue
            if slot == DIRECT:
                _times(p, rows[k, j], column)
                within = max(_dot(rows[k, j], column), 0.0) + variance[j]
            else:
                column[:] = p[slot]
                within = max(p[slot, slot], 0.0) + variance[j]
            if within > 0.0:
                _subtract(p, column, within)
        for j in range(rows.shape[1]):
            slot = take[k, j]
            if slot >= 0:
                _clone(p, rows[k, j], slot, column)
        for t in range(targets.shape[1]):
            after = max(_form(p, targets[k, t]), 0.0)
            if after > 0.0 and found[k, t] > after:
                gained[k, t] = 1.0 / after - 1.0 / found[k, t]
            found[k, t] = after
    return found, gained


@compiled
def _predict(p, moves, noise, decay, spread, driven):
    states, acting = moves.shape
    size = p.shape[0]
    ahead = np.dot(moves, p[:acting])
    p[:states, :states] = np.dot(np.ascontiguousarray(ahead[:, :acting]), moves.T) + noise
    for i in range(states):
        for j in range(states, size):
            p[i, j] = ahead[i, j] * decay[j]
            p[j, i] = p[i, j]
    for i in range(states, size):
        if decay[i] != 1.0:
            for j in range(states, size):
                p[i, j] *= decay[i]
                p[j, i] *= decay[i]
        p[i, i] += spread[i]
    for i in range(driven.shape[0]):
        for j in range(driven.shape[0]):
            p[states + i, states + j] += driven[i, j]


@compiled
def _clone(p, row, slot, column):
    """Put what a row reads now into a slot, where it stays."""
    p[slot] = 0.0
    p[:, slot] = 0.0
    _times(p, row, column)
    value = _dot(row, column)
    p[slot] = column
    p[:, slot] = column
    p[slot, slot] = value


@compiled
def _times(p, row, column):
    column[:] = 0.0
    for i in range(row.shape[0]):
        if row[i] != 0.0:
            weight = row[i]
            for j in range(row.shape[0]):
                column[j] += weight * p[i, j]


@compiled
def _dot(row, column):
    total = 0.0
    for i in range(row.shape[0]):
        total += row[i] * column[i]
    return total


@compiled
def _form(p, row):
    total = 0.0
    for i in range(row.shape[0]):
        if row[i] != 0.0:
            inside = 0.0
            for j in range(row.shape[0]):
                inside += p[i, j] * row[j]
            total += row[i] * inside
    return total


@compiled
def _subtract(p, column, within):
    for i in range(column.shape[0]):
        if column[i] != 0.0:
            weight = column[i] / within
            for j in range(column.shape[0]):
                p[i, j] -= weight * column[j]
