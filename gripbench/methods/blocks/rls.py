"""Recursive least squares with forgetting, one parameter: Li, Du & Li (2014), eq. 11-14.

Departures: with `memory_time` the forgetting factor is exp(-dt/memory_time), so that it does not
depend on how the samples are spaced (the paper's 0.9 a sample forgets in some 10 ms); and the
update can be left out while the tyre is not excited, because slip and force are then both noise
and the quotient drifts (the paper has no such gate).
"""

from __future__ import annotations

from math import exp

import numba

from gripbench.envs.tyres.longitudinal import magic_formula
from gripbench.methods.contract import Parameter

_inline = numba.njit(inline="always", error_model="numpy")

LARGEST_COVARIANCE = 1e100

RLS_PARAMETERS = (
    Parameter("memory_time", 0.5, "s", "Time constant of forgetting; 0: `forgetting` is used", 0.0),
    Parameter("forgetting", 0.9, "-", "Forgetting factor a sample, lambda", 0.5, 1.0),
    Parameter("covariance", 1.0, "-", "Initial covariance P", 1e-12),
    Parameter(
        "excitation_force", 85.0, "N", "Update only above this force on an axle; 0: always", 0.0
    ),
)
"""Parameters of every method that ends in this regression."""

FRICTION_MAP_PARAMETERS = (
    Parameter("slope_gain", 1.0 / 30.0, "-", "Friction over slip slope, eq. 15: alpha"),
    Parameter("slope_offset", 0.0, "-", "Friction at slip slope zero, eq. 15: b"),
    Parameter(
        "tyre_shape", 0.0, "-", "1: regress on the Magic Formula instead of the slip", 0.0, 1.0
    ),
)
"""Parameters of the map from slip slope to friction, eq. 15."""

PRINTED = {
    "memory_time": 0.0,
    "forgetting": 0.9,
    "excitation_force": 0.0,
    "slope_gain": 0.03,
    "slope_offset": 0.1,
}
"""What the paper's tables rest on: lambda 0.9 a sample, no gate, the map of Table III."""

MAGIC_FORMULA = {"tyre_shape": 1.0, "slope_gain": 1.0}
"""Regression on the tyre's known shape: its parameter is the friction coefficient itself."""


@_inline
def rls(theta, covariance, regressor, output, forgetting):  # type: ignore[no-untyped-def]
    """Return the parameter and its covariance after one sample, eq. 11-14.

    Parameters
    ----------
    theta, covariance
        Parameter and covariance P before the sample.
    regressor, output
        phi(t) and y(t).
    forgetting
        Forgetting factor lambda.
    """
    innovation = output - regressor * theta
    weight = forgetting + regressor * covariance * regressor
    gain = covariance * regressor / weight
    # eq. 14 for one parameter, (P - K phi P)/lambda, is P/weight: nothing cancels. Without
    # excitation P grows by 1/lambda a sample; it must not overflow while a vehicle stands.
    return theta + gain * innovation, min(covariance / weight, LARGEST_COVARIANCE)


@_inline
def forgetting_factor(params, elapsed):  # type: ignore[no-untyped-def]
    """Return lambda for a sample that comes `elapsed` seconds after the last."""
    if params.memory_time > 0.0:
        return exp(-elapsed / params.memory_time)
    return params.forgetting


@_inline
def slip_regressor(slip, params):  # type: ignore[no-untyped-def]
    """Return what the normalised force is proportional to: the slip, or the tyre's shape."""
    if params.tyre_shape > 0.5:
        return magic_formula(slip, params.magic_b, params.magic_c, params.magic_e)
    return slip


@_inline
def friction_of_slope(slope, params):  # type: ignore[no-untyped-def]
    """Return the friction coefficient of a slip slope, eq. 15."""
    return params.slope_gain * slope + params.slope_offset


@_inline
def excited(force, params):  # type: ignore[no-untyped-def]
    """Return whether the force of an axle [N] is large enough to tell the friction."""
    return abs(force) >= params.excitation_force
