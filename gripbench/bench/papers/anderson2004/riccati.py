"""Steady-state covariance of the model-based filter: Table I of Anderson & Bevly (2004).

The filter's covariance between samples settles at the solution of the discrete Riccati equation.
The table gives the measurement noise at 5, 20, 50 and 100 Hz (its columns 3 and 4) and the
covariance that follows from it (columns 1 and 2).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm, solve_discrete_are

from gripbench.envs.vehicles import require
from gripbench.methods.model_based_kalman_filter import SINGLE_TRACK, single_track

RATES = (5.0, 20.0, 50.0, 100.0)
"""Sample rates of Table I [Hz]."""


@dataclass(frozen=True)
class SteadyState:
    """Steady standard deviations of a filter after its correction.

    Attributes
    ----------
    sideslip
        [rad].
    yaw_rate
        [rad/s].
    yaw
        [rad].
    gyro_bias
        [rad/s].
    """

    sideslip: float
    yaw_rate: float
    yaw: float
    gyro_bias: float


def steady_state(
    vehicle: Mapping[str, float],
    *,
    speed: float,
    rate: float,
    gyro_std: float,
    course_std: float,
    steer_noise: float,
    bias_walk: float,
) -> SteadyState:
    """Return the steady state of the model-based filter with both measurements in every sample.

    Parameters
    ----------
    vehicle
        Vehicle parameters of the single-track model.
    speed
        Speed [m/s].
    rate
        Sample rate [Hz].
    gyro_std, course_std
        Noise of one sample [rad/s], [rad].
    steer_noise
        Density of the steering noise [rad/sqrt(Hz)].
    bias_walk
        Walk of the gyroscope's bias [rad/s/sqrt(s)].
    """
    transition, noise = _model(vehicle, speed, 1.0 / rate, steer_noise, bias_walk)
    measured = np.array([[0.0, 1.0, 0.0, 1.0], [1.0, 0.0, 1.0, 0.0]])
    spread = np.diag([gyro_std**2, course_std**2])
    before = solve_discrete_are(transition.T, measured.T, noise, spread)
    innovation = measured @ before @ measured.T + spread
    gain = np.linalg.solve(innovation, measured @ before).T
    kept = np.eye(4) - gain @ measured
    after = kept @ before @ kept.T + gain @ spread @ gain.T
    return SteadyState(*(float(value) for value in np.sqrt(np.diag(after))))


def poles(
    vehicle: Mapping[str, float], speed: float, *, printed: bool = False
) -> npt.NDArray[np.complex128]:
    """Return the poles [1/s] of sideslip and yaw rate.

    Parameters
    ----------
    vehicle
        Vehicle parameters of the single-track model.
    speed
        Speed [m/s].
    printed
        With A22 of eq. 5 as printed, without its sign.
    """
    matrix = _continuous(vehicle, speed)[:2, :2].copy()
    if printed:
        matrix[1, 1] = -matrix[1, 1]
    return np.linalg.eigvals(matrix).astype(np.complex128)


def _continuous(vehicle: Mapping[str, float], speed: float) -> npt.NDArray[np.float64]:
    values = require(dict(vehicle), SINGLE_TRACK, "the single-track model")
    model = np.zeros((5, 5))
    single_track(model, *values.values(), speed)
    return model


def _model(
    vehicle: Mapping[str, float], speed: float, step: float, steer_noise: float, bias_walk: float
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return the transition matrix of a step and the covariance of its noise."""
    held = expm(_continuous(vehicle, speed) * step)
    transition = np.eye(4)
    transition[:3, :3] = held[:3, :3]
    column = np.append(held[:3, 3], 0.0)
    noise = np.outer(column, column) * steer_noise**2 / step
    noise[3, 3] += bias_walk**2 * step
    return transition, noise
