"""The matrix exponential, compiled: exact transition and input matrices of a linear model.

With inputs held over a step h, exp([[A, B], [0, 0]] h) holds the transition matrix exp(A h) and
the input matrix beside it (Franklin, Powell & Workman, Digital Control, 4.3).
"""

from __future__ import annotations

from gripbench.compilation import compiled

_TERMS = 10  # of the series; exact to rounding for a norm below 1/8


@compiled
def exponential(M, E, work):
    """Fill `E` with exp(M): series of a halved matrix, squared back; `M` is overwritten.

    Parameters
    ----------
    M, E, work
        Square matrices of the same size; `work` is scratch space.
    """
    n = M.shape[0]
    norm = 0.0
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += abs(M[i, j])
        norm = max(norm, total)
    halvings = 0
    while norm > 0.125 and halvings < 60:
        norm *= 0.5
        halvings += 1
    scale = 0.5**halvings
    for i in range(n):
        for j in range(n):
            M[i, j] *= scale
            E[i, j] = 1.0 if i == j else 0.0
    for back in range(_TERMS):  # Horner: E = I + M E / k for k from the last term down
        k = _TERMS - back
        for i in range(n):
            for j in range(n):
                total = 0.0
                for m in range(n):
                    total += M[i, m] * E[m, j]
                work[i, j] = total / k
        for i in range(n):
            for j in range(n):
                E[i, j] = work[i, j] + (1.0 if i == j else 0.0)
    for _ in range(halvings):
        for i in range(n):
            for j in range(n):
                total = 0.0
                for m in range(n):
                    total += E[i, m] * E[m, j]
                work[i, j] = total
        for i in range(n):
            for j in range(n):
                E[i, j] = work[i, j]
