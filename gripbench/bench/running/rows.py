"""One row a cell: what became of one method on one seed of one scenario.

A row has three parts: what was run (scenario, seed, method and its settings), what came of it
(status, reason, scores), and what was measured on this machine (runtime). The first two are
the same bytes whenever the same cell is run; runtimes are not, and stay apart for that reason.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from gripbench.configuration import Configuration, parse
from gripbench.errors import LONGEST, InputError, one_line

if TYPE_CHECKING:
    import pandas as pd

SCHEMA_VERSION = 3
"""Version of the stored form; rows of every earlier version still load (see `_MIGRATIONS`)."""

Text = Annotated[str, BeforeValidator(lambda text: _storable(text))]
"""Words of somebody else: any text can be stored, on one line and cut where it is endless."""


def _storable(text: Any) -> Any:
    return one_line(text, LONGEST) if isinstance(text, str) else text


Status = Literal["ok", "failed", "timeout", "diverged", "skipped"]

UTILISATION_BANDS: tuple[tuple[str, float, float], ...] = (
    ("low", 0.0, 0.2),
    ("medium", 0.2, 0.5),
    ("high", 0.5, 0.8),
    ("limit", 0.8, math.inf),
)
"""Strata of the utilisation of the available friction: name, from (inclusive), to (exclusive)."""


class Stratum(Configuration):
    """Sum of squared errors over the samples of one band of utilisation."""

    sum_of_squares: float = Field(ge=0.0)
    count: int = Field(ge=0)

    @property
    def rms(self) -> float | None:
        """Root mean square error, None without a sample."""
        return math.sqrt(self.sum_of_squares / self.count) if self.count else None


class FrictionResponse(Configuration):
    """How an estimate of the available friction answers lateral excitation.

    `gripbench.bench.scoring.friction_response` defines excitation and delay.

    Attributes
    ----------
    sum_of_squares, count
        Squared errors and samples from the first excitation on.
    delay
        Time [s] from the first excitation until the estimate has settled; None: it never does.
    jumped
        Whether the friction jumps in this run.
    jump_delay
        Time [s] from the jump until the estimate has settled again; None: it never does.
    """

    sum_of_squares: float = Field(ge=0.0)
    count: int = Field(ge=0)
    delay: float | None = None
    jumped: bool = False
    jump_delay: float | None = None


class TargetScore(Configuration):
    """Scores of one estimated signal over the scored samples of one run.

    Attributes
    ----------
    rms
        Root mean square error, in the signal's unit.
    sum_of_squares, count
        What `rms` is made of, so that runs can be pooled by the mean of squares.
    peak
        Largest absolute error.
    bias
        Mean of estimate minus truth.
    convergence_time
        Time [s] until the error stays within its band (see `gripbench.bench.scoring.scoring`); None
        where it never does.
    by_utilisation
        The same sums for each band of utilisation in `UTILISATION_BANDS`; empty where the truth
        knows no utilisation.
    mean_nees
        Mean of squared error over the method's own variance, 1 for a consistent filter; None
        where the method gives no variance, or one that is not positive.
    friction
        For the available friction, its response to excitation; None where there is none.
    """

    rms: float = Field(ge=0.0)
    sum_of_squares: float = Field(ge=0.0)
    count: int = Field(ge=0)
    peak: float
    bias: float
    convergence_time: float | None = None
    by_utilisation: dict[str, Stratum] = Field(default_factory=dict)
    mean_nees: float | None = None
    friction: FrictionResponse | None = None


class Runtime(Configuration):
    """Time that one step takes [s], measured where and when the row was made.

    Attributes
    ----------
    batch
        Whole run over number of samples, in the form the benchmark runs it.
    p50, p99, maximum
        Quantiles of single online calls; None where they were not measured in this cell.
    samples
        Number of single calls behind the quantiles.
    deadline_misses
        Share of those calls that took longer than the sample period.
    """

    batch: float
    p50: float | None = None
    p99: float | None = None
    maximum: float | None = None
    samples: int = 0
    deadline_misses: float | None = None


class Row(Configuration):
    """One cell of the benchmark.

    Attributes
    ----------
    key
        Digest of everything that the result depends on; another key means: run again.
    method, variant, label
        Name, variant, and the name that tables show: `name` or `name:variant`, with a digest of
        the overridden parameters where there are any.
    parameters
        Every setting of the method by name.
    sensors, idealised
        Channels that it reads, and those of them that no sensor in a vehicle gives.
    targets
        Signals that it should have been scored on, so that a failure counts in each.
    status, reason
        `ok`, or what went wrong in one sentence.
    sample_period
        Nominal time [s] between samples: the deadline of a step.
    time_limit, memory_limit
        Limit [s], [MiB] that ended it: under a larger one it runs again.
    passing
        Whether what ended it lay outside the method (a kill, an edit while it ran): it runs again.
    world
        Digest of scenario and scoring: rows of two worlds never share a board.
    dependencies
        Digest of each file, folder and environment variable that the method was seen to read, by
        kind and name; where one differs the cell runs again.
    untracked
        What it did whose result no digest can follow: the row is never used again.
    """

    schema_version: int = SCHEMA_VERSION
    key: str
    scenario: str
    seed: int = Field(ge=0)
    method: str
    title: Text = ""
    variant: str = ""
    label: str
    parameters: dict[str, float | Text | bool | None] = Field(default_factory=dict)
    sensors: tuple[str, ...] = ()
    idealised: tuple[str, ...] = ()
    targets: tuple[str, ...] = ()
    status: Status
    reason: Text = ""
    scores: dict[str, TargetScore] = Field(default_factory=dict)
    sample_period: float | None = None
    runtime: Runtime | None = None
    time_limit: float | None = None
    memory_limit: float | None = None
    passing: bool = False
    world: str = ""
    dependencies: dict[str, str] = Field(default_factory=dict)
    untracked: tuple[str, ...] = ()
    versions: dict[str, str] = Field(default_factory=dict)


_MIGRATIONS: dict[int, Callable[[dict[str, Any]], dict[str, Any]]] = {
    1: lambda content: {**content, "schema_version": 2},  # 2 added the response of the friction
    2: lambda content: {**content, "schema_version": 3},  # 3 added what a row rests on
}
"""For each earlier version, the function that turns its content into the next version's."""


def is_newer(content: dict[str, Any]) -> bool:
    """Tell whether a later gripbench wrote a row."""
    version = content.get("schema_version")
    return isinstance(version, int) and version > SCHEMA_VERSION


def row_from(content: dict[str, Any], source: str) -> Row:
    """Return a row from its stored content, of this or any earlier schema version.

    Raises
    ------
    InputError
        If a newer gripbench wrote it, or it is no row.
    """
    version = content.get("schema_version") if isinstance(content, dict) else None
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        raise InputError(f"{source}: key 'schema_version' is {version!r}: not a row of gripbench")
    if is_newer(content):
        raise InputError(
            f"{source}: written by a newer gripbench (schema version {version}, this one reads "
            f"up to {SCHEMA_VERSION}); update gripbench or choose another results folder"
        )
    while version < SCHEMA_VERSION:
        content = _MIGRATIONS[version](content)
        version += 1
    return parse(Row, content, source)


def frame_of(rows: Iterable[Row]) -> pd.DataFrame:
    """Return rows as a frame, one line for each target of each row.

    A row that is not `ok` has a line with NaN scores for each of its targets, so that no failure
    vanishes from a table made of the frame. Columns: `scenario, seed, label, method, variant,
    title, target, status, reason, rms, sum_of_squares, count, peak, bias, convergence_time,
    mean_nees, excited_sum_of_squares, excited_count, friction_delay, jump_delay, rms_<band>,
    sum_of_squares_<band>, count_<band>` for each utilisation band, `sample_period, step_batch,
    step_p50, step_p99, step_max, deadline_misses, sensors, idealised, parameters, key`. Delays of
    the friction are inf where it never settles, and NaN where nothing excites it or it does not
    jump.
    """
    import pandas as pd  # half a second that a worker process need not spend

    lines: list[dict[str, Any]] = []
    for row in rows:
        common = _common_columns(row)
        for target in row.targets or tuple(row.scores) or ("",):
            lines.append({**common, "target": target, **_score_columns(row.scores.get(target))})
    columns = [*_COMMON[:6], "target", *_COMMON[6:8], *_SCORE_COLUMNS, *_COMMON[8:]]
    return pd.DataFrame(lines, columns=columns)


_COMMON = (
    "scenario", "seed", "label", "method", "variant", "title", "status", "reason",
    "sample_period", "step_batch", "step_p50", "step_p99", "step_max", "deadline_misses",
    "sensors", "idealised", "parameters", "key",
)  # fmt: skip


def _common_columns(row: Row) -> dict[str, Any]:
    runtime = row.runtime
    return {
        "scenario": row.scenario,
        "seed": row.seed,
        "label": row.label,
        "method": row.method,
        "variant": row.variant,
        "title": row.title,
        "status": row.status,
        "reason": row.reason,
        "sample_period": row.sample_period,
        "step_batch": runtime.batch if runtime else None,
        "step_p50": runtime.p50 if runtime else None,
        "step_p99": runtime.p99 if runtime else None,
        "step_max": runtime.maximum if runtime else None,
        "deadline_misses": runtime.deadline_misses if runtime else None,
        "sensors": " ".join(row.sensors),
        "idealised": " ".join(row.idealised),
        "parameters": " ".join(f"{name}={value}" for name, value in row.parameters.items()),
        "key": row.key,
    }


_PLAIN_SCORES = (
    "rms", "sum_of_squares", "count", "peak", "bias", "convergence_time", "mean_nees",
)  # fmt: skip
_FRICTION_SCORES = ("excited_sum_of_squares", "excited_count", "friction_delay", "jump_delay")
_SCORE_COLUMNS = (
    *_PLAIN_SCORES,
    *_FRICTION_SCORES,
    *(f"{kind}_{band}" for band, _, _ in UTILISATION_BANDS
      for kind in ("rms", "sum_of_squares", "count")),
)  # fmt: skip


def _score_columns(score: TargetScore | None) -> dict[str, float | None]:
    if score is None:
        return {**dict.fromkeys(_SCORE_COLUMNS, math.nan), "count": 0}
    columns: dict[str, float | None] = {name: getattr(score, name) for name in _PLAIN_SCORES}
    if score.friction is not None:
        friction = score.friction
        columns["excited_sum_of_squares"] = friction.sum_of_squares
        columns["excited_count"] = friction.count
        columns["friction_delay"] = math.inf if friction.delay is None else friction.delay
        if friction.jumped:
            late = friction.jump_delay
            columns["jump_delay"] = math.inf if late is None else late
    for band, stratum in score.by_utilisation.items():
        columns[f"rms_{band}"] = stratum.rms
        columns[f"sum_of_squares_{band}"] = stratum.sum_of_squares
        columns[f"count_{band}"] = stratum.count
    return columns


def pooled_rms(sums_of_squares: Iterable[float], counts: Iterable[float]) -> float:
    """Return the RMS over several runs: root of all squares over all samples, never a mean of RMS.

    Examples
    --------
    >>> pooled_rms([4.0, 0.0], [1, 1])
    1.4142135623730951
    """
    total = float(sum(counts))
    return math.sqrt(math.fsum(sums_of_squares) / total) if total else math.nan
