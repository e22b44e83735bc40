"""The board of faults on a terminal: what each fault does to each method."""

from __future__ import annotations

import math

import pandas as pd
from rich.markup import escape
from rich.table import Table

from gripbench.bench.publishing.presentation import console, significant


def print_degradation(frame: pd.DataFrame) -> None:
    """Print a table for each target; frame from `gripbench.bench.ranking.degradation`."""
    out = console()
    for target, part in frame.groupby("target", sort=False):
        table = Table(
            "method", "fault", "RMS over clean", "recovery [s]", "lost", "pairs",
            title=escape(f"{target}: faulty runs over their clean twins of the same seed"),
        )  # fmt: skip
        for _, line in part.sort_values(["fault", "ratio"], kind="stable").iterrows():
            table.add_row(
                escape(line["label"]),
                escape(line["fault"]),
                significant(line["ratio"]),
                _seconds(line["recovery"]),
                str(line["lost"]),
                str(line["pairs"]),
            )
        out.print(table)


def _seconds(value: float) -> str:
    if math.isinf(value):
        return "not in the run"
    return "-" if math.isnan(value) else f"{value:.2f}"
