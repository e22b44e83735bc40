"""Dugoff tyre: from the normalised slip s, the secant slope f(s)/s and the slope f'(s).

f(s) = s up to s = 1/2, then 1 - 1/(4 s): equations 2 to 4 of Dakhlallah, Glaser, Mammar &
Sebsadji (2008).
"""

from __future__ import annotations

from gripbench.compilation import inlined


@inlined
def secant(s):
    """Return f(s) / s for s >= 0."""
    if s < 0.5:
        return 1.0
    return (1.0 - 0.25 / s) / s


@inlined
def tangent(s):
    """Return f'(s) for s >= 0."""
    return 1.0 if s < 0.5 else 0.25 / (s * s)
