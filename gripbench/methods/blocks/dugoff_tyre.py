"""Dugoff tyre with its slopes: eq. 2-4 of Dakhlallah, Glaser, Mammar & Sebsadji (2008).

With the linear forces g = (C_x lambda, C_y tan alpha) / (1 - |lambda|) and sigma = mu F_z / (2 |g|)
the force is k g, k = (2 - sigma) sigma below sigma = 1, else 1.

Erratum: (2) and (4) print 1 - lambda, which makes a braked wheel softer than a driven one; Dugoff's
model has 1 - |lambda|.
"""

from __future__ import annotations

from math import sqrt

from gripbench.compilation import compiled


@compiled
def dugoff_slips(rolling, speed, lateral):
    """Return lambda/(1 - |lambda|), tan(alpha)/(1 - |lambda|) and their slopes.

    Parameters
    ----------
    rolling
        Wheel radius times wheel speed [m/s], above 0.
    speed, lateral
        Velocity of the wheel's centre along and across the wheel [m/s], `speed` above 0.

    Returns
    -------
    Both slips, then the slopes of the first over `speed` and of the second over `speed` and over
    `lateral` [s/m].
    """
    if rolling >= speed:
        share = rolling / (speed * speed)
        return (
            (rolling - speed) / speed,
            -lateral * share,
            -share,
            2.0 * lateral * share / speed,
            -share,
        )
    return (rolling - speed) / rolling, -lateral / rolling, -1.0 / rolling, 0.0, -1.0 / rolling


@compiled
def dugoff_force(linear_x, linear_y, capacity):
    """Return F_x, F_y [N] and the slopes dF_x/dg_x, dF_x/dg_y (= dF_y/dg_x), dF_y/dg_y.

    Parameters
    ----------
    linear_x, linear_y
        The linear forces g [N].
    capacity
        mu F_z [N].
    """
    size = sqrt(linear_x * linear_x + linear_y * linear_y)
    if 2.0 * size <= capacity:
        return linear_x, linear_y, 1.0, 0.0, 1.0
    ratio = 0.5 * capacity / size
    share = (2.0 - ratio) * ratio
    bend = (ratio * ratio - share) / (size * size)
    return (
        share * linear_x,
        share * linear_y,
        share + bend * linear_x * linear_x,
        bend * linear_x * linear_y,
        share + bend * linear_y * linear_y,
    )
