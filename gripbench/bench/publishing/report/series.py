"""Time series of the report: truth, estimates and error bands, small enough for one page."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import joblib
import numpy as np
import numpy.typing as npt

from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.publishing.figures.runs import Runs
from gripbench.bench.publishing.figures.style import axis_scale
from gripbench.bench.running.recorded_scenarios import log_window
from gripbench.bench.scoring.scoring import on_branch
from gripbench.errors import GripbenchError

Floats = npt.NDArray[np.float64]

POINTS = 400
"""Points of a curve on the page."""

BAND = (5.0, 50.0, 95.0)
"""Percentiles over the seeds that an error band shows: lower edge, middle, upper edge."""

_LEVELS = 65534  # of 16 bits, one left for what is missing


@dataclass(frozen=True)
class SeriesPlan:
    """What to draw of one scenario.

    Attributes
    ----------
    scenario
        Its name.
    estimates
        Labels of the methods by target.
    shown
        Seeds of which the page holds the curves.
    band
        Seeds over which error bands are taken.
    own
        What to choose for the labels of methods from files.
    place
        What to choose for the scenario: the folder or map of a recording; empty: its name.
    """

    scenario: str
    estimates: Mapping[str, tuple[str, ...]]
    shown: tuple[int, ...]
    band: tuple[int, ...]
    own: Mapping[str, str] = field(default_factory=dict)
    place: str = ""


def packed(values: Floats) -> dict[str, Any]:
    """Return values as 16-bit steps within their range, base64 of little-endian numbers.

    The page restores them as `low + step * number`, and 65535 as missing.

    Examples
    --------
    >>> packed(np.array([0.0, 1.0]))["low"]
    0.0
    """
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
    step = (high - low) / _LEVELS
    numbers = np.full(values.shape, _LEVELS + 1)
    known = np.isfinite(values)
    if step > 0.0:
        numbers[known] = np.rint((values[known] - low) / step)
    else:
        numbers[known] = 0
    data = base64.b64encode(numbers.astype("<u2").tobytes()).decode("ascii")
    return {"low": low, "step": step, "data": data}


def unpacked(series: Mapping[str, Any]) -> Floats:
    """Return the values of a packed series, NaN where one is missing."""
    numbers = np.frombuffer(base64.b64decode(series["data"]), "<u2").astype(np.float64)
    numbers[numbers == _LEVELS + 1] = np.nan
    values: Floats = series["low"] + series["step"] * numbers
    return values


def at_times(time: Floats, values: Floats, wanted: Floats) -> Floats:
    """Return the last value up to each wanted time, NaN beyond the end of the run.

    Parameters
    ----------
    time, values
        Samples, shape (n,), time rising.
    wanted
        Times [s], shape (m,).
    """
    index = np.clip(np.searchsorted(time, wanted + 1e-9, side="right") - 1, 0, len(time) - 1)
    beyond = wanted > time[-1] + 1e-6
    return np.where(beyond, np.nan, values[index])


def series_of(plan: SeriesPlan) -> dict[str, Any]:
    """Return the curves of a scenario, packed.

    Parameters
    ----------
    plan
        What to draw.

    Returns
    -------
    `time` packed, `seeds`, `band_seeds` (their number), `truth[target][seed]`,
    `estimates[target][label][seed]` and `bands[target][label]`, a list for `BAND`. Of a recording
    `time` counts from the start of a window, `windows[seed]` says where that is on the log's own
    clock, and there are no bands: windows have nothing in common.
    """
    runs, place = Runs(), plan.place or plan.scenario
    windows = {}
    for seed in plan.shown:
        window = log_window(runs.recording(place, seed))
        if window is not None:
            windows[str(seed)] = window.model_dump()
    longest = max((one["end"] - one["start"] for one in windows.values()), default=None)
    times = np.linspace(0.0, longest or find_scenario(place).horizon, POINTS)
    band = () if windows else plan.band
    truth: dict[str, dict[str, Any]] = {}
    estimates: dict[str, dict[str, dict[str, Any]]] = {}
    errors: dict[tuple[str, str], list[Floats]] = {}
    for seed in dict.fromkeys((*plan.shown, *band)):
        made_there = runs.recording(place, seed)
        recording = made_there.truth
        wanted = times + made_there.score_from if windows else times
        for target, labels in plan.estimates.items():
            scale = axis_scale(target)[0]
            if target in (recording.dtype.names or ()):
                true = scale * at_times(recording["time"], recording[target], wanted)
            else:  # a window of a log in which no instrument gave it
                true = np.full(POINTS, np.nan)
            if seed in plan.shown:
                truth.setdefault(target, {})[str(seed)] = packed(true)
            for label in labels:
                try:
                    made = runs.estimates(place, plan.own.get(label, label), seed)[target]
                except GripbenchError:
                    continue  # it failed, as another section says, or its file is not at hand
                value = scale * at_times(recording["time"], made, wanted)
                if seed in plan.shown:
                    of_label = estimates.setdefault(target, {}).setdefault(label, {})
                    of_label[str(seed)] = packed(value)
                if seed in band:
                    branch = on_branch(target, value / scale, true / scale)
                    errors.setdefault((target, label), []).append(scale * branch - true)
        runs.forget()
    bands: dict[str, dict[str, list[Any]]] = {}
    for (target, label), found in errors.items():
        levels = _levels(np.array(found))
        bands.setdefault(target, {})[label] = [packed(level) for level in levels]
    return {
        "time": packed(times),
        "seeds": list(plan.shown),
        "band_seeds": len(band),
        "windows": windows,
        "truth": truth,
        "estimates": estimates,
        "bands": bands,
    }


def _levels(errors: Floats) -> Floats:
    """Return the percentiles of errors of shape (seeds, points), NaN where all are missing."""
    levels = np.full((len(BAND), errors.shape[1]), np.nan)
    known = np.isfinite(errors).any(axis=0)
    if known.any():
        levels[:, known] = np.nanpercentile(errors[:, known], BAND, axis=0)
    return levels


def all_series(
    plans: Sequence[SeriesPlan], workers: int, advance: Callable[[], None] = lambda: None
) -> dict[str, Any]:
    """Return the curves of several scenarios by name, made in parallel processes."""
    if workers == 1:
        made: Iterable[Any] = map(series_of, plans)
    else:
        made = joblib.Parallel(n_jobs=workers, return_as="generator")(
            joblib.delayed(series_of)(plan) for plan in plans
        )
    found = {}
    for plan, content in zip(plans, made, strict=True):
        found[plan.scenario] = content
        advance()
    return found
