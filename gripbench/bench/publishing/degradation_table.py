"""From what each fault does to each method to tables: by method, by fault, and every line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.ranking.degradation import geometric_mean

_RATIO = ".2f"
_PAIRED = "RMS over that of the clean twin of the same seed, geometric mean over scenarios"
_RECOVERY = "Recovery: median time until the error is that of the twin again; inf: not in the run."
_ENDED = Column("recovery", "Recovery", "s", ".2f")
_LOST = Column("lost", "Runs lost", format="d")
_PAIRS = Column("pairs", "Pairs", format="d")


def degradation_tables(frame: pd.DataFrame) -> list[Table]:
    """Return two tables a target: what faults do to each method, and what each fault does.

    Parameters
    ----------
    frame
        From `gripbench.bench.ranking.degradation.degradation`.
    """
    found = []
    for target, part in frame.groupby("target", sort=False):
        severities = sorted(set(part["severity"]) - {0})
        by_severity = tuple(
            Column(f"severity_{number}", f"Severity {number}", format=_RATIO)
            for number in severities
        )
        methods = [
            {
                "label": label,
                **_by_severity(lines, severities),
                **_worst(lines, "fault"),
                **_ends(lines),
            }
            for label, lines in part.groupby("label", sort=False)
        ]
        faults = [
            {
                "kind": kind,
                **_by_severity(lines, severities),
                **_worst(lines, "label"),
                **_ends(lines),
            }
            for kind, lines in part.groupby("kind", sort=False)
        ]
        found += [
            Table(
                (Column("label", "Method"), *by_severity, Column("worst", "Worst fault"), _ENDED,
                 _LOST, _PAIRS),
                tuple(sorted(methods, key=_size)),
                f"{target}: what faults of the instruments do to each method",
                (f"{_PAIRED} and faults. {_RECOVERY}",),
            ),
            Table(
                (Column("kind", "Fault"), *by_severity, Column("worst", "Hits most"), _ENDED,
                 _LOST, _PAIRS),
                tuple(sorted(faults, key=_size, reverse=True)),
                f"{target}: what each fault of the instruments does",
                (f"{_PAIRED} and methods. {_RECOVERY}",),
            ),
        ]  # fmt: skip
    return found


def every_line(frame: pd.DataFrame, target: str) -> Table:
    """Return a line for each method and fault of a target."""
    columns = (
        Column("label", "Method"),
        Column("fault", "Fault"),
        Column("ratio", "RMS over clean", format=_RATIO),
        _ENDED,
        _LOST,
        _PAIRS,
    )
    part = frame[frame["target"] == target].sort_values(["fault", "ratio"], kind="stable")
    return Table.from_frame(part, columns, f"{target}: each fault and method", (f"{_PAIRED}.",))


def _by_severity(lines: pd.DataFrame, severities: list[int]) -> dict[str, float]:
    ratios = {
        f"severity_{number}": geometric_mean(lines.loc[lines["severity"] == number, "ratio"])
        for number in severities
    }
    return {**ratios, "ratio": geometric_mean(lines["ratio"])}


def _worst(lines: pd.DataFrame, column: str) -> dict[str, str]:
    """Return where the error rises most, with its factor; empty where it rises nowhere."""
    risen = lines[lines["ratio"] > 1.005]
    if risen.empty:
        return {"worst": ""}
    line = risen.iloc[int(risen["ratio"].argmax())]
    return {"worst": f"{line[column]} {line['ratio']:{_RATIO}}"}


def _ends(lines: pd.DataFrame) -> dict[str, float]:
    """Return median time of recovery, runs lost and pairs."""
    times = lines["recovery"].dropna()
    return {
        "recovery": float(times.median()) if len(times) else np.nan,
        "lost": int(lines["lost"].sum()),
        "pairs": int(lines["pairs"].sum()),
    }


def _size(row: Mapping[str, Any]) -> float:
    return float(row["ratio"]) if row["ratio"] == row["ratio"] else np.inf
