"""Slip slope method: Li, Du & Li (2014), Section III.A, eq. 7-15 ("Method 1" of its tables).

One regression of the total tyre force on the load-weighted slip of both axles; the front force is
half of the total. It tells one friction coefficient for the whole vehicle.

Corrected here: the accelerometer's reading replaces the rate of change of speed (no gradient
term is missing then); eq. 15 uses alpha for two things, and its unbiased map is mu = k/30, the
inverse of the tyre's B C; the regression forgets in time, not a sample, and rests while nothing
excites the tyres. The settings behind the paper's tables are the variant `paper`.
"""

from __future__ import annotations

import numpy as np

from gripbench.envs.tyres.longitudinal import slip_ratio
from gripbench.methods.blocks.axle_friction import (
    AXLE_LOAD_PARAMETERS,
    FRICTION_MAP_PARAMETERS,
    MAGIC_FORMULA,
    PRINTED,
    RESISTANCE_PARAMETERS,
    RLS_PARAMETERS,
    TYRE_PARAMETERS,
    excited,
    forgetting_factor,
    friction_of_slope,
    front_load,
    rear_load,
    rls,
    slip_regressor,
    total_force,
    unread_tyre,
)
from gripbench.methods.contract import CompiledMethod, Parameter, compiled

STATE = np.dtype([(name, np.float64) for name in ("slope", "covariance", "mu")])


@compiled
def start(state, params):
    """Set the first covariance."""
    state.covariance = params.covariance
    state.mu = params.slope_offset


@compiled
def step(state, obs, params, est):
    """Take one sample: total force by eq. 8, slip slope by eq. 10-14, friction by eq. 15."""
    slip_front = slip_ratio(params.wheel_radius * obs.wheel_speed_front, obs.speed_gps)
    slip_rear = slip_ratio(params.wheel_radius * obs.wheel_speed_rear, obs.speed_gps)
    force = total_force(obs.accel_x, obs.speed_gps, params)
    load_front, load_rear = front_load(params), rear_load(params)
    slip = (load_front * slip_front + load_rear * slip_rear) / (load_front + load_rear)
    if params.nonlinear_slip > 0.0 and abs(slip) > params.nonlinear_slip:
        # beyond the linear region the force itself is the friction times the load
        state.mu = abs(force) / (load_front + load_rear)
    elif excited(0.5 * force, params):
        regressor = load_front * slip_regressor(slip_front, params)
        regressor += load_rear * slip_regressor(slip_rear, params)
        forgetting = forgetting_factor(params, obs.elapsed)
        state.slope, state.covariance = rls(
            state.slope, state.covariance, regressor, force, forgetting
        )
        state.mu = friction_of_slope(state.slope, params)
    est.force_x_front = 0.5 * force
    est.mu_front = state.mu


class SlipSlope(CompiledMethod):
    """Slip slope by recursive least squares over both axles."""

    name = "slip_slope"
    title = "Slip slope (Method 1)"
    reference = "Li, Du & Li (2014), Section III.A, eq. 7-15"
    sensors = ("wheel_speed_front", "wheel_speed_rear", "accel_x", "speed_gps")
    estimates = ("force_x_front", "mu_front")
    vehicle_parameters = (
        *AXLE_LOAD_PARAMETERS,
        *RESISTANCE_PARAMETERS,
        *TYRE_PARAMETERS,
        "wheel_radius",
    )
    unread = staticmethod(unread_tyre)
    parameters = (
        *RLS_PARAMETERS,
        *FRICTION_MAP_PARAMETERS,
        Parameter(
            "nonlinear_slip",
            0.0,
            "-",
            "Slip ratio above which the force over the load is the friction; 0: never",
            0.0,
            1.0,
        ),
    )
    variants = {
        "paper": PRINTED,
        "nonlinear_region": {"nonlinear_slip": 0.04},
        "magic_formula": MAGIC_FORMULA,
    }
    state = STATE
    start = staticmethod(start)
    step = staticmethod(step)
