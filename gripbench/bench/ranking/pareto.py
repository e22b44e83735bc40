"""The front of methods that no other beats in both accuracy and runtime."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def pareto_front(first: npt.ArrayLike, second: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Return which points are on the front of two figures, both better when lower.

    Parameters
    ----------
    first, second
        The figures of each method, such as RMS and runtime; a method with NaN in one is not on
        the front and keeps nobody off it.

    Returns
    -------
    True where no other point is at least as low in both and lower in one.

    Examples
    --------
    >>> pareto_front([1.0, 2.0, 2.0], [9.0, 5.0, 6.0]).tolist()
    [True, True, False]
    """
    points = np.column_stack([np.asarray(first, float), np.asarray(second, float)])
    known = np.isfinite(points).all(axis=1)
    with np.errstate(invalid="ignore"):
        no_worse = (points[:, None, :] <= points[None, :, :]).all(axis=2)
        lower = (points[:, None, :] < points[None, :, :]).any(axis=2)
    dominated = (no_worse & lower & known[:, None]).any(axis=0)
    return known & ~dominated
