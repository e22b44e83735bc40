"""Observability of a nonlinear model along a trajectory, by Lie derivatives.

Dakhlallah et al. (2008), eq. 13-15: the observability matrix stacks the gradients of the output h
and of its Lie derivatives L_f h, L_f^2 h along the model f. Full rank means that the states can
be told apart locally; the condition number says how well.

For an output h(x) = H x the gradients are

    H,   H J,   H (J J + D),   D = dJ/dx along f,

with J = df/dx. States and time are scaled first: a rank or condition number in raw SI units
compares metres a second with radians a second.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.envs.vehicles import require
from gripbench.methods.dugoff_ekf import DUGOFF_PARAMETERS, DUGOFF_STATE, DugoffEkf, evaluate

Model = Callable[[npt.NDArray[np.float64]], tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]]
"""Returns f and df/dx, shapes (n,) and (n, n), at a state; inputs are held."""


@dataclass(frozen=True)
class Observability:
    """Rank and condition number of the observability matrix, one value a sample."""

    time: npt.NDArray[np.float64]
    rank: npt.NDArray[np.int64]
    condition: npt.NDArray[np.float64]


def observability_matrix(
    model: Model, state: npt.NDArray[np.float64], output: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Return the gradients of h, L_f h and L_f^2 h.

    Parameters
    ----------
    model
        The model, see `Model`.
    state
        Where to evaluate, shape (n,).
    output
        H of the output H x, shape (m, n).

    Returns
    -------
    Matrix, shape (3 m, n).
    """
    rate, slope = model(state)
    # a central difference of the exact Jacobian along f; the step is small against its curvature
    step = 1e-5 / max(1e-3, float(np.linalg.norm(rate)))
    ahead, behind = model(state + step * rate)[1], model(state - step * rate)[1]
    bend = (ahead - behind) / (2.0 * step)
    return np.vstack([output, output @ slope, output @ (slope @ slope + bend)])


def dugoff_observability(
    vehicle: Mapping[str, float],
    observations: npt.NDArray[Any],
    estimates: npt.NDArray[Any],
    *,
    outputs: tuple[str, ...] = ("speed_x", "yaw_rate"),
    every: int = 10,
    scale: tuple[float, float, float] = (1.0, 1.0, 0.1),
    time_scale: float = 0.1,
    tolerance: float = 1e-6,
) -> Observability:
    """Return the observability of the Dugoff EKF's model along a recording.

    Parameters
    ----------
    vehicle
        Vehicle parameters.
    observations
        Channels of the filter, shape (n,).
    estimates
        Where to evaluate: `speed_x`, `speed_y`, `yaw_rate`, shape (n,).
    outputs
        Which of the states are measured.
    every
        Samples between evaluations.
    scale
        Unit of each state [m/s, m/s, rad/s].
    time_scale
        Unit of time [s] for the Lie derivatives.
    tolerance
        Singular values below this share of the largest count as zero.
    """
    state, params = np.zeros(1, DUGOFF_STATE)[0], _parameters(vehicle)
    states = ("speed_x", "speed_y", "yaw_rate")
    output = np.array([[float(name == given) for name in states] for given in outputs])
    unit = np.asarray(scale)

    def model(
        x: npt.NDArray[np.float64],
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        state["filter"]["x"][:] = x
        evaluate(state, params)
        return state["rate"].copy(), state["slope"].copy()

    picked = range(0, len(observations), every)
    rank = np.zeros(len(picked), np.int64)
    condition = np.zeros(len(picked))
    powers = np.repeat(time_scale ** np.arange(3.0), len(outputs))
    for i, k in enumerate(picked):
        sample = observations[k]
        state["steer_angle"] = sample["steer_angle"]
        state["accel_x"], state["accel_y"] = sample["accel_x"], sample["accel_y"]
        for j, wheel in enumerate(("front_left", "front_right", "rear_left", "rear_right")):
            state["rolling"][j] = vehicle["wheel_radius"] * sample[f"wheel_speed_{wheel}"]
        x = np.array([estimates[k][name] for name in states])
        matrix = observability_matrix(model, x, output)
        rows = unit[[states.index(name) for name in outputs]]
        scaled = matrix * powers[:, None] * unit / np.tile(rows, 3)[:, None]
        values = np.linalg.svd(scaled, compute_uv=False)
        rank[i] = int(np.sum(values > tolerance * values[0]))
        condition[i] = values[0] / values[-1] if values[-1] > 0.0 else np.inf
    return Observability(observations["time"][::every].copy(), rank, condition)


def _parameters(vehicle: Mapping[str, float]) -> Any:
    values = require(dict(vehicle), DugoffEkf.vehicle_parameters, "dugoff_observability")
    values |= {
        parameter.name: parameter.number(parameter.default) for parameter in DUGOFF_PARAMETERS
    }
    return np.array([tuple(values.values())], [(name, np.float64) for name in values])[0]
