"""Errors of one run into RMS by the utilisation of the available friction, |a|/(mu g)."""

from __future__ import annotations

import math
from collections.abc import Callable

from gripbench.bench.scoring.metric import Context, Floats, Metric, running_total

UTILISATION_BANDS: tuple[tuple[str, float, float], ...] = (
    ("low", 0.0, 0.2),
    ("medium", 0.2, 0.5),
    ("high", 0.5, 0.8),
    ("limit", 0.8, math.inf),
)
"""Strata of the utilisation: name, from (inclusive), to (exclusive)."""


def _within(low: float, high: float) -> Callable[..., tuple[float, int] | None]:
    def squares(
        time: Floats, estimate: Floats, truth: Floats, context: Context
    ) -> tuple[float, int] | None:
        """Return squares and samples of a band; None where no sample lies in it."""
        used = context.utilisation
        if used is None:
            return None
        inside = (used >= low) & (used < high)
        error = (estimate - truth)[inside]
        return (running_total(error * error), len(error)) if len(error) else None

    return squares


def _words(low: float, high: float) -> str:
    return f"at {low:g}–{high:g} of mu" if high < 10.0 else f"above {low:g} of mu"


METRICS = tuple(
    Metric(
        f"rms_{name}",
        f"RMS {_words(low, high)}",
        f"RMS where the used share of the available friction is {name}",
        _within(-math.inf if low == 0.0 else low, math.inf if math.isinf(high) else high),
        "root_mean",
    )
    for name, low, high in UTILISATION_BANDS
)
