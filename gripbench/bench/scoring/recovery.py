"""Recovery from a fault: from estimates with and without it to the time until they agree again."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.scoring.metric import Value
from gripbench.envs.recordings import Recording
from gripbench.envs.signals import difference

RECOVERY = "recovery"
"""Name of the metric in rows of faulty runs, unit s."""

_SPAN = 0.5  # time over which errors are averaged [s]
_ALLOWED = 1.1  # error of the faulty run over that of its twin that counts as recovered


def recovery(
    faulty: npt.NDArray[Any], clean: npt.NDArray[Any], target: str, recording: Recording
) -> Value | None:
    """Return the time from the end of a fault until the error is that of the clean twin for good.

    The RMS errors of both over half a second are compared: from the returned time on, that of the
    faulty run stays within a tenth of its twin's, or within a tenth of the twin's over the run.

    Parameters
    ----------
    faulty, clean
        Estimates of the two runs, structured arrays of shape (n,).
    target
        The signal.
    recording
        The faulty recording.

    Returns
    -------
    The time [s]; a value of None: not within the run; None: the run ends before the fault does.
    """
    time, truth = recording.truth["time"], recording.truth[target]
    end = recording.notes["fault_end"]
    after = time >= end
    if not after.any():
        return None
    with np.errstate(invalid="ignore"):
        errors = [difference(target, each[target], truth) ** 2 for each in (faulty, clean)]
    samples = max(1, round(_SPAN / max(float(np.median(np.diff(time))), 1e-6)))
    ours, theirs = (np.sqrt(_mean_before(error, samples)) for error in errors)
    least = 0.1 * math.sqrt(float(np.nanmean(errors[1])))
    back = ours <= np.maximum(_ALLOWED * theirs, theirs + least)
    wrong = np.flatnonzero(after & ~back)
    if not len(wrong):
        return Value(value=0.0)
    first = int(wrong[-1]) + 1
    return Value(value=None if first >= len(time) else float(time[first] - end))


def _mean_before(values: npt.NDArray[np.float64], samples: int) -> npt.NDArray[np.float64]:
    """Return the mean of each value and those before it, so many in all; NaN counts as zero."""
    sums = np.concatenate([[0.0], np.cumsum(np.nan_to_num(values))])
    last = np.arange(1, len(sums))
    first = np.maximum(last - samples, 0)
    return np.asarray((sums[last] - sums[first]) / (last - first))
