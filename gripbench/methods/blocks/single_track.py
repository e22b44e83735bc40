"""The single-track model: speed, lateral velocity, yaw rate, steering in; forces and slopes out.

Forces are those of brush tyres, which are linear where friction does not matter:

    F = C tan(alpha) (1 - |s| + s^2 / 3),  s = C tan(alpha) / (3 mu F_z),

and mu F_z beyond |s| = 1 (Pacejka, Tyre and Vehicle Dynamics, 3.2; C is the cornering stiffness of
the axle). Motion:

    m (d v_y/dt + v r) = F_f cos(delta) + F_r,   I_z d r/dt = a F_f cos(delta) - b F_r.
"""

from __future__ import annotations

from math import atan2, cos, tan

from gripbench.compilation import compiled
from gripbench.envs.vehicles import GRAVITY

SINGLE_TRACK_VEHICLE = (
    "mass",
    "yaw_inertia",
    "cg_to_front",
    "cg_to_rear",
    "cornering_stiffness_front",
    "cornering_stiffness_rear",
)
"""Vehicle parameters of the model."""

LOWEST_SPEED = 3.0
"""Speed [m/s] at which the slip angles are held below it."""


@compiled
def brush_axle(angle, stiffness, limit):
    """Return the force of an axle [N] and its slopes to slip angle [N/rad] and to `limit`.

    Parameters
    ----------
    angle
        Slip angle [rad]; positive gives a positive force.
    stiffness
        Cornering stiffness [N/rad].
    limit
        Largest force, friction times load [N].
    """
    slope = 1.0 + tan(angle) ** 2
    linear = stiffness * tan(angle)
    share = abs(linear) / (3.0 * limit)
    if share >= 1.0:
        sign = 1.0 if linear > 0.0 else -1.0
        return sign * limit, 0.0, sign
    force = linear * (1.0 - share + share * share / 3.0)
    steepness = (1.0 - share) ** 2
    return force, stiffness * slope * steepness, linear / limit * share * (1.0 - 2.0 / 3.0 * share)


@compiled
def axle_loads(accel_x, params):
    """Return the loads of front and rear axle [N] at a longitudinal specific force [m/s^2].

    `params` holds `mass`, `cg_to_front`, `cg_to_rear` and `cg_height`.
    """
    base = params.cg_to_front + params.cg_to_rear
    moved = params.mass * accel_x * params.cg_height / base
    front = params.mass * GRAVITY * params.cg_to_rear / base - moved
    rear = params.mass * GRAVITY * params.cg_to_front / base + moved
    least = 0.05 * params.mass * GRAVITY
    return max(front, least), max(rear, least)


@compiled
def static_loads(params):
    """Return the static loads of front and rear axle [N]."""
    weight = params.mass * GRAVITY / (params.cg_to_front + params.cg_to_rear)
    return weight * params.cg_to_rear, weight * params.cg_to_front


@compiled
def slip_angles(speed, speed_y, yaw_rate, steer, params):
    """Return both slip angles [rad] and their slopes to v_y [s/m], which are negative."""
    forward = max(speed, LOWEST_SPEED)
    front_y = speed_y + params.cg_to_front * yaw_rate
    rear_y = speed_y - params.cg_to_rear * yaw_rate
    front = steer - atan2(front_y, forward)
    rear = -atan2(rear_y, forward)
    front_slope = -forward / (forward * forward + front_y * front_y)
    rear_slope = -forward / (forward * forward + rear_y * rear_y)
    return front, rear, front_slope, rear_slope


@compiled
def motion(speed, x, steer, front, rear, limit_front, limit_rear, params, out):
    """Fill `out`, shape (2, 7), with specific force and yaw acceleration and their slopes.

    Parameters
    ----------
    speed
        Longitudinal speed [m/s].
    x
        Lateral velocity [m/s] and yaw rate [rad/s] first.
    steer
        Steering angle [rad].
    front, rear
        Cornering stiffness of the axles [N/rad].
    limit_front, limit_rear
        Friction times load of the axles [N].
    params
        Record with `SINGLE_TRACK_VEHICLE`.
    out
        Rows: specific force along y [m/s^2], yaw acceleration [rad/s^2]. Columns: value, slope to
        v_y, to yaw rate, to a common factor of both limits, to the logarithm of each stiffness,
        to the steering angle.
    """
    a, b = params.cg_to_front, params.cg_to_rear
    angle_f, angle_r, per_f, per_r = slip_angles(speed, x[0], x[1], steer, params)
    force_f, slope_f, limited_f = brush_axle(angle_f, front, limit_front)
    force_r, slope_r, limited_r = brush_axle(angle_r, rear, limit_rear)
    turned = cos(steer)
    # F(C, limit) is of degree one in both: C dF/dC = F - limit dF/dlimit
    stiff_f, stiff_r = force_f - limit_front * limited_f, force_r - limit_rear * limited_r
    for row in range(2):
        if row == 0:
            u, w = turned / params.mass, 1.0 / params.mass
        else:
            u, w = a * turned / params.yaw_inertia, -b / params.yaw_inertia
        out[row, 0] = u * force_f + w * force_r
        out[row, 1] = u * slope_f * per_f + w * slope_r * per_r
        out[row, 2] = u * slope_f * per_f * a - w * slope_r * per_r * b
        out[row, 3] = u * limit_front * limited_f + w * limit_rear * limited_r
        out[row, 4] = u * stiff_f
        out[row, 5] = w * stiff_r
        out[row, 6] = u * slope_f
