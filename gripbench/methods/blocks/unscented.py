"""Sigma points of a mean and covariance out, mean and covariance of what became of them in.

A method keeps a filter in a field of its state (`unscented_type`), calls `draw`, moves the rows of
`points` by its model, calls `gather`; draws again, fills the rows of `outputs` and calls `correct`.
The points are the 2 n of equal weight at the distance sqrt(n) (kappa = 0), so that no weight is
negative and the covariance stays one.

References
----------
S. Julier, J. Uhlmann, Unscented filtering and nonlinear estimation, Proceedings of the IEEE 92
(2004), section III; as the spherical cubature rule I. Arasaratnam, S. Haykin, Cubature Kalman
filters, IEEE Transactions on Automatic Control 54 (2009).
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from gripbench.compilation import compiled


def unscented_type(states: int, outputs: int) -> np.dtype[Any]:
    """Return the structured type of an unscented Kalman filter.

    Parameters
    ----------
    states, outputs
        Numbers n and m.

    Returns
    -------
    Structured type with the fields `x` (n), `P` (n, n), `Q` (n, n) of the noise of a step, `R`
    (m, m) of the measurements, the `points` (2 n, n) and their `outputs` (2 n, m). The other
    fields are scratch space.
    """
    n, m, real = states, outputs, np.float64
    return np.dtype(
        [
            ("outputs", real, (2 * n, m)),  # first: numba takes a record for a subtype of its head
            ("R", real, (m, m)),
            ("points", real, (2 * n, n)),
            ("x", real, (n,)),
            ("P", real, (n, n)),
            ("Q", real, (n, n)),
            ("root", real, (n, n)),
            ("expected", real, (m,)),
            ("S", real, (m, m)),
            ("root_S", real, (m, m)),
            ("gain", real, (n, m)),
        ]
    )


@compiled
def cholesky(A, L):
    """Fill `L` with the lower root of `A`, L L' = A; return whether `A` is positive definite."""
    n = A.shape[0]
    for j in range(n):
        total = A[j, j]
        for k in range(j):
            total -= L[j, k] * L[j, k]
        if not total > 0.0:
            return False
        L[j, j] = sqrt(total)
        for i in range(j + 1, n):
            L[j, i] = 0.0
            total = A[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            L[i, j] = total / L[j, j]
    return True


@compiled
def draw(filter):
    """Place the points: the columns of the root of n P on both sides of the mean."""
    n = filter.x.shape[0]
    L = filter.root
    if not cholesky(filter.P, L):  # rounding only: each variance is kept
        for i in range(n):
            for j in range(n):
                L[i, j] = sqrt(max(filter.P[i, i], 0.0)) if i == j else 0.0
    away = sqrt(float(n))
    for j in range(n):
        for i in range(n):
            filter.points[j, i] = filter.x[i] + away * L[i, j]
            filter.points[n + j, i] = filter.x[i] - away * L[i, j]


@compiled
def gather(filter):
    """Set mean and covariance to those of the points, the noise of the step added."""
    n, count = filter.x.shape[0], filter.points.shape[0]
    x, P, points = filter.x, filter.P, filter.points
    for i in range(n):
        total = 0.0
        for k in range(count):
            total += points[k, i]
        x[i] = total / count
    for i in range(n):
        for j in range(i, n):
            total = 0.0
            for k in range(count):
                total += (points[k, i] - x[i]) * (points[k, j] - x[j])
            P[i, j] = total / count + filter.Q[i, j]
            P[j, i] = P[i, j]


@compiled
def correct(filter, measured):
    """Take measurements, of which `outputs` holds what each point would give.

    Parameters
    ----------
    measured
        The m readings.
    """
    n, m, count = filter.x.shape[0], filter.expected.shape[0], filter.points.shape[0]
    x, P, S, K, L = filter.x, filter.P, filter.S, filter.gain, filter.root_S
    points, outputs, expected = filter.points, filter.outputs, filter.expected
    for a in range(m):
        total = 0.0
        for k in range(count):
            total += outputs[k, a]
        expected[a] = total / count
    for a in range(m):
        for b in range(m):
            total = 0.0
            for k in range(count):
                total += (outputs[k, a] - expected[a]) * (outputs[k, b] - expected[b])
            S[a, b] = total / count + filter.R[a, b]
        for i in range(n):
            total = 0.0
            for k in range(count):
                total += (points[k, i] - x[i]) * (outputs[k, a] - expected[a])
            K[i, a] = total / count
    if not cholesky(S, L):
        return
    for i in range(n):  # K becomes cross L'^-1: P falls by K K', x moves by K L^-1 residual
        for a in range(m):
            total = K[i, a]
            for b in range(a):
                total -= K[i, b] * L[a, b]
            K[i, a] = total / L[a, a]
    for a in range(m):
        total = measured[a] - expected[a]
        for b in range(a):
            total -= L[a, b] * expected[b]
        expected[a] = total / L[a, a]
    for i in range(n):
        for a in range(m):
            x[i] += K[i, a] * expected[a]
    for i in range(n):
        for j in range(i, n):
            total = P[i, j]
            for a in range(m):
                total -= K[i, a] * K[j, a]
            P[i, j] = total
            P[j, i] = total
