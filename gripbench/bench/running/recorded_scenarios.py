"""Recordings of real vehicles as scenarios of a run: every window of the test time is one run.

`recording:NAME` is a published recording or one that `gripbench import` has stored below
`recordings`; `recording:FOLDER` is one stored elsewhere, `recording:MAP.toml` a log beside its map.
A method runs from the start of the log to
the end of the window, as in a vehicle, and is scored inside the window only. What the map sets for
a method holds unless the user sets it otherwise.

Where only an interval is known of a signal, the error is the distance from the interval.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from itertools import groupby
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from gripbench.bench.catalogue.declarations import declaration_of
from gripbench.bench.running.recorded_logs import PREFIX as PREFIX
from gripbench.bench.running.recorded_logs import load_place, place_of
from gripbench.bench.running.recorded_windows import Window, windows_of
from gripbench.bench.running.rows import LogWindow
from gripbench.envs.instruments.sensors import Sensor
from gripbench.envs.recordings import Recording
from gripbench.envs.scenarios import Scenario
from gripbench.envs.signals import record_type
from gripbench.envs.worlds import record
from gripbench.errors import InputError

if TYPE_CHECKING:
    from gripbench.bench.catalogue.registry import MethodSpec
    from gripbench.logs.importing import ImportedLog

_ANGLES = ("yaw", "sideslip", "course")
_RUN = "log_run"  # in the notes of a window's recording: which of the log's runs it is of


class RecordedScenario(Scenario):
    """A recording as a scenario; it is loaded, not simulated.

    Attributes
    ----------
    place
        Name of a published recording, or folder of a stored one.
    runs
        Number of windows: its seeds are 0 to `runs - 1`.
    settings
        Parameters of methods, by method, that its map sets.
    absent
        Why it cannot be loaded here; empty: it can.
    content
        Digest of all its samples and of what its map says.
    """

    name: str = Field(pattern=r"^recording:[a-z][a-z0-9_]*$")
    world: str = "recorded"
    sample_time: float = Field(gt=0.0)
    horizon: float = Field(gt=0.0)
    integrator: str = ""
    sensor_suite: str = ""
    place: str
    runs: int = Field(ge=1)
    settings: dict[str, dict[str, float]] = {}
    absent: str = ""
    content: str = ""

    @model_validator(mode="after")
    def _check_samples(self) -> Self:
        return self  # a log's samples come when they come

    def all_sensors(self) -> dict[str, Sensor]:
        """Return no sensor model: the log has the samples."""
        return {}


def recorded_scenario(place: str) -> RecordedScenario:
    """Return a recording as a scenario.

    Parameters
    ----------
    place
        Name of a published recording, of one stored below `recordings`, the folder of one stored
        elsewhere, or a map (TOML) beside its log.

    Raises
    ------
    InputError
        If there is no such recording, or nothing of it is to be scored.
    """
    from gripbench.logs.published import AbsentDataError

    place = place_of(place.removeprefix(PREFIX))
    try:
        imported = load_place(place)
    except AbsentDataError as error:
        return RecordedScenario(
            name=PREFIX + place, description="", vehicle="", horizon=1.0, sample_time=1.0,
            place=place, runs=1, absent=str(error), content="absent",
        )  # fmt: skip
    windows = windows_of(imported)
    said = imported.provenance
    vehicle = said.channel_map.get("vehicle", "")
    times = [recording.observations["time"] for recording in imported.recordings]
    return RecordedScenario(
        name=PREFIX + said.name,
        description=said.description,
        vehicle=vehicle if isinstance(vehicle, str) else "",
        horizon=float(max(time[-1] for time in times)),
        sample_time=float(np.median(np.concatenate([np.diff(time) for time in times]))),
        place=place,
        runs=len(windows),
        settings=said.channel_map.get("settings", {}),
        content=_digest(imported),
    )


def at_hand(name: str) -> bool:
    """Tell whether a scenario is simulated, or a recording whose samples are here."""
    if not name.startswith(PREFIX):
        return True
    try:
        return not recorded_scenario(name).absent
    except InputError:
        return False


def recording_of(scenario: Scenario, seed: int) -> Recording:
    """Return one run of a scenario: simulated, or a window of a log.

    Of a log the truth is NaN outside the window. Signals without truth there are left out, and so
    are those of the reference that the methods may read.

    Raises
    ------
    InputError
        If a log has fewer windows, or is not at hand.
    """
    if not isinstance(scenario, RecordedScenario):
        return record(scenario, seed)
    if scenario.absent:
        raise InputError(scenario.absent)
    imported = load_place(scenario.place)
    windows = windows_of(imported)
    if seed >= len(windows):
        raise InputError(f"{scenario.name}: has {len(windows)} windows, so no seed {seed}")
    chosen = windows[seed]
    given = imported.provenance.channel_map.get("derived", {}).get("instruments", ())
    return _part(
        imported.recordings[chosen.recording], (chosen,), scenario.name, seed, tuple(given)
    )


def scored_runs(scenario: RecordedScenario) -> tuple[Recording, ...]:
    """Return the runs of a log, each to the end of its last window and with truth in all of them.

    Raises
    ------
    InputError
        If it is not at hand.
    """
    if scenario.absent:
        raise InputError(scenario.absent)
    imported = load_place(scenario.place)
    windows = windows_of(imported)
    given = imported.provenance.channel_map.get("derived", {}).get("instruments", ())
    return tuple(
        _part(imported.recordings[index], tuple(parts), scenario.name, run, tuple(given))
        for run, (index, parts) in enumerate(groupby(windows, lambda window: window.recording))
    )


def log_window(recording: Recording) -> LogWindow | None:
    """Return what part of its log a recording is scored on; None of a simulated one."""
    if _RUN not in recording.notes:
        return None
    ((start, end),) = recording.windows["test"]
    origin = recording.notes.get("time_origin", 0.0)
    run = int(recording.notes[_RUN])
    return LogWindow(run=run, start=round(origin + start, 6), end=round(origin + end, 6))


def log_run_of(scenario: RecordedScenario, seed: int) -> int:
    """Return which of a log's runs a window belongs to: one pass serves all windows of it."""
    return windows_of(load_place(scenario.place))[seed].recording


def on_recording(spec: MethodSpec, scenario: Scenario) -> MethodSpec:
    """Return a method with the settings that a recording's map has for it, under the same label.

    Raises
    ------
    InputError
        If the map sets what the method does not have.
    """
    given = scenario.settings if isinstance(scenario, RecordedScenario) else {}
    if spec.declaration.name not in given:
        return spec
    if spec.declaration.fits:
        raise InputError(
            f"{scenario.name}: key 'settings.{spec.declaration.name}': a method that is fitted has "
            "the settings that it was fitted with; remove it"
        )
    settings = given[spec.declaration.name] | spec.parameters
    from gripbench.bench.catalogue.registry import method_digest

    try:
        if spec.isolated and spec.source.kind != "value":
            from gripbench.bench.running.isolation.sandbox import declare

            declaration = declare(spec.source, spec.variant, settings)
        else:
            made = spec.source.make(spec.variant, settings)
            declaration = declaration_of(made, spec.variant, settings)
    except InputError as error:
        name = spec.declaration.name
        raise InputError(f"{scenario.name}: key 'settings.{name}': {error}") from None
    changed = method_digest(spec.source, declaration)
    return replace(
        spec, declaration=declaration, parameters=settings, digest=changed, shown=spec.label
    )


def judged(recording: Recording, estimates: npt.NDArray[Any]) -> Recording:
    """Return a recording whose truth is, of all that agrees with what is known, next to estimates.

    Angles are brought to within half a turn of the estimate, and a signal of which an interval
    is known becomes the point of the interval that is next to it.

    Parameters
    ----------
    recording
        A window of a log.
    estimates
        Structured array, shape (n,).
    """
    names = set(estimates.dtype.names or ()) & set(recording.truth.dtype.names or ())
    intervals = [bound for bound in recording.bounds if bound.signal in names]
    if estimates.shape != recording.truth.shape or not (names & {*_ANGLES} or intervals):
        return recording
    truth = recording.truth.copy()
    for name in names & {*_ANGLES}:
        error = estimates[name] - truth[name]
        truth[name] = estimates[name] - np.arctan2(np.sin(error), np.cos(error))
    time = truth["time"]
    for bound in intervals:
        inside = (time >= max(bound.start, recording.score_from)) & (time <= bound.end)
        nearest = np.clip(estimates[bound.signal], bound.low, bound.high)
        truth[bound.signal][inside] = nearest[inside]
    return replace(recording, truth=truth)


def _part(
    recording: Recording, windows: tuple[Window, ...], name: str, seed: int, given: tuple[str, ...]
) -> Recording:
    """Return a run of a log to the end of its last window, with the truth of its windows only."""
    from gripbench.logs.vehicle.excitation import utilisation_bound

    time = recording.truth["time"]
    inside = np.zeros(len(time), dtype=bool)
    for window in windows:
        before = time <= window.end if window.last else time < window.end
        inside |= (time >= window.start) & before
    kept = slice(0, int(np.flatnonzero(inside)[-1]) + 1)
    inside = inside[kept]
    start, end = windows[0].start, windows[-1].end
    truth = recording.truth[kept]
    bounds = tuple(
        bound
        for bound in recording.bounds
        if bound.start < end and bound.end > start
        and bound.signal not in (truth.dtype.names or ())
    )  # fmt: skip
    columns = {
        signal: np.where(inside, truth[signal], np.nan)
        for signal in truth.dtype.names or ()
        if signal not in ("time", *given) and not signal.endswith("_new")
    }
    used = utilisation_bound(recording)
    if used is not None:
        columns["utilisation"] = np.where(inside, used[kept], np.nan)
    columns = {signal: values for signal, values in columns.items() if np.isfinite(values).any()}
    if bounds:
        # The delay after excitation asks for the acceleration; an interval cannot answer it.
        columns.pop("accel_y", None)
        columns |= {bound.signal: np.full(len(truth), np.nan) for bound in bounds}
    shown = np.empty(len(truth), record_type(["time", *columns]))
    shown["time"] = truth["time"]
    for signal, values in columns.items():
        shown[signal] = values
    return replace(
        recording,
        scenario=name,
        seed=seed,
        observations=recording.observations[kept],
        truth=shown,
        score_from=start,
        windows={"test": tuple((window.start, window.end) for window in windows)},
        notes=recording.notes | {_RUN: float(recording.seed)},
        bounds=bounds,
    )


def _digest(imported: ImportedLog) -> str:
    state = hashlib.sha256()
    for recording in imported.recordings:
        for records in (recording.observations, recording.truth):
            state.update(repr(records.dtype.names).encode())
            state.update(records.tobytes())
        said = (recording.vehicle, recording.windows, recording.score_from, recording.notes)
        state.update(json.dumps(said, sort_keys=True).encode())
        state.update(repr([asdict(bound) for bound in recording.bounds]).encode())
    settings = imported.provenance.channel_map.get("settings", {})
    state.update(json.dumps(settings, sort_keys=True).encode())
    return state.hexdigest()
