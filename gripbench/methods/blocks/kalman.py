"""Kalman filter steps over records, compiled for the size of the filter.

A method keeps a filter in a field of its state::

    state = np.dtype([("filter", filter_type(4)), ...])

sets `F`, `Q` and a measurement row `h`, and calls the functions below with `state.filter`. The
loops run over the filter's own matrices, nothing is allocated. All corrections use the Joseph
form, which keeps the covariance symmetric and non-negative for any gain.

Independent measurements are taken one after the other with `correct_scalar`, which needs no
matrix inverse; correlated ones (a full R) together with `innovation_distance`, then `correct`.

References
----------
D. Simon, Optimal State Estimation, Wiley 2006: (5.19) prediction and Joseph form, section 6.1
sequential measurements.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gripbench.compilation import compiled


def filter_type(states: int, outputs: int = 0) -> np.dtype[Any]:
    """Return the structured type of a Kalman filter.

    Parameters
    ----------
    states
        Number n of states.
    outputs
        Number m of correlated measurements; 0 if all are taken one by one.

    Returns
    -------
    Structured type with the fields `x` (n), its covariance `P` (n, n), the transition matrix
    `F` (n, n), the covariance `Q` (n, n) of the noise of a step and the row `h` (n) of a scalar
    measurement; with `outputs` also `H` (m, n), `R` (m, m) and `residual` (m). The other fields
    are scratch space.
    """
    n, m = states, outputs
    real = np.float64
    fields: list[tuple[str, Any, tuple[int, ...]]] = []
    if m:  # first: numba takes a record for a subtype of one that it begins with
        fields += [
            ("H", real, (m, n)),
            ("R", real, (m, m)),
            ("residual", real, (m,)),
            ("white", real, (m,)),
            ("S", real, (m, m)),
            ("root", real, (m, m)),
            ("cross", real, (n, m)),
            ("K", real, (n, m)),
        ]
    fields += [
        ("x", real, (n,)),
        ("P", real, (n, n)),
        ("F", real, (n, n)),
        ("Q", real, (n, n)),
        ("h", real, (n,)),
        ("work", real, (max(3, n), n)),
    ]
    return np.dtype(fields)


@compiled
def predict_covariance(filter):
    """Advance the covariance by one step, P = F P F' + Q; an EKF advances `x` itself."""
    n = filter.x.shape[0]
    P, F, Q, W = filter.P, filter.F, filter.Q, filter.work
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += F[i, k] * P[k, j]
            W[i, j] = total
    for i in range(n):
        for j in range(i, n):
            total = Q[i, j]
            for k in range(n):
                total += W[i, k] * F[j, k]
            P[i, j] = total
            P[j, i] = total


@compiled
def predict(filter):
    """Advance mean and covariance by one step, x = F x; inputs are the caller's to add."""
    n = filter.x.shape[0]
    x, F, W = filter.x, filter.F, filter.work
    for i in range(n):
        total = 0.0
        for k in range(n):
            total += F[i, k] * x[k]
        W[0, i] = total
    for i in range(n):
        x[i] = W[0, i]
    predict_covariance(filter)


@compiled
def innovation_variance(filter, variance):
    """Return what variance the innovation of a measurement with row `h` has, h' P h + variance."""
    n = filter.x.shape[0]
    total = variance
    for i in range(n):
        for j in range(n):
            total += filter.h[i] * filter.P[i, j] * filter.h[j]
    return total


@compiled
def correct_scalar(filter, residual, variance):
    """Take one measurement with row `h`; return its normalised innovation squared.

    `residual` is measurement less prediction, `variance` that of the measurement. A measurement
    that carries no information (zero innovation variance) changes nothing and returns 0.
    """
    n = filter.x.shape[0]
    x, P, h, W = filter.x, filter.P, filter.h, filter.work
    s = variance
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += P[i, j] * h[j]
        W[0, i] = total
        s += h[i] * total
    if not s > 0.0:
        return 0.0
    for i in range(n):
        gain = W[0, i] / s
        W[1, i] = gain
        x[i] += gain * residual
    # Joseph form as two products of rank one: A = (I - K h') P, then A (I - h K') + K r K'.
    for i in range(n):
        total = 0.0
        for j in range(n):
            P[i, j] -= W[1, i] * W[0, j]
            total += P[i, j] * h[j]
        W[2, i] = total
    for i in range(n):
        for j in range(i, n):
            value = P[i, j] - W[2, i] * W[1, j] + variance * W[1, i] * W[1, j]
            P[i, j] = value
            P[j, i] = value
    return residual * residual / s


@compiled
def innovation_distance(filter):
    """Return d^2 = residual' S^-1 residual of the measurements with `H`, `R` and `residual`.

    Prepares `correct`. Returns inf if S = H P H' + R is not positive definite; such measurements
    must not be taken.
    """
    n = filter.x.shape[0]
    m = filter.residual.shape[0]
    P, H, S, L, B = filter.P, filter.H, filter.S, filter.root, filter.cross
    for i in range(n):
        for j in range(m):
            total = 0.0
            for k in range(n):
                total += P[i, k] * H[j, k]
            B[i, j] = total
    for i in range(m):
        for j in range(m):
            total = filter.R[i, j]
            for k in range(n):
                total += H[i, k] * B[k, j]
            S[i, j] = total
    for j in range(m):
        total = S[j, j]
        for k in range(j):
            total -= L[j, k] * L[j, k]
        if not total > 0.0:
            return np.inf
        L[j, j] = np.sqrt(total)
        for i in range(j + 1, m):
            total = S[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            L[i, j] = total / L[j, j]
    distance = 0.0
    white = filter.white
    for j in range(m):
        total = filter.residual[j]
        for k in range(j):
            total -= L[j, k] * white[k]
        white[j] = total / L[j, j]
        distance += white[j] * white[j]
    return distance


@compiled
def correct(filter):
    """Take the measurements for which `innovation_distance` was called last."""
    n = filter.x.shape[0]
    m = filter.residual.shape[0]
    P, H, R, L, B, K, W = (
        filter.P, filter.H, filter.R, filter.root, filter.cross, filter.K, filter.work,
    )  # fmt: skip
    for i in range(n):  # K S = B with S = L L', by two triangular solutions
        for j in range(m):
            total = B[i, j]
            for k in range(j):
                total -= K[i, k] * L[j, k]
            K[i, j] = total / L[j, j]
        for back in range(m):
            j = m - 1 - back
            total = K[i, j]
            for k in range(j + 1, m):
                total -= K[i, k] * L[k, j]
            K[i, j] = total / L[j, j]
    for i in range(n):
        for j in range(m):
            filter.x[i] += K[i, j] * filter.residual[j]
    for i in range(n):
        for j in range(n):
            total = P[i, j]
            for k in range(m):
                total -= K[i, k] * B[j, k]
            W[i, j] = total
    for i in range(n):  # B becomes A H' with A = (I - K H) P, less K R
        for j in range(m):
            total = 0.0
            for k in range(n):
                total += W[i, k] * H[j, k]
            for k in range(m):
                total -= K[i, k] * R[k, j]
            B[i, j] = total
    for i in range(n):
        for j in range(i, n):
            total = W[i, j]
            for k in range(m):
                total -= B[i, k] * K[j, k]
            P[i, j] = total
            P[j, i] = total
