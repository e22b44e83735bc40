"""Friction of each axle from its force and slip, as all methods but Method 1 end.

Li, Du & Li (2014), Section III.C, step 3: the regression of eq. 11-14 on one axle, then eq. 15.
"""

from __future__ import annotations

import numba

from gripbench.methods.longitudinal_model import AXLE_LOAD_PARAMETERS, TYRE_PARAMETERS
from gripbench.methods.rls import (
    FRICTION_MAP_PARAMETERS,
    RLS_PARAMETERS,
    excited,
    forgetting_factor,
    friction_of_slope,
    rls,
    slip_regressor,
)

_inline = numba.njit(inline="always", error_model="numpy")

AXLE_FRICTION_PARAMETERS = (*RLS_PARAMETERS, *FRICTION_MAP_PARAMETERS)
AXLE_FRICTION_VEHICLE = (*AXLE_LOAD_PARAMETERS, *TYRE_PARAMETERS)


@_inline
def axle_friction(slope, covariance, force, slip, load, elapsed, params):  # type: ignore[no-untyped-def]
    """Return slip slope, covariance and friction of an axle after one sample.

    Parameters
    ----------
    slope, covariance
        State of the regression.
    force, slip, load
        Tyre force [N], slip ratio and vertical load [N] of the axle.
    elapsed
        Time since the last sample [s].
    params
        Record with `AXLE_FRICTION_PARAMETERS` and `AXLE_FRICTION_VEHICLE`.
    """
    if excited(force, params):
        regressor = load * slip_regressor(slip, params)
        forgetting = forgetting_factor(params, elapsed)
        slope, covariance = rls(slope, covariance, regressor, force, forgetting)
    return slope, covariance, friction_of_slope(slope, params)
