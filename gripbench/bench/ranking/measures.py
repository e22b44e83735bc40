"""What a board ranks by: a name in, which columns of the rows are pooled and how out.

By `rms` methods are ranked by their errors, by `crps` by what they state of their errors: the
continuous ranked probability score is lowest for who states a narrow distribution that is true. A
method that states none has no score there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import pandas as pd

from gripbench.bench.ranking.resolution import resolution
from gripbench.errors import unknown

By = Literal["rms", "crps"]

SILENT = "silent"
"""Status of a finished run on a board of uncertainty whose method states none."""


@dataclass(frozen=True)
class Measure:
    """A score of runs that is pooled over them.

    Attributes
    ----------
    name
        Column of its value in a run.
    title
        Heading in tables.
    total, count
        Columns of what is summed up over runs, and over how many samples.
    rooted
        Whether the pooled value is the root of the mean.
    """

    name: By
    title: str
    total: str
    count: str
    rooted: bool

    def floor(self, target: str) -> float:
        """Return the value below which no scenario counts as better, in the target's unit.

        That of the CRPS is what a normal distribution with the resolution's deviation scores on
        average where it is true.
        """
        return resolution(target) / (1.0 if self.rooted else math.sqrt(math.pi))

    def scored(self, rows: pd.DataFrame) -> pd.DataFrame:
        """Return the rows with the status `silent` where a finished run has no value."""
        if self.name not in rows:
            rows = rows.assign(**dict.fromkeys((self.name, self.total, self.count), math.nan))
        silent = (rows["status"] == "ok") & rows[self.name].isna()
        if not silent.any():
            return rows
        return rows.assign(
            status=rows["status"].mask(silent, SILENT),
            reason=rows["reason"].mask(silent, "it states no uncertainty"),
        )


MEASURES: dict[str, Measure] = {
    "rms": Measure("rms", "RMS", "sum_of_squares", "count", True),
    "crps": Measure("crps", "CRPS", "crps_total", "crps_count", False),
}
"""What boards can rank by."""

RMS = MEASURES["rms"]


def measure_of(name: str) -> Measure:
    """Return a measure by its name.

    Raises
    ------
    InputError
        If there is none.
    """
    if name not in MEASURES:
        raise unknown("measure to rank by", name, MEASURES)
    return MEASURES[name]
