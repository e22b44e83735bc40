"""Runtimes relative to a reference kernel, so that the figures of two machines compare.

`tests/benchmarks` times the steps of every method, and in the same run the kernel below, with
pytest-benchmark. A method's figure here is the time of one of its steps over that of one step of
the kernel: a machine that is twice as fast, or a busy one, changes both.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import Field, ValidationError
from scipy import stats

from gripbench.compilation import compiled
from gripbench.configuration import Configuration
from gripbench.errors import InputError

REFERENCE = "test_reference_kernel"
"""Name of the benchmark that times the reference kernel."""

LABEL, FORM, STEPS = "label", "form", "steps"
"""Keys of a benchmark's `extra_info`: the method's label, `batch` or `online`, steps a call."""

QUANTILE = 0.25
"""Quantile of the rounds that stands for a step: what else the machine does disturbs the median."""

_CONFIDENCE = 1.0 - 0.05 / 4.0  # four quantiles make a ratio of two relative runtimes


class RelativeRuntime(Configuration):
    """Time of a step over that of a step of the reference kernel.

    Attributes
    ----------
    relative
        Ratio of the lower quartiles of the rounds.
    low, high
        Range of that ratio from distribution-free intervals of both quartiles, wide enough that
        two such ranges together hold with 95 %; None where there were too few rounds.
    step
        Lower quartile of the time of a step [s] on the machine that timed it.
    """

    relative: float = Field(gt=0.0)
    low: float | None = None
    high: float | None = None
    step: float = Field(gt=0.0)


@compiled
def reference_kernel(steps: int) -> float:
    """Run a pendulum with friction by Euler's method: the arithmetic of a small filter step.

    Parameters
    ----------
    steps
        Number of steps; each has a sine, a square root, a division and a dozen products and sums.
    """
    angle, rate = 1.0, 0.0
    for _ in range(steps):
        drag = 0.1 * rate * math.sqrt(1.0 + rate * rate) / (1.0 + 0.5 * angle * angle)
        rate += 1e-3 * (-9.81 * math.sin(angle) - drag + 0.5)
        angle += 1e-3 * rate
    return angle


def read_timings(path: Path) -> dict[str, dict[str, RelativeRuntime]]:
    """Return the runtimes in a file of pytest-benchmark, by label and form (`batch`, `online`).

    Raises
    ------
    InputError
        If the file is not one of pytest-benchmark or lacks the reference kernel.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        benchmarks = list(content["benchmarks"])
        names = [str(item["name"]) for item in benchmarks]
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError):
        raise InputError(
            f"{path}: not a file of pytest-benchmark; make one with "
            "'pytest tests/benchmarks --benchmark-only --benchmark-json=FILE'"
        ) from None
    if REFERENCE not in names:
        raise InputError(f"{path}: lacks the benchmark '{REFERENCE}' that runtimes relate to")
    try:
        reference = _Steps(benchmarks[names.index(REFERENCE)])
        found: dict[str, dict[str, RelativeRuntime]] = {}
        for item in benchmarks:
            info = item.get("extra_info", {})
            if LABEL in info:
                runtime = _Steps(item).relative_to(reference)
                found.setdefault(str(info[LABEL]), {})[str(info[FORM])] = runtime
    except (KeyError, TypeError, ValueError, ValidationError) as error:
        raise InputError(f"{path}: a benchmark lacks its times or steps ({error!r})") from None
    return dict(sorted(found.items()))


class _Steps:
    """Times of one step [s], one a round of a benchmark."""

    def __init__(self, benchmark: dict[str, Any]) -> None:
        steps = benchmark["extra_info"][STEPS]
        times = benchmark["stats"].get("data") or [benchmark["stats"]["q1"]]
        self._times: npt.NDArray[np.float64] = np.asarray(times, float) / steps
        self.typical = float(np.quantile(self._times, QUANTILE))

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of the quartile from order statistics; NaN with too few rounds."""
        test: Any = stats.quantile_test(self._times, p=QUANTILE)
        found = test.confidence_interval(_CONFIDENCE)
        return float(found.low), float(found.high)

    def relative_to(self, reference: _Steps) -> RelativeRuntime:
        (low, high), (reference_low, reference_high) = self.interval, reference.interval
        ends = low / reference_high, high / reference_low
        return RelativeRuntime(
            relative=self.typical / reference.typical,
            low=ends[0] if math.isfinite(ends[0]) else None,
            high=ends[1] if math.isfinite(ends[1]) else None,
            step=self.typical,
        )
