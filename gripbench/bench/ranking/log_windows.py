"""Rows of recordings in; in words which part of each log was scored, on its own clock, out."""

from __future__ import annotations

from itertools import groupby

import pandas as pd

from gripbench.bench.running.rows import LOG_WINDOW


def scored_windows(rows: pd.DataFrame) -> dict[str, str]:
    """Return what was scored of each recording, by scenario; nothing of a simulated one.

    Parameters
    ----------
    rows
        Frame as `gripbench.bench.running.rows.frame_of` returns it.
    """
    if not {*LOG_WINDOW} <= set(rows):  # a frame of earlier rows
        return {}
    known = rows[rows["log_from"].notna()].drop_duplicates(["scenario", "seed"])
    return {
        str(scenario): _words(part.sort_values(["log_run", "log_from"]))
        for scenario, part in known.groupby("scenario", sort=False)
    }


def _words(part: pd.DataFrame) -> str:
    """Return the intervals of a log; windows that touch are one interval."""
    several = part["log_run"].nunique() > 1
    runs = []
    for run, lines in groupby(part[list(LOG_WINDOW)].itertuples(index=False), lambda line: line[0]):
        spans: list[tuple[float, float]] = []
        for _, start, end in lines:
            if spans and spans[-1][1] == start:
                spans[-1] = (spans[-1][0], end)
            else:
                spans.append((start, end))
        text = ", ".join(f"{start:.3f} to {end:.3f} s" for start, end in spans)
        runs.append(f"run {run:.0f} {text}" if several else text)
    count = len(part)
    return f"{'; '.join(runs)} of the log's own clock, {count} window{'s' if count != 1 else ''}"
