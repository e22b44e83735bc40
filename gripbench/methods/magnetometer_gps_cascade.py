"""The magnetometer-GPS cascade of Yoon, Li & Ahn (2015): heading, sideslip and friction filters.

Attitude from the magnetometer and the gyroscopes (`heading_ekf`), velocities from the
accelerometers and late GPS in the axes of that attitude (`sideslip_kalman_filter`), friction from
the sideslip and a brush tyre (`friction_ekf`): figures 1 and 2 of the paper. Each filter passes
its estimate on, the heading's variance goes into the noise of the GPS velocity.

Variants: `paper` has the equations as printed and the sensor noise of Table 1; eq. 8 and 12 cannot
be run as printed (eq. 9 contradicts eq. 8, and eq. 12 gives the complement of the angle) and are
corrected there too. `table_1_noise` has all errata corrected and the noise of Table 1, without the
allowance for pitch, for the roll on the springs and for the hard iron. `pitch_aware` is meant for
public roads. The others leave one part out.

Of its variance: each filter takes the one before it for unbiased. Hard iron, a pitched road and
the springs' roll turn the heading for as long as they last; `heading_share` of it counts as noise.
The friction filter takes the sideslip for known and every sample of a_y for new evidence.
"""

from __future__ import annotations

import numpy as np

from gripbench.envs.vehicles import GRAVITY
from gripbench.methods.blocks.course_history import wrapped
from gripbench.methods.contract import CompiledMethod, compiled
from gripbench.methods.friction_ekf import (
    FRICTION_PARAMETERS,
    FRICTION_STATE,
    FRICTION_VEHICLE,
    acceleration_of_forces,
    friction_step,
)
from gripbench.methods.heading_ekf import (
    HEADING_PARAMETERS,
    HEADING_SENSORS,
    HEADING_STATE,
    HEADING_VEHICLE,
    NO_ROLL_MODEL,
    PITCH_AWARE,
    TABLE_1_NOISE,
    UNGATED,
    heading_step,
    unread_heading,
    yaw_speed,
)
from gripbench.methods.sideslip_kalman_filter import (
    SIDESLIP_PARAMETERS,
    SIDESLIP_STATE,
    sideslip_estimate,
    sideslip_gps,
    sideslip_step,
)

CASCADE_STATE = np.dtype(
    [("heading", HEADING_STATE), ("sideslip", SIDESLIP_STATE), ("friction", FRICTION_STATE)]
)
"""State of the cascade: those of its three filters."""


@compiled
def _step(state, obs, params, est):
    heading, sideslip, friction = state.heading, state.sideslip, state.friction
    heading_step(heading, obs, params)
    yaw, roll = heading.filter.x[0], heading.filter.x[1]
    yaw_variance = heading.filter.P[0, 0]
    turning = yaw_speed(obs.yaw_rate, roll)
    accel_x = obs.accel_x + GRAVITY * np.sin(heading.pitch)
    accel_y = obs.accel_y - GRAVITY * np.sin(roll)
    sideslip_step(sideslip, obs.time, accel_x, accel_y, turning, yaw, roll, yaw_variance, params)
    if obs.velocity_north_new > 0.0:
        sideslip_gps(
            sideslip, obs.gps_time, obs.velocity_north, obs.velocity_west, obs.velocity_up, params
        )
    now = sideslip.now
    of_forces = acceleration_of_forces(obs.accel_y, accel_y, now.x[3])
    friction_step(
        friction, obs.time, now.x[0], now.x[2], turning, obs.steer_angle, of_forces, params
    )
    # An error of the heading turns the velocity as it is: the filter cannot average it away.
    sideslip_angle, sideslip_variance = sideslip_estimate(now)
    est.sideslip, est.sideslip_variance = sideslip_angle, sideslip_variance + yaw_variance
    est.mu, est.mu_variance = friction.mu, friction.variance
    est.yaw, est.yaw_variance = wrapped(yaw), yaw_variance
    est.roll, est.roll_variance = roll, heading.filter.P[1, 1]
    est.speed_x, est.speed_x_variance = now.x[0], now.P[0, 0]
    est.speed_y, est.speed_y_variance = now.x[2], now.P[2, 2]


class MagnetometerGpsCascade(CompiledMethod):
    """Sideslip and friction from magnetometer, GPS and IMU, three Kalman filters in a row."""

    name = "magnetometer_gps_cascade"
    title = "Magnetometer-GPS cascade"
    reference = "Yoon, Li & Ahn (2015), Int. J. Automotive Technology, eq. 1-16"
    sensors = (*HEADING_SENSORS, "accel_x", "steer_angle")
    estimates = ("sideslip", "mu", "yaw", "roll", "speed_x", "speed_y")
    variances = ("sideslip", "mu", "yaw", "roll", "speed_x", "speed_y")
    vehicle_parameters = (*HEADING_VEHICLE, *FRICTION_VEHICLE)
    unread = staticmethod(unread_heading)
    parameters = (*HEADING_PARAMETERS, *SIDESLIP_PARAMETERS, *FRICTION_PARAMETERS)
    variants = {
        "table_1_noise": TABLE_1_NOISE,
        "pitch_aware": PITCH_AWARE,
        "no_roll_model": NO_ROLL_MODEL,
        "no_rejection": {"gate": UNGATED},
        "no_delay_handling": {"delay_handling": "ignored"},
        "single_delay": {"delay_handling": "larsen"},
        "no_bias_states": {"bias_std": 0.0, "bias_walk": 0.0},
    }
    printed = "gripbench.methods.printed.yoon2015"
    state = CASCADE_STATE
    step = _step

    @property
    def expected_failures(self) -> dict[str, str]:
        """Checks that a variant fails on purpose, with the reason."""
        if self.settings["delay_handling"] != "larsen":
            return {}
        return {
            "variance_not_negative": "a single correction for the delay subtracts more than there "
            "is; the variant shows how the formula diverges"
        }
