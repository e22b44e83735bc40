"""Sideslip errors over runs, as the papers' figures show them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import radians

import numpy as np
import numpy.typing as npt

from gripbench.envs.recordings import Recording
from gripbench.methods.contract import CompiledMethod

TURNING = radians(1.0)
"""Yaw rate above which a vehicle turns [rad/s]."""


def turning(run: Recording) -> npt.NDArray[np.bool_]:
    """Return where the vehicle turns and samples count, shape (n,)."""
    truth = run.truth
    return np.asarray((np.abs(truth["yaw_rate"]) > TURNING) & (truth["time"] >= run.score_from))


def steady(run: Recording) -> npt.NDArray[np.bool_]:
    """Return where the yaw rate is within a tenth of its largest, shape (n,)."""
    rate = np.abs(run.truth["yaw_rate"])
    return np.asarray(rate > 0.9 * rate.max())


def sideslip_error(
    method: CompiledMethod, vehicle: Mapping[str, float], run: Recording
) -> npt.NDArray[np.float64]:
    """Return the error of the sideslip angle [deg], shape (n,)."""
    estimates = method.run(vehicle, run.observations)
    return np.degrees(estimates["sideslip"] - run.truth["sideslip"])


def pooled_rms(parts: Sequence[npt.NDArray[np.float64]]) -> float:
    """Return the root of the mean square over all samples of all parts."""
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def sideslip_rms(
    method: CompiledMethod, vehicle: Mapping[str, float], runs: Sequence[Recording]
) -> float:
    """Return the sideslip RMS [deg] where the vehicle turns, pooled over runs."""
    return pooled_rms([sideslip_error(method, vehicle, run)[turning(run)] for run in runs])
