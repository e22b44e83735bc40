"""One row a cell: what became of one method on one seed of one scenario.

A row has three parts: what was run (scenario, seed, method and its settings), what came of it
(status, reason, scores), and what was measured on this machine (runtime). The first two are
the same bytes whenever the same cell is run; runtimes are not, and stay apart for that reason.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
)

from gripbench.bench.catalogue.training import Training
from gripbench.bench.scoring.metric import Value
from gripbench.bench.scoring.metrics import metrics
from gripbench.configuration import Configuration, parse
from gripbench.errors import LONGEST, InputError, one_line

if TYPE_CHECKING:
    import pandas as pd

SCHEMA_VERSION = 7
"""Version of the stored form; rows of every earlier version still load (see `_MIGRATIONS`)."""

Text = Annotated[str, BeforeValidator(lambda text: _storable(text))]
"""Words of somebody else: any text can be stored, on one line and cut where it is endless."""


def _storable(text: Any) -> Any:
    return one_line(text, LONGEST) if isinstance(text, str) else text


Checked = Literal["", "passed", "failed", "old", "missing"]
"""What the checks of a plug-in have said; empty: it needs none."""

Status = Literal["ok", "failed", "timeout", "diverged", "skipped"]


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
    training
        Time that the method's training took; None: it was not trained, or nobody says.
    """

    batch: float
    p50: float | None = None
    p99: float | None = None
    maximum: float | None = None
    samples: int = 0
    deadline_misses: float | None = None
    training: float | None = None


class LogWindow(Configuration):
    """The part of a log that a row is scored on.

    Attributes
    ----------
    run
        Which of the log's runs.
    start, end
        The interval [s] on the log's own clock, as in the quality report.
    """

    run: int = 0
    start: float
    end: float


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
    baseline
        Whether it is a guess or a textbook formula that methods are measured by.
    sensors, idealised
        Channels that it reads, and those of them that no sensor in a vehicle gives.
    targets
        Signals that it should have been scored on, so that a failure counts in each.
    scores
        By target and name of the metric (see `gripbench.bench.scoring.metric`).
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
    computed_outside
        Whether the estimates were handed in: neither causality nor runtime was checked.
    window
        Of a recording, what part of the log was scored.
    training
        How the method was trained; None: it was not.
    salt
        Digest of the secret from which the drive was drawn; empty: none, anybody can simulate it.
    over_prefixes
        Whether it was given the whole recording, and its causality checked at random cuts.
    method_digest
        Digest of source and settings of a plug-in; empty for a method that ships with gripbench.
    checked
        Mark of a plug-in's row, found when it is read, not stored in it: `passed`, `failed`, `old`
        or `missing`, as `gripbench check` left it (see `check_records`); empty: it needs none.
        Boards show every other mark than `passed`; the published one leaves such methods out.
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
    baseline: bool = False
    sensors: tuple[str, ...] = ()
    idealised: tuple[str, ...] = ()
    targets: tuple[str, ...] = ()
    status: Status
    reason: Text = ""
    scores: Annotated[
        dict[str, dict[str, Value]], AfterValidator(lambda scores: _score_of_any_run(scores))
    ] = Field(default_factory=dict)
    sample_period: float | None = None
    runtime: Runtime | None = None
    time_limit: float | None = None
    memory_limit: float | None = None
    passing: bool = False
    world: str = ""
    dependencies: dict[str, str] = Field(default_factory=dict)
    untracked: tuple[str, ...] = ()
    computed_outside: bool = False
    window: LogWindow | None = None
    training: Training | None = None
    salt: str = ""
    over_prefixes: bool = False
    method_digest: str = ""
    checked: Checked = Field(default="", exclude=True)
    versions: dict[str, str] = Field(default_factory=dict)

    @model_serializer(mode="wrap")
    def _without_what_is_usual(self, usual: SerializerFunctionWrapHandler) -> dict[str, Any]:
        content: dict[str, Any] = usual(self)
        for name in ("salt", "over_prefixes"):
            if not content[name]:
                del content[name]  # such a row is what it was before there were others
        return content


def _score_of_any_run(scores: dict[str, dict[str, Value]]) -> dict[str, dict[str, Value]]:
    """Raise ValueError where what every comparison rests on is missing or impossible."""
    for target, values in scores.items():
        if "rms" not in values or not values["rms"].total >= 0.0 or not values["rms"].count:
            raise ValueError(f"{target} has no RMS with a sum of squares and a count")
    return scores


def _to_metrics(content: dict[str, Any]) -> dict[str, Any]:
    """Return a row of version 3, whose scores had fixed fields, with its values by metric."""
    scores = content.get("scores", {})
    if not isinstance(scores, dict) or not all(isinstance(old, dict) for old in scores.values()):
        return {**content, "schema_version": 4}  # what it is not, the reader of rows says
    return {
        **content,
        "schema_version": 4,
        "scores": {target: _values_of(old) for target, old in scores.items()},
    }


def _values_of(old: dict[str, Any]) -> dict[str, Any]:
    """Return the values by metric of the scores that rows had up to version 3."""
    try:
        count = old["count"]
        found: dict[str, Any] = {
            "rms": {"value": old["rms"], "total": old["sum_of_squares"], "count": count},
            "peak": {"value": old["peak"]},
            "bias": {"value": old["bias"], "total": old["bias"] * count, "count": count},
            "convergence_time": {"value": old.get("convergence_time")},
        }
        for band, part in old.get("by_utilisation", {}).items():
            found[f"rms_{band}"] = _mean_square(part)
        if old.get("mean_nees") is not None:
            nees = old["mean_nees"]
            found["mean_nees"] = {"value": nees, "total": nees * count, "count": count}
        friction = old.get("friction")
        if friction is not None:
            found["excited_rms"] = _mean_square(friction)
            found["friction_delay"] = {"value": friction.get("delay")}
            if friction.get("jumped"):
                found["jump_delay"] = {"value": friction.get("jump_delay")}
    except (ArithmeticError, AttributeError, KeyError, TypeError, ValueError):
        return {"rms": old}  # no score of version 3: the reader of rows names it
    return found


def _mean_square(part: dict[str, Any]) -> dict[str, Any]:
    total, count = part["sum_of_squares"], part["count"]
    return {"value": math.sqrt(total / count), "total": total, "count": count}


_MIGRATIONS: dict[int, Callable[[dict[str, Any]], dict[str, Any]]] = {
    1: lambda content: {**content, "schema_version": 2},  # 2 added the response of the friction
    2: lambda content: {**content, "schema_version": 3},  # 3 added what a row rests on
    3: _to_metrics,
    4: lambda content: {**content, "schema_version": 5},  # 5 added where it was computed
    5: lambda content: {**content, "schema_version": 6},  # 6 added the window of a log
    6: lambda content: {**content, "schema_version": 7},  # 7 added how it was trained
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


def untracked(rows: Iterable[Row]) -> dict[str, list[str]]:
    """Return what each method did that no digest can follow, by label; nothing: left out."""
    found: dict[str, set[str]] = {}
    for row in rows:
        if row.untracked:
            found.setdefault(row.label, set()).update(row.untracked)
    return {label: sorted(words) for label, words in found.items()}


def frame_of(rows: Iterable[Row]) -> pd.DataFrame:
    """Return rows as a frame, one line for each target of each row.

    A row that is not `ok` has a line with NaN scores for each of its targets, so that no failure
    vanishes from a table made of the frame. Columns: `scenario, seed, label, method, variant,
    title, target, status, reason`, the columns of each metric, `sample_period, step_batch,
    step_p50, step_p99, step_max, deadline_misses, sensors, idealised, parameters, baseline,
    world, key, checked, computed_outside, log_run, log_from, log_to, training, training_time, salt,
    over_prefixes`: the
    three of a log say which run and what interval [s] on its own clock was scored, NaN for a
    simulated run; the two behind how the method was trained, in words, and how long that took [s].

    A metric has a column of its name; one that is pooled by totals also `<name>_total` and
    `<name>_count`, which for the RMS are called `sum_of_squares` and `count`. NaN: the metric has
    nothing to say; inf: not reached within the run (a time until an error stays small). A metric
    that is found in rows only, because its package is not installed here, has the column of its
    name.
    """
    import pandas as pd  # half a second that a worker process need not spend

    rows = list(rows)
    known = metrics()
    used = (name for row in rows for scores in row.scores.values() for name in scores)
    foreign = tuple(dict.fromkeys(name for name in used if name not in known))
    names = (*(name for metric in known.values() for name in metric.columns), *foreign)
    lines: list[dict[str, Any]] = []
    for row in rows:
        common = _common_columns(row)
        for target in row.targets or tuple(row.scores) or ("",):
            scores = _score_columns(row.scores.get(target, {}))
            lines.append({**common, "target": target, "count": 0, **scores})
    columns = [*_COMMON[:6], "target", *_COMMON[6:8], *names, *_COMMON[8:]]
    numbers = {name: int if name == "count" else float for name in names}
    return pd.DataFrame(lines, columns=columns).astype(numbers)


LOG_WINDOW = ("log_run", "log_from", "log_to")
"""Columns of the part of a log that a row is scored on."""

_COMMON = (
    "scenario", "seed", "label", "method", "variant", "title", "status", "reason",
    "sample_period", "step_batch", "step_p50", "step_p99", "step_max", "deadline_misses",
    "sensors", "idealised", "parameters", "baseline", "world", "key", "checked",
    "computed_outside", *LOG_WINDOW, "training", "training_time", "salt", "over_prefixes",
)  # fmt: skip


def _common_columns(row: Row) -> dict[str, Any]:
    runtime, window = row.runtime, row.window
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
        "baseline": row.baseline,
        "world": row.world,
        "key": row.key,
        "checked": row.checked,
        "computed_outside": row.computed_outside,
        "log_run": float(window.run) if window else math.nan,
        "log_from": window.start if window else math.nan,
        "log_to": window.end if window else math.nan,
        "training": row.training.text if row.training else "",
        "training_time": runtime.training if runtime else None,
        "salt": row.salt,
        "over_prefixes": row.over_prefixes,
    }


def _score_columns(scores: Mapping[str, Value]) -> dict[str, float]:
    known = metrics()
    columns: dict[str, float] = {}
    for name, value in scores.items():
        number = math.inf if value.value is None else value.value
        if name in known:
            numbers = (number, value.total, value.count)
            columns |= dict(zip(known[name].columns, numbers, strict=False))
        else:
            columns[name] = number
    return columns
