"""Tune a method's noise levels on the training windows of a recording, each method alike.

The same number of draws for every method, log-uniform around its present settings; the test
windows are not looked at. Nothing but noise levels is drawn: a setting that changes what a method
is (a switch, a geometry) is its author's.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gripbench.bench.catalogue.registry import built_in_methods, choose_method
from gripbench.bench.running.recorded import score_recordings
from gripbench.envs.recordings import Recording
from gripbench.errors import InputError, unknown
from gripbench.logs.published import load_recording

NOISE_LEVELS = ("_noise", "_walk", "_std", "_density")
"""Endings of the parameters that are noise levels."""

SPREAD = 30.0
"""Largest factor by which a draw differs from the present setting."""


@dataclass(frozen=True)
class Tuned:
    """The best settings found.

    Attributes
    ----------
    method
        Choice that was tuned.
    settings
        Parameters that differ from the method's own, the fixed ones included.
    before, after
        Figure on the training windows with the settings before and after.
    draws
        How many settings were tried.
    """

    method: str
    settings: dict[str, float]
    before: float
    after: float
    draws: int


def tune(
    method: str,
    recordings: Sequence[Recording],
    target: str,
    fixed: dict[str, float] | None = None,
    draws: int = 60,
    seed: int = 0,
) -> Tuned:
    """Tune a built-in method for one target.

    Parameters
    ----------
    method
        `name[:variant]`.
    recordings
        Runs of a recording with a window `train`.
    target
        The signal whose error counts.
    fixed
        Settings that are known and not drawn.
    draws
        Settings to try beside the present ones.
    seed
        Of the draws; they depend on it and the method's name only.

    Raises
    ------
    InputError
        If there is no training window, or the method has no noise level or cannot run.
    """
    training = [
        replace(recording, windows={"test": recording.windows["train"]})
        for recording in recordings
        if "train" in recording.windows
    ]
    if not training:
        raise InputError(f"{recordings[0].scenario}: has no window 'train' to tune on")
    known = dict(fixed or {})
    name = method.partition(":")[0]
    methods = built_in_methods()
    if name not in methods:
        raise unknown("method", name, methods)
    levels = {
        parameter.name: parameter
        for parameter in methods[name].parameters
        if parameter.name.endswith(NOISE_LEVELS)
        and isinstance(parameter.default, float)
        and parameter.default > 0.0
        and parameter.name not in known
    }
    if not levels:
        raise InputError(f"{method}: has no noise level to tune")
    random = np.random.default_rng([seed, zlib.crc32(method.encode())])
    best, before = dict(known), _figure(method, training, target, known)
    after = before
    for _ in range(draws):
        drawn = {
            key: float(
                np.clip(level.default * SPREAD ** random.uniform(-1.0, 1.0), level.low, level.high)
            )
            for key, level in levels.items()
        }
        figure = _figure(method, training, target, known | drawn)
        if figure < after:
            best, after = known | drawn, figure
    return Tuned(method, best, before, after, draws)


def tune_published(
    name: str, method: str, target: str, draws: int = 60, folder: Path | None = None
) -> Tuned:
    """Tune a method on a published recording; settings of its map that are no noise level stay.

    Parameters
    ----------
    name
        Name of the recording.
    method, target, draws
        See `tune`.
    folder
        Where the files lie, see `gripbench.logs.locations`.
    """
    imported = load_recording(name, folder)
    settings = imported.provenance.channel_map.get("settings", {})
    known = settings.get(method.partition(":")[0], {})
    fixed = {key: value for key, value in known.items() if not key.endswith(NOISE_LEVELS)}
    return tune(method, imported.recordings, target, fixed, draws)


def settings_text(tuned: Tuned) -> str:
    """Return the settings as the lines of a channel map."""
    lines = [f"[settings.{tuned.method.partition(':')[0]}]"]
    lines += [f"{key} = {value:.3g}" for key, value in tuned.settings.items()]
    return "\n".join(lines)


def _figure(
    method: str, recordings: Sequence[Recording], target: str, settings: dict[str, Any]
) -> float:
    spec = choose_method(method, parameters=settings)
    scored: list[str] = []
    for row in score_recordings(recordings, [spec]):
        if row.kind == "method":
            if row.status == "skipped":
                raise InputError(f"{method}: {row.reason}")
            if row.target == target and row.value is not None:
                return row.value if row.outside is None else row.outside
            if row.status == "ok":
                scored.append(row.target)
    if scored:
        raise InputError(
            f"{method}: nothing is known of '{target}' on the training windows; "
            f"scored are {', '.join(scored)}"
        )
    return float("inf")
