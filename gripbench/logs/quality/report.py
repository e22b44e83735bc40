"""The quality report: what is odd about a log, and how its map is mended. Nothing is repaired."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from gripbench.envs.signals import signal
from gripbench.logs.channels.series import Floats, Series
from gripbench.logs.mapping.units import proposed_unit
from gripbench.logs.quality.plausibility import Misfit, misfits, speed_of

Severity = Literal["note", "warning", "wrong"]

_GAP = 5.0  # median intervals
_SHORTEST_STUCK = {"accelerometer": 1.0, "gyroscope": 1.0, "magnetometer": 3.0}
_STUCK_OTHERWISE = 10.0  # s; a held wheel or a quantised angle is no fault
_STUCK_SAMPLES = 20
_MOVING = 0.5  # m/s
_SPIKE = 12.0  # robust standard deviations of the steps
_SPIKE_SHARE = 0.25  # of the range from the 1st to the 99th percentile
_SATURATED_RUNS = 3
_SATURATED_SHARE = 0.002


@dataclass(frozen=True)
class Finding:
    """One thing that is odd.

    Attributes
    ----------
    severity
        `note`: good to know; `warning`: may spoil an estimate; `wrong`: contradicts physics.
    check
        Which check found it.
    channel
        Key in the map, such as `channels.yaw_rate`; empty for the log as a whole.
    message
        What was found.
    suggestion
        What to change in the map; empty where there is nothing to change.
    changes
        The same as keys of the map to set, by table.
    """

    severity: Severity
    check: str
    channel: str
    message: str
    suggestion: str = ""
    changes: dict[str, dict[str, Any]] = field(default_factory=dict)

    def line(self) -> str:
        """Return the finding as one line."""
        text = f"{self.severity:7}  {self.check:12}  {self.channel or 'log'}: {self.message}"
        return f"{text} -> {self.suggestion}" if self.suggestion else text


@dataclass(frozen=True)
class QualityReport:
    """All findings of a log."""

    findings: tuple[Finding, ...]

    def joined(self, other: QualityReport, run: int | None) -> QualityReport:
        """Return both reports as one; findings of `other` tell their run unless it is None."""
        added = other.findings
        if run is not None:
            added = tuple(replace(f, message=f"run {run}: {f.message}") for f in added)
        return QualityReport(self.findings + added)

    def with_notes(self, notes: Iterable[str]) -> QualityReport:
        """Return the report with sentences about the file itself as warnings."""
        added = tuple(Finding("warning", "file", "", note) for note in notes)
        return QualityReport(added + self.findings)

    def of(self, severity: Severity) -> tuple[Finding, ...]:
        """Return the findings of one severity."""
        return tuple(finding for finding in self.findings if finding.severity == severity)

    def records(self) -> list[dict[str, Any]]:
        """Return the findings as dictionaries."""
        return [asdict(finding) for finding in self.findings]

    def text(self) -> str:
        """Return the report as lines, the worst first."""
        order: tuple[Severity, ...] = ("wrong", "warning", "note")
        lines = [finding.line() for severity in order for finding in self.of(severity)]
        return "\n".join(lines) if lines else "nothing odd was found"


def judge(
    channels: dict[str, Series],
    reference: dict[str, Series],
    dropped: dict[str, int],
    zeros: dict[str, float],
    vehicle: dict[str, float] | None = None,
) -> QualityReport:
    """Return what is odd about the series of one run.

    Parameters
    ----------
    channels, reference
        Series by signal name.
    dropped
        Samples by channel that fell between two rows.
    zeros
        Zeros that the map had taken off, by channel.
    vehicle
        Vehicle parameters; some checks need the wheel radius or the wheelbase.
    """
    findings: list[Finding] = []
    mapped = {s.key: s for s in [*channels.values(), *reference.values()] if "derived" not in s.key}
    speed = speed_of(channels, reference, vehicle or {})
    for series in mapped.values():
        findings += _of_times(series)
        findings += _of_unit(series)
        findings += _stuck(series, speed)
        findings += _spikes(series)
        findings += _saturated(series)
    findings += [
        Finding("note", "rows", channels[name].key, f"{count} samples fell between two rows")
        for name, count in dropped.items()
        if count
    ]
    findings += [
        Finding("note", "zero", channels[name].key, f"{value:.6g} was taken off as its zero")
        for name, value in zeros.items()
    ]
    findings += [_of_misfit(misfit) for misfit in misfits(channels, reference, vehicle or {})]
    return QualityReport(tuple(findings))


def _of_misfit(misfit: Misfit) -> Finding:
    return Finding(
        "wrong" if misfit.suggestion else "warning",
        misfit.check,
        misfit.key,
        misfit.message,
        misfit.suggestion,
        misfit.changes,
    )


def _of_times(series: Series) -> list[Finding]:
    counts = (
        (series.repeated, "rows have the time of the row before; the last of them is kept"),
        (series.backwards, "rows go back in time and were dropped, as the map says"),
        (series.missing, "rows have no value; the last one holds"),
        (series.infinite, "values are infinite and were left out"),
    )
    found = [
        Finding("note" if text.startswith("rows have no") else "warning", "times", series.key,
                f"{count} {text}")
        for count, text in counts
        if count
    ]  # fmt: skip
    spacing = np.diff(series.times)
    if len(spacing):
        usual = float(np.median(spacing))
        gaps = spacing > _GAP * usual
        if gaps.any():
            at = int(np.argmax(spacing))
            found.append(
                Finding(
                    "warning",
                    "gaps",
                    series.key,
                    f"{int(gaps.sum())} gaps, the longest {spacing[at]:.3f} s after "
                    f"{series.times[at]:.3f} s; samples come every {usual:.4g} s",
                )
            )
    return found


def _of_unit(series: Series) -> list[Finding]:
    named = proposed_unit(series.log_unit) if series.log_unit else None
    if named is None or named == series.column.unit:
        return []
    return [
        Finding(
            "warning",
            "unit",
            series.key,
            f"the log says '{series.log_unit}', the map '{series.column.unit}'",
            f'unit = "{named}"',
        )
    ]


def _stuck(series: Series, speed: Series | None) -> list[Finding]:
    values, times = series.values, series.times
    if len(values) < _STUCK_SAMPLES:
        return []
    if np.all(values == values[0]):
        return [Finding("note", "stuck", series.key, f"is {values[0]:.6g} throughout")]
    shortest = _SHORTEST_STUCK.get(signal(series.name).instrument, _STUCK_OTHERWISE)
    starts, ends = _level_runs(values)
    long = (times[ends] - times[starts] >= shortest) & (ends - starts + 1 >= _STUCK_SAMPLES)
    if speed is not None:
        moving = np.interp(0.5 * (times[starts] + times[ends]), speed.times, np.abs(speed.values))
        long &= moving > _MOVING
    if not long.any():
        return []
    longest = np.flatnonzero(long)[np.argmax((times[ends] - times[starts])[long])]
    start, end = times[starts[longest]], times[ends[longest]]
    return [
        Finding(
            "warning",
            "stuck",
            series.key,
            f"keeps one value for {end - start:.2f} s from {start:.3f} s while the vehicle moves"
            f" ({int(long.sum())} such stretches)",
        )
    ]


def _level_runs(values: Floats) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return first and last row of every stretch of equal values."""
    changes = np.flatnonzero(np.diff(values) != 0.0)
    return np.append(0, changes + 1), np.append(changes, len(values) - 1)


def _spikes(series: Series) -> list[Finding]:
    values = np.unwrap(series.values) if series.name in ("course", "yaw") else series.values
    if len(values) < _STUCK_SAMPLES:
        return []
    steps = np.diff(values)
    moving = np.abs(steps[steps != 0.0])
    if not len(moving):
        return []
    usual = 1.4826 * float(np.median(moving))
    low, high = np.percentile(values, (1.0, 99.0))
    threshold = max(_SPIKE * usual, _SPIKE_SHARE * (high - low))
    out, back = steps[:-1], steps[1:]
    spikes = (np.minimum(np.abs(out), np.abs(back)) > threshold) & (out * back < 0.0)
    if not spikes.any():
        return []
    at = int(np.argmax(np.where(spikes, np.abs(out), 0.0))) + 1
    return [
        Finding(
            "warning",
            "jumps",
            series.key,
            f"{int(spikes.sum())} single values stand out, the farthest {values[at]:.6g} at "
            f"{series.times[at]:.3f} s between {values[at - 1]:.6g} and {values[at + 1]:.6g}",
        )
    ]


def _saturated(series: Series) -> list[Finding]:
    values = series.values
    found = []
    starts, ends = _level_runs(values)
    lengths = ends - starts + 1
    for extreme, word in ((values.max(), "highest"), (values.min(), "lowest")):
        at = (values[starts] == extreme) & (lengths >= 3)
        share = float(lengths[at].sum()) / len(values)
        if at.sum() >= _SATURATED_RUNS and share >= _SATURATED_SHARE and extreme != 0.0:
            found.append(
                Finding(
                    "warning",
                    "saturation",
                    series.key,
                    f"stays at its {word} value {extreme:.6g} in {int(at.sum())} stretches, "
                    f"{100.0 * share:.1f} % of its samples",
                )
            )
    return found
