"""Slip angles and tyre forces of an axle; a least-squares fit in, its uncertainty out.

What identification from a log and from the tests of a paper have in common.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def slip_angles(
    speed_x: Floats, speed_y: Floats, yaw_rate: Floats, steer: Floats, front: float, rear: float
) -> tuple[Floats, Floats]:
    """Return the slip angles [rad] of front and rear axle, positive for a force to the left.

    Parameters
    ----------
    speed_x, speed_y, yaw_rate, steer
        Velocity of the centre of gravity [m/s], yaw rate [rad/s], angle of the front wheels [rad],
        shape (n,).
    front, rear
        Distances [m] of the axles from the centre of gravity.
    """
    return (
        steer - np.arctan2(speed_y + front * yaw_rate, speed_x),
        -np.arctan2(speed_y - rear * yaw_rate, speed_x),
    )


def brush_force(slip_angle: Floats, stiffness: float, largest: float) -> Floats:
    """Return the lateral force of an axle with brush tyres, in the unit of `largest`.

    Parameters
    ----------
    slip_angle
        Slip angle [rad], shape (n,).
    stiffness
        Force over slip angle at zero slip.
    largest
        Friction times load; infinite: a linear tyre.
    """
    linear = stiffness * np.tan(slip_angle)
    if np.isinf(largest):
        return np.asarray(linear)
    share = np.clip(linear / (3.0 * largest), -1.0, 1.0)
    size = np.abs(share)
    return np.asarray(3.0 * largest * share * (1.0 - size + size**2 / 3.0))


def covariance(jacobian: Floats, variance: float, correlated: float) -> Floats:
    """Return the covariance of a least-squares solution, shape (p, p).

    Parameters
    ----------
    jacobian
        Of the residuals to the parameters, shape (n, p).
    variance
        Of a residual.
    correlated
        Residuals that are worth one independent one.

    Returns
    -------
    Infinite on the diagonal where the samples do not excite a direction.
    """
    _, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    if singular[-1] <= 1e-9 * singular[0]:
        return np.diag(np.full(jacobian.shape[1], np.inf))
    return np.asarray((directions.T / singular**2) @ directions * (variance * correlated))
