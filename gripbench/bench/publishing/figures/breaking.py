"""The picture method x cause: from breaking points to a map, the darker the sooner."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from gripbench.bench.publishing.figures.style import WIDTH, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 14
"""Most causes in the picture, those that break most methods first."""

_SOONEST, _LATEST = 0.05, 4.0  # sizes at which causes are tried, over their range


def breaking_map(shares: pd.DataFrame, target: str) -> Figure:
    """Return the picture; call it within `style`.

    Parameters
    ----------
    shares
        From `gripbench.bench.ranking.sensitivity.breaking_table`; methods that are behind the best
        baseline without any error are left out.
    target
        Signal.
    """
    from matplotlib.colors import LogNorm

    shown = shares[(shares > 0.0).any(axis=1)]
    order = shown.clip(upper=10.0).mean().sort_values(kind="stable").index[:MOST]
    values = shown[order].to_numpy(float)
    rows, columns = values.shape
    figure = new_figure(1.6 + 0.24 * rows, WIDTH + 0.2)
    axes = figure.subplots()
    image = axes.imshow(
        np.where(np.isfinite(values), np.clip(values, _SOONEST, _LATEST), np.nan),
        cmap="viridis",
        norm=LogNorm(_SOONEST, _LATEST),
        aspect="auto",
    )
    for i, j in np.argwhere(np.isfinite(values)):
        dark = values[i, j] < 0.5
        axes.text(
            j, i, f"{values[i, j]:.2g}", ha="center", va="center", fontsize=6.0,
            color="white" if dark else "black",
        )  # fmt: skip
    axes.set_xticks(range(columns), list(order), rotation=45, ha="right", fontsize=7.0)
    axes.set_yticks(range(rows), list(shown.index), fontsize=7.0)
    axes.grid(visible=False)
    bar = figure.colorbar(image, ax=axes, shrink=0.8)
    bar.set_label("breaks at, over the range of the cause", fontsize=7.5)
    bar.ax.tick_params(labelsize=7.0)
    figure.suptitle(
        f"{target}: error of one cause at which the best baseline overtakes", x=0.01, ha="left"
    )
    return figure
