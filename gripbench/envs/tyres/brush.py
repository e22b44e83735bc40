"""Brush tyre: from the normalised slip s, the secant slope f(s)/s and the slope f'(s).

f(s) = s - s^2/3 + s^3/27 up to full sliding at s = 3, then 1: a parabolic pressure over the
contact patch (Pacejka, Tire and Vehicle Dynamics, section 3.2; equation 15 of Yoon, Li & Ahn).
"""

from __future__ import annotations

from gripbench.compilation import inlined

_SLIDING = 3.0


@inlined
def secant(s):
    """Return f(s) / s for s >= 0."""
    if s < _SLIDING:
        return 1.0 - s / 3.0 + s * s / 27.0
    return 1.0 / s


@inlined
def tangent(s):
    """Return f'(s) for s >= 0."""
    return (1.0 - s / _SLIDING) ** 2 if s < _SLIDING else 0.0
