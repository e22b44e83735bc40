"""Longitudinal tyre: the Magic Formula and the slip ratio of Li, Du & Li (2014), eq. 4-5.

Errata: Table III gives the slope of the linear region as 50000 N for one tyre, while the Magic
Formula of the same table has the slope B C mu F_z, 102 kN for a front tyre at mu = 0.9; the
plant follows the Magic Formula.
"""

from __future__ import annotations

from math import atan, cos, sin

from gripbench.compilation import inlined

CRAWL_SPEED = 0.1
"""Speed [m/s] below which the slip ratio's denominator stays constant: no division by zero."""


@inlined
def slip_ratio(rolling_speed, speed):
    """Return the slip ratio of eq. 5, in one form for traction and braking.

    Parameters
    ----------
    rolling_speed
        Wheel radius times wheel speed [m/s].
    speed
        Speed of the wheel's centre [m/s].

    Returns
    -------
    (rolling_speed - speed) over the larger of the two: 5a when driving, 5b when braking.
    """
    return (rolling_speed - speed) / max(abs(rolling_speed), abs(speed), CRAWL_SPEED)


@inlined
def slip_ratio_slopes(rolling_speed, speed):
    """Return the derivatives of `slip_ratio` to the rolling speed and to the speed [s/m]."""
    rolling, moving = abs(rolling_speed), abs(speed)
    difference = rolling_speed - speed
    if max(rolling, moving) <= CRAWL_SPEED:
        return 1.0 / CRAWL_SPEED, -1.0 / CRAWL_SPEED
    if rolling >= moving:
        sign = 1.0 if rolling_speed >= 0.0 else -1.0
        return 1.0 / rolling - difference * sign / (rolling * rolling), -1.0 / rolling
    sign = 1.0 if speed >= 0.0 else -1.0
    return 1.0 / moving, -1.0 / moving - difference * sign / (moving * moving)


@inlined
def magic_formula(slip, stiffness, shape, curvature):
    """Return the tyre force of eq. 4 over its peak value D = mu F_z.

    Parameters
    ----------
    slip
        Slip ratio.
    stiffness, shape, curvature
        Magic Formula factors B, C and E.
    """
    stretched = stiffness * slip
    return sin(shape * atan(stretched - curvature * (stretched - atan(stretched))))


@inlined
def magic_formula_slope(slip, stiffness, shape, curvature):
    """Return the value of `magic_formula` and its derivative to the slip ratio."""
    stretched = stiffness * slip
    inner = stretched - curvature * (stretched - atan(stretched))
    inner_slope = stiffness * (1.0 - curvature * (1.0 - 1.0 / (1.0 + stretched * stretched)))
    angle = shape * atan(inner)
    return sin(angle), cos(angle) * shape * inner_slope / (1.0 + inner * inner)
