"""Tyre forces under combined slip: brush, Dugoff and Magic Formula behind one interface.

Each shape is a function f of the normalised slip

    s = |(C_x sigma_x, C_y sigma_y)| / (mu F_z)

and the force is mu F_z f(s) along (C_x sigma_x, C_y sigma_y), where sigma is the sliding velocity
of the contact patch over the rolling speed of the wheel. With f'(0) = 1 the stiffnesses C are the
slopes at zero slip, and with f <= 1 the force never leaves the friction circle. In pure lateral
slip the brush shape is equation 15 of Yoon, Li & Ahn (2016) with |sigma| in its condition, and
the Dugoff shape is equations 2 to 4 of Dakhlallah, Glaser, Mammar & Sebsadji (2008).
"""

from __future__ import annotations

import math

import numba

BRUSH = 0
DUGOFF = 1
MAGIC_FORMULA = 2

SHAPES: dict[str, int] = {"brush": BRUSH, "dugoff": DUGOFF, "magic_formula": MAGIC_FORMULA}
"""Code of each shape by the name that scenario files use."""

MAGIC_SHAPE = 1.3
"""Shape factor of the Magic Formula shape, sin(1.3 atan(s / 1.3))."""


@numba.njit(cache=True, error_model="numpy", nogil=True)
def secant(shape, s):  # type: ignore[no-untyped-def]
    """Return f(s) / s, the secant slope of a shape at the normalised slip s >= 0; 1 at s = 0.

    Parameters
    ----------
    shape
        One of `BRUSH`, `DUGOFF`, `MAGIC_FORMULA`.
    s
        Normalised slip [-].
    """
    if shape == BRUSH:
        if s < 3.0:
            return 1.0 - s / 3.0 + s * s / 27.0
        return 1.0 / s
    if shape == DUGOFF:
        if s < 0.5:
            return 1.0
        return (1.0 - 0.25 / s) / s
    if s < 1e-6:
        return 1.0
    return math.sin(MAGIC_SHAPE * math.atan(s / MAGIC_SHAPE)) / s


@numba.njit(cache=True, error_model="numpy", nogil=True)
def combined_force(shape, slip_x, slip_y, stiffness_x, stiffness_y, capacity):  # type: ignore[no-untyped-def]
    """Return the tyre force (F_x, F_y) [N] in the axes of the wheel.

    Parameters
    ----------
    shape
        One of `BRUSH`, `DUGOFF`, `MAGIC_FORMULA`.
    slip_x, slip_y
        Sliding velocity over rolling speed, with the sign of the force that it causes [-].
    stiffness_x, stiffness_y
        Force over slip at zero slip [N].
    capacity
        Friction coefficient times vertical load [N]; a wheel in the air has 0 and gives no force.
    """
    if capacity <= 0.0:
        return 0.0, 0.0
    linear_x = stiffness_x * slip_x
    linear_y = stiffness_y * slip_y
    share = secant(shape, math.sqrt(linear_x * linear_x + linear_y * linear_y) / capacity)
    return share * linear_x, share * linear_y
