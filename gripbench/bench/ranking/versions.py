"""Rows in, an error out where those of one scenario come from two versions of it."""

from __future__ import annotations

import pandas as pd

from gripbench.errors import InputError

_MOST = 3
"""Most methods of a version that a message names."""


def check_versions(rows: pd.DataFrame) -> None:
    """Check that all rows of a scenario were made in, and scored by, the same version of it.

    Parameters
    ----------
    rows
        Frame as `gripbench.bench.running.rows.frame_of` returns it; rows that were skipped say
        nothing.

    Raises
    ------
    InputError
        If a scenario, or the scoring, changed between them: such rows share no board.
    """
    if "world" not in rows:
        return
    ran = rows[rows["status"] != "skipped"]
    for scenario, group in ran.groupby("scenario", sort=True):
        if group["world"].nunique() < 2:
            continue
        parts = []
        for _, part in group.groupby("world", sort=False):
            labels = sorted(set(part["label"]))
            more = f" and {len(labels) - _MOST} more" if len(labels) > _MOST else ""
            parts.append(", ".join(labels[:_MOST]) + more)
        raise InputError(
            f"scenario '{scenario}': it or the scoring changed between the rows of "
            f"{' and those of '.join(parts)}: run all methods again, or remove old rows with "
            f"'gripbench results prune --scenario {scenario}'"
        )
