"""Published rows as a data set: in, a frame of rows; out, one Parquet file and its card.

The file holds what is the same whenever the rows are made again: runtimes belong to a machine and
stand in the leaderboard.
"""

from __future__ import annotations

import io
from pathlib import Path

import pandas as pd

from gripbench.writing import write_atomically

ROWS = "rows.parquet"
CARD = "DATASET.md"
_OF_A_MACHINE = ("step_batch", "step_p50", "step_p99", "step_max", "deadline_misses")

_TEXT = """---
pretty_name: gripbench rows
license: mit
task_categories: [time-series-forecasting]
tags: [vehicle dynamics, state estimation, tyre-road friction, sideslip, benchmark]
configs:
  - config_name: rows
    data_files: rows.parquet
---

# Published rows of gripbench

One line a scenario, seed, method and target: {lines} lines of {methods} methods in {scenarios}
scenarios. Written by `gripbench publish`; read it with `pandas.read_parquet`, or rank it in Python
with `gripbench.rank(frame, target="sideslip")`.

- **What it is.** Errors of estimators of tyre-road friction and vehicle sideslip on simulated
  drives. A scenario whose name ends with `@1` is drawn from a population: every seed another car,
  road, drive and instruments, and the method knows the car on paper only. Without `@` it is the
  papers' setting, in which the method is told the very car that drives.
- **Columns.** `scenario`, `seed`, `label` (method, variant, settings), `target` (signal), `status`
  and `reason`, metrics by name (`rms` with `rms_total` and `rms_count`, so that runs pool by the
  mean of squares), `sensors`, `parameters`, `baseline`, `key` (digest of everything that the row
  was made from). SI units and radians.
- **What it is not.** Measurements of real vehicles; runtimes, which depend on the machine.
- **Made by.** The commit and versions in `manifest.json`; the same seeds give the same values, see
  docs/reliability.md for between which machines.
- **Licence and citation.** MIT; `CITATION.cff`.
"""


def write_dataset(results: Path, rows: pd.DataFrame) -> list[Path]:
    """Write rows and card into a folder; return their paths.

    Parameters
    ----------
    results
        Folder.
    rows
        Frame as `gripbench.bench.running.rows.frame_of` returns it.
    """
    kept = rows.drop(columns=[name for name in _OF_A_MACHINE if name in rows])
    kept = kept.sort_values(["scenario", "label", "target", "seed"], kind="stable")
    buffer = io.BytesIO()
    kept.reset_index(drop=True).to_parquet(buffer, index=False, compression="zstd")
    card = _TEXT.format(
        lines=len(kept), methods=kept["label"].nunique(), scenarios=kept["scenario"].nunique()
    )
    write_atomically(results / ROWS, buffer.getvalue())
    write_atomically(results / CARD, card)
    return [results / ROWS, results / CARD]
