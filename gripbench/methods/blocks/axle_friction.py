"""Friction of each axle from its force and slip, as all methods but Method 1 end.

Li, Du & Li (2014), Section III.C, step 3: the regression of eq. 11-14 on one axle, then eq. 15.
"""

from __future__ import annotations

import numba

from gripbench.envs.tyres.longitudinal import slip_ratio
from gripbench.methods.blocks.longitudinal_model import (
    AXLE_LOAD_PARAMETERS,
    TYRE_PARAMETERS,
    front_load,
    rear_load,
)
from gripbench.methods.blocks.rls import (
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
AXLE_FRICTION_STATE = ("slope_front", "covariance_front", "slope_rear", "covariance_rear")
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


@_inline
def axle_slips(wheel_speed_front, wheel_speed_rear, speed, params):  # type: ignore[no-untyped-def]
    """Return the slip ratios of both axles, eq. 5, for wheel speeds [rad/s] and a speed [m/s]."""
    front = slip_ratio(params.wheel_radius * wheel_speed_front, speed)
    return front, slip_ratio(params.wheel_radius * wheel_speed_rear, speed)


@_inline
def estimate_friction(state, est, slip_front, slip_rear, elapsed, params):  # type: ignore[no-untyped-def]
    """Write the friction of both axles from the forces that `est` holds already.

    `state` keeps the fields of `AXLE_FRICTION_STATE`.
    """
    state.slope_front, state.covariance_front, est.mu_front = axle_friction(
        state.slope_front,
        state.covariance_front,
        est.force_x_front,
        slip_front,
        front_load(params),
        elapsed,
        params,
    )
    state.slope_rear, state.covariance_rear, est.mu_rear = axle_friction(
        state.slope_rear,
        state.covariance_rear,
        est.force_x_rear,
        slip_rear,
        rear_load(params),
        elapsed,
        params,
    )


@_inline
def start_friction(state, params):  # type: ignore[no-untyped-def]
    """Set the first covariances of both axles."""
    state.covariance_front = params.covariance
    state.covariance_rear = params.covariance
