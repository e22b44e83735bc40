"""A curve fitted to measured tyres: from the normalised slip s, f(s)/s and the slope f'(s).

Burckhardt's curve for dry asphalt, mu(lambda) = c1 (1 - exp(-c2 lambda)) - c3 lambda with
c = (1.2801, 23.99, 0.52) (Kiencke & Nielsen, Automotive Control Systems, table 9.1), scaled to a
peak of 1 and a slope of 1 at zero slip. It rises sooner and falls further behind its peak than the
Magic Formula. Beyond lambda = 1, a locked wheel, it stays.
"""

from __future__ import annotations

import math

from gripbench.compilation import inlined

_C1, _C2, _C3 = 1.2801, 23.99, 0.52
_PEAK_SLIP = math.log(_C1 * _C2 / _C3) / _C2
_PEAK = _C1 * (1.0 - math.exp(-_C2 * _PEAK_SLIP)) - _C3 * _PEAK_SLIP
_SLIP = _PEAK / (_C1 * _C2 - _C3)  # lambda over s
_LOCKED = 1.0 / _SLIP
_LOCKED_FORCE = (_C1 * (1.0 - math.exp(-_C2)) - _C3) / _PEAK


@inlined
def secant(s):
    """Return f(s) / s for s >= 0."""
    if s < 1e-6:
        return 1.0
    if s >= _LOCKED:
        return _LOCKED_FORCE / s
    slip = _SLIP * s
    return (-_C1 * math.expm1(-_C2 * slip) - _C3 * slip) / (_PEAK * s)


@inlined
def tangent(s):
    """Return f'(s) for s >= 0."""
    if s >= _LOCKED:
        return 0.0
    return (_C1 * _C2 * math.exp(-_C2 * _SLIP * s) - _C3) * _SLIP / _PEAK
