"""Magic Formula tyre of one shape: from the normalised slip s, secant slope f(s)/s and slope f'(s).

f(s) = sin(C atan(s / C)) with C = 1.3 (Pacejka, Tire and Vehicle Dynamics, section 4.3, E = 0).
"""

from __future__ import annotations

import math

from gripbench.compilation import inlined

MAGIC_SHAPE = 1.3
"""Shape factor C."""


@inlined
def secant(s):
    """Return f(s) / s for s >= 0."""
    if s < 1e-6:
        return 1.0
    return math.sin(MAGIC_SHAPE * math.atan(s / MAGIC_SHAPE)) / s


@inlined
def tangent(s):
    """Return f'(s) for s >= 0."""
    inner = s / MAGIC_SHAPE
    return math.cos(MAGIC_SHAPE * math.atan(inner)) / (1.0 + inner * inner)
