"""Calibrate a magnetometer from a log: hard iron and scale by an ellipse, or at a known heading.

A vehicle that turns through a good part of a circle draws an ellipse in the plane of its two
horizontal components: its centre is the hard iron. A vehicle that keeps its direction draws a
point, which tells the hard iron only if the heading and the earth's field are known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gripbench.errors import InputError

Floats = npt.NDArray[np.float64]

SHORTEST_ARC = np.deg2rad(120.0)
"""Least arc of headings from which an ellipse is fitted."""

LARGEST_SCATTER = 0.2
"""Largest standard deviation of the calibrated radius, as a share of it."""


@dataclass(frozen=True)
class HorizontalCalibration:
    """Centre and shape of the ellipse of the horizontal components.

    Attributes
    ----------
    centre
        Hard iron [T], x and y.
    matrix
        Turns (reading - centre) into a vector of length `radius`, shape (2, 2), symmetric.
    radius
        Mean radius [T]: the horizontal field up to the scale of the sensor.
    arc
        Arc of the ellipse that the readings cover [rad].
    """

    centre: Floats
    matrix: Floats
    radius: float
    arc: float

    def apply(self, field_x: Floats, field_y: Floats) -> tuple[Floats, Floats]:
        """Return calibrated components [T]."""
        x, y = self.matrix @ (np.array([field_x, field_y]) - self.centre[:, None])
        return x, y


def fit_ellipse(field_x: Floats, field_y: Floats) -> HorizontalCalibration:
    """Fit the ellipse that horizontal components draw while the vehicle turns.

    Parameters
    ----------
    field_x, field_y
        Readings [T], shape (n,).

    Raises
    ------
    InputError
        If they are too few, are no ellipse, or cover too short an arc of it.
    """
    if len(field_x) < 20:
        raise InputError("magnetometer: an ellipse needs at least 20 samples")
    points = np.array([field_x, field_y])
    middle = points.mean(axis=1, keepdims=True)
    size = float(np.sqrt(np.mean((points - middle) ** 2))) or 1.0
    x, y = (points - middle) / size
    # a x^2 + b x y + c y^2 + d x + e y = 1 with the constraint a + c = 1 taken out
    design = np.array([x * x - y * y, x * y, x, y, np.ones_like(x)]).T
    (difference, b, d, e, f), *_ = np.linalg.lstsq(design, -(x * x + y * y) * 0.5, rcond=None)
    quadratic = np.array([[0.5 + difference, 0.5 * b], [0.5 * b, 0.5 - difference]])
    if np.linalg.eigvalsh(quadratic)[0] <= 0.0:
        raise InputError("magnetometer: the readings draw no ellipse; the vehicle must turn")
    centre = -0.5 * np.linalg.solve(quadratic, np.array([d, e]))
    level = float(centre @ quadratic @ centre - f)
    if level <= 0.0:
        raise InputError("magnetometer: the readings draw no ellipse; the vehicle must turn")
    values, vectors = np.linalg.eigh(quadratic / level)
    radius = float(np.prod(values) ** -0.25)
    matrix = vectors @ np.diag(np.sqrt(values) * radius) @ vectors.T
    around = np.array([x, y]) - centre[:, None]
    turned = matrix @ around
    lengths = np.hypot(*turned)
    if float(lengths.std()) > LARGEST_SCATTER * float(lengths.mean()):
        raise InputError("magnetometer: the readings draw no ellipse; the vehicle must turn")
    arc = _arc(np.arctan2(turned[1], turned[0]))
    if arc < SHORTEST_ARC:
        raise InputError(
            f"magnetometer: the readings cover {np.rad2deg(arc):.0f} degrees of the ellipse; "
            f"at least {np.rad2deg(SHORTEST_ARC):.0f} are needed"
        )
    return HorizontalCalibration(centre * size + middle[:, 0], matrix, radius * size, arc)


def hard_iron_at_heading(
    field: Floats, yaw: Floats, horizontal: float, up: float, declination: float
) -> Floats:
    """Return the hard iron of a level vehicle whose heading is known.

    It holds near the headings that it was taken at: what a soft iron or a misaligned sensor adds
    turns with the vehicle.

    Parameters
    ----------
    field
        Readings [T], shape (3, n): forward, left, up.
    yaw
        Heading [rad], shape (n,), from true north to west.
    horizontal, up
        The earth's field [T].
    declination
        Direction of magnetic north [rad], from true north to west.

    Returns
    -------
    Hard iron [T], shape (3,).
    """
    angle = yaw - declination
    earth = np.array(
        [horizontal * np.cos(angle), -horizontal * np.sin(angle), np.full(len(yaw), up)]
    )
    return np.asarray(np.mean(field - earth, axis=1))


def _arc(angles: Floats) -> float:
    """Return the arc that angles cover: the circle less the widest gap."""
    ordered = np.sort(np.mod(angles, 2.0 * np.pi))
    gaps = np.diff(np.append(ordered, ordered[0] + 2.0 * np.pi))
    return float(2.0 * np.pi - gaps.max())
