"""What the longitudinal methods know of the car: eq. 5, 6 and 8 of Li, Du & Li (2014)."""

from __future__ import annotations

import numba

from gripbench.envs.vehicles import GRAVITY

_inline = numba.njit(inline="always", error_model="numpy")

AXLE_LOAD_PARAMETERS = ("mass", "cg_to_front", "cg_to_rear")
RESISTANCE_PARAMETERS = ("rolling_resistance", "drag")
TYRE_PARAMETERS = ("magic_b", "magic_c", "magic_e")


@_inline
def front_load(params):  # type: ignore[no-untyped-def]
    """Return the static load of the front axle [N], eq. 6a."""
    wheelbase = params.cg_to_front + params.cg_to_rear
    return params.mass * GRAVITY * params.cg_to_rear / wheelbase


@_inline
def rear_load(params):  # type: ignore[no-untyped-def]
    """Return the static load of the rear axle [N], eq. 6b."""
    wheelbase = params.cg_to_front + params.cg_to_rear
    return params.mass * GRAVITY * params.cg_to_front / wheelbase


@_inline
def total_force(accel_x, speed, params):  # type: ignore[no-untyped-def]
    """Return the sum of the tyre forces [N], eq. 8.

    Erratum: `accel_x` is the accelerometer's reading, the rate of change of speed less gravity's
    component, so no term of the gradient belongs here (eq. 29 has one too many).
    """
    return (
        params.mass * accel_x
        + params.rolling_resistance * params.mass * GRAVITY
        + params.drag * speed * speed
    )
