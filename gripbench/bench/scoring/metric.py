"""What a metric is: estimate and truth of one run in, one value out; values of runs pooled.

A metric is one object: its name, how it reads in a table, its unit, how the values of several
runs become one, and a function of time, estimate, truth and context. Those that ship lie in
`gripbench.bench.scoring.metrics`, one file a subject; a package of its own adds more through the
entry point group `gripbench.metrics` (see docs/add-a-metric.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from gripbench.bench.scoring.distributions import Innovations, Normal, Quantiles, Stated
from gripbench.configuration import Configuration
from gripbench.errors import GripbenchError, InputError

Floats = npt.NDArray[np.float64]

Pooling = Literal["root_mean", "mean", "maximum", "median"]
"""How values of runs become one: root of all totals over all counts, all totals over all counts,
the largest value, the median of the values."""

SIGNAL_UNIT = "signal"
"""As the unit of a metric: that of the signal that is estimated."""


class MetricError(GripbenchError):
    """A metric gave something else than its pooling needs, or what is not finite."""


class Value(Configuration):
    """A metric's value in one run, and what it is pooled by.

    Attributes
    ----------
    value
        The value, in the metric's unit; None: not reached within the run, counted as infinite.
    total, count
        What is summed up over runs, and how often it occurs in this one (samples, as a rule);
        count 0 for a metric that is pooled by its values.
    """

    value: float | None
    total: float = 0.0
    count: int = Field(default=0, ge=0)


@dataclass(frozen=True)
class Context:
    """What a metric may look at besides estimate and truth; arrays of the scored samples alone.

    Attributes
    ----------
    target
        Name of the signal.
    score_from
        Time [s] from which samples count.
    notes
        The recording's notes, such as `friction_step` [s].
    variance
        The method's own variance of the estimate, shape (n,); None where it gives none.
    channels
        Function that returns a channel of the truth, shape (n,), or None where there is none.
    bounded
        Whether only an interval is known of the signal; the truth is its point next to the
        estimate.
    quantiles
        The method's own quantiles; None where it gives none.
    innovations
        What the method shows of its innovations; None where it shows none.
    """

    target: str
    score_from: float
    notes: Mapping[str, float]
    variance: Floats | None
    channels: Callable[[str], Floats | None]
    bounded: bool = False
    quantiles: Quantiles | None = None
    innovations: Innovations | None = None

    @property
    def utilisation(self) -> Floats | None:
        """Share of the available friction that is used; None where the truth does not know it."""
        return self.channels("utilisation")

    @cached_property
    def deviation(self) -> Floats | None:
        """The method's own standard deviation; None where it gives none that is positive."""
        if self.variance is None or not np.all((self.variance > 0.0) & np.isfinite(self.variance)):
            return None
        return np.sqrt(self.variance)

    def stated(self, error: Floats) -> Stated | None:
        """Return what the method states of its error (estimate less truth); None: nothing.

        Nor is there anything to hold it against where only an interval of the signal is known.
        """
        if self.bounded:
            return None
        if self.variance is not None and self.deviation is not None:
            return Normal(error, self.deviation, self.variance)
        return self.quantiles


Compute = Callable[[Floats, Floats, Floats, Context], Any]
"""Time [s], estimate, truth, context into a value; None where the metric says nothing."""


@dataclass(frozen=True)
class Metric:
    """One metric.

    Attributes
    ----------
    name
        Unique name: lower case letters, digits, underscores. It names the columns of frames.
    title
        Heading in tables.
    description
        One sentence.
    compute
        Function of time [s], estimate, truth (shape (n,), finite, scored samples only, angles on
        the truth's branch) and `Context`. It returns None where it has nothing to say; else for
        the poolings `root_mean` and `mean` a pair (total, count), for `maximum` and `median` a
        number, which may be infinite with `median`: not reached within the run.
    pooling
        How values of several runs become one.
    unit
        SI unit, `-` for none; `SIGNAL_UNIT` for that of the estimated signal.
    reached
        With `median`: name of the column with the share of runs whose value is finite; empty:
        none.
    whole
        Whether several runs have a value only where each has one: a method could otherwise choose
        the runs that count.
    format
        Format specification of its numbers in tables.
    """

    name: str
    title: str
    description: str
    compute: Compute
    pooling: Pooling = "mean"
    unit: str = SIGNAL_UNIT
    reached: str = ""
    format: str = ".4g"
    whole: bool = False

    def __post_init__(self) -> None:
        plain = self.name.replace("_", "a")
        if not (plain.isascii() and plain.isalnum() and plain == plain.lower()):
            raise InputError(
                f"metric '{self.name}': a name has lower case letters, digits and underscores"
            )
        if self.pooling not in ("root_mean", "mean", "maximum", "median"):
            raise InputError(
                f"metric '{self.name}': pooling is '{self.pooling}'; it must be root_mean, mean, "
                "maximum or median"
            )

    @property
    def summed(self) -> bool:
        """Whether it is pooled by totals and counts."""
        return self.pooling in ("root_mean", "mean")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its columns in a frame of rows."""
        if self.name == "rms":  # what every comparison is made of has names of its own
            return "rms", "sum_of_squares", "count"
        return (self.name, f"{self.name}_total", f"{self.name}_count") if self.summed else (
            self.name,
        )  # fmt: skip

    def of_run(
        self, time: Floats, estimate: Floats, truth: Floats, context: Context
    ) -> Value | None:
        """Return the value in one run, None where the metric says nothing.

        Raises
        ------
        MetricError
            If the function fails, or what it gives is not finite or of another form.
        """
        where = f"metric '{self.name}' of {context.target}"
        try:
            found = self.compute(time, estimate, truth, context)
        except Exception as error:
            raise MetricError(f"{where}: {type(error).__name__}: {error}") from error
        if found is None:
            return None
        try:
            if self.summed:
                total, count = float(found[0]), int(found[1])
            else:
                total, count = float(found), 0
        except (TypeError, ValueError, IndexError):
            form = "a pair (total, count)" if self.summed else "a number"
            raise MetricError(f"{where} is {found!r}, not {form} or None") from None
        if self.pooling == "median" and math.isinf(total):
            return Value(value=None)
        if not math.isfinite(total):
            raise MetricError(f"{where} is {total}")
        if not self.summed:
            return Value(value=total)
        return Value(value=self._mean(total, count), total=total, count=count) if count else None

    def _mean(self, total: float, count: float) -> float:
        mean = total / count
        return math.sqrt(mean) if self.pooling == "root_mean" else mean

    def pooled(self, *columns: Iterable[float]) -> float:
        """Return the value of several runs from what `columns` names; NaN where none has one."""
        first, *sums = (np.asarray(values, float) for values in columns)
        known = ~np.isnan(first)
        if not known.any() or (self.whole and not known.all()):
            return math.nan
        if self.summed:
            totals, counts = sums[0][known], sums[1][known]
            return self._mean(math.fsum(totals), float(counts.sum()))
        return float(first[known].max() if self.pooling == "maximum" else np.median(first[known]))


def running_total(values: Floats) -> float:
    """Return the sum from the first value to the last, in that order: the same on any machine."""
    return float(np.cumsum(values)[-1]) if len(values) else 0.0


def pooled_rms(sums_of_squares: Iterable[float], counts: Iterable[float]) -> float:
    """Return the RMS over several runs: root of all squares over all samples, never a mean of RMS.

    Examples
    --------
    >>> pooled_rms([4.0, 0.0], [1, 1])
    1.4142135623730951
    """
    total = float(sum(counts))
    return math.sqrt(math.fsum(sums_of_squares) / total) if total else math.nan
