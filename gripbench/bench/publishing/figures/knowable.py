"""A bound in, the shade over the times at which nobody could know its target out."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gripbench.bench.bounds.bound import Bound
from gripbench.bench.publishing.figures.style import SHADE

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def shade_unknowable(axes: Axes, bound: Bound, label: str = "Not to be known") -> None:
    """Shade the times at which nobody could know the target, see `Bound.knowable`."""
    axes.fill_between(
        bound.time, 0.0, 1.0, where=~bound.knowable, transform=axes.get_xaxis_transform(),
        color=SHADE, alpha=0.25, linewidth=0.0, zorder=1, label=label,
    )  # fmt: skip
