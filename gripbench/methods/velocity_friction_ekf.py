"""Friction filter of Yoon, Li & Ahn (2015), eq. 15-16, behind a measured velocity.

The third filter of the cascade on its own, for vehicles whose velocity an optical sensor or motion
capture measures in both directions: what it finds of the friction then does not depend on how well
magnetometer and GPS give the sideslip. Errata are those of `friction_ekf`.

Of its variance: that of `friction_ekf`: the error of the tyre model lasts, and is counted as
white. The variant `lasting_errors` gives the tyre model an error of .35 m/s^2 that lasts a second,
.35 sqrt(2 s) = .5 as a density, and lets the road change by .05 in a second.
"""

from __future__ import annotations

from gripbench.methods.contract import CompiledMethod, compiled
from gripbench.methods.friction_ekf import (
    FRICTION_PARAMETERS,
    FRICTION_STATE,
    FRICTION_VEHICLE,
    friction_step,
)


@compiled
def _step(state, obs, params, est):
    if obs.accel_y_new > 0.0:
        friction_step(
            state, obs.time, obs.speed_x, obs.speed_y, obs.yaw_rate, obs.steer_angle,
            obs.accel_y, params,
        )  # fmt: skip
    est.mu = state.mu if state.variance > 0.0 else params.first_mu
    est.mu_variance = state.variance if state.variance > 0.0 else params.first_mu_std**2


class VelocityFrictionEkf(CompiledMethod):
    """Friction from lateral acceleration and measured velocity, brush tyres."""

    name = "velocity_friction_ekf"
    title = "Friction EKF with measured velocity"
    reference = "Yoon, Li & Ahn (2015), Int. J. Automotive Technology, eq. 15-16"
    sensors = ("speed_x", "speed_y", "yaw_rate", "steer_angle", "accel_y", "accel_y_new")
    estimates = ("mu",)
    variances = ("mu",)
    vehicle_parameters = FRICTION_VEHICLE
    parameters = FRICTION_PARAMETERS
    variants = {
        "small_car": {"least_speed": 0.8},
        "lasting_errors": {"accel_y_density": 0.5, "mu_walk": 0.05},
    }
    state = FRICTION_STATE
    step = staticmethod(_step)
