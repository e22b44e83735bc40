"""Tyre forces under combined slip: every shape of tyre, a file each, behind one interface.

Each shape is a function f of the normalised slip

    s = |(C_x sigma_x, C_y sigma_y)| / (mu F_z)

and the force is mu F_z f(s) along (C_x sigma_x, C_y sigma_y), where sigma is the sliding velocity
of the contact patch over the rolling speed of the wheel. With f'(0) = 1 the stiffnesses C are the
slopes at zero slip, and with f <= 1 the force never leaves the friction circle.
"""

from __future__ import annotations

import math

from gripbench.compilation import compiled
from gripbench.envs.tyres import brush, dugoff, fitted_curve, magic_formula

BRUSH = 0
DUGOFF = 1
MAGIC_FORMULA = 2
FITTED_CURVE = 3

SHAPES: dict[str, int] = {
    "brush": BRUSH,
    "dugoff": DUGOFF,
    "magic_formula": MAGIC_FORMULA,
    "fitted_curve": FITTED_CURVE,
}
"""Code of each shape by the name that scenario files use."""


@compiled
def secant(shape, s):
    """Return f(s) / s, the secant slope of a shape at the normalised slip s >= 0; 1 at s = 0.

    Parameters
    ----------
    shape
        One of the codes of `SHAPES`.
    s
        Normalised slip [-].
    """
    if shape == BRUSH:
        return brush.secant(s)
    if shape == DUGOFF:
        return dugoff.secant(s)
    if shape == FITTED_CURVE:
        return fitted_curve.secant(s)
    return magic_formula.secant(s)


@compiled
def tangent(shape, s):
    """Return f'(s), the slope of a shape at the normalised slip s >= 0; arguments as `secant`."""
    if shape == BRUSH:
        return brush.tangent(s)
    if shape == DUGOFF:
        return dugoff.tangent(s)
    if shape == FITTED_CURVE:
        return fitted_curve.tangent(s)
    return magic_formula.tangent(s)


@compiled
def combined_force(shape, slip_x, slip_y, stiffness_x, stiffness_y, capacity):
    """Return the tyre force (F_x, F_y) [N] in the axes of the wheel.

    Parameters
    ----------
    shape
        One of the codes of `SHAPES`.
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
