"""A log of a real vehicle in; its quality, identification, tuned methods and scored rows out.

Vehicle and methods are fitted on the training windows only; the rows are of the test windows. Where
the map names no window, the first half of each run is for training and the second for the test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from gripbench.bench.catalogue.registry import built_in_methods, choose_method
from gripbench.bench.running.backends import Backend
from gripbench.bench.running.forms import runnable
from gripbench.bench.running.recorded_logs import PREFIX
from gripbench.bench.running.recorded_scenarios import recorded_scenario
from gripbench.bench.running.rows import Row
from gripbench.bench.running.runner import Plan, run_plan
from gripbench.bench.running.store import Store
from gripbench.bench.running.tuning import BUDGET, Tuned, searched, tune, write_variant
from gripbench.envs.recordings import Recording
from gripbench.envs.vehicles import CarOnPaper
from gripbench.errors import InputError
from gripbench.logs.importing import ImportedLog, import_log
from gripbench.logs.storing import store
from gripbench.logs.vehicle.identification import LOOSE, Identified, identify_tyres, with_velocity
from gripbench.methods.blocks.solved import SolvedMethod

_ON_PAPER = {
    "stiffness_front": "cornering_stiffness_front",
    "stiffness_rear": "cornering_stiffness_rear",
    "gyration_squared": "yaw_inertia",
}


@dataclass(frozen=True)
class Study:
    """What a study found.

    Attributes
    ----------
    imported
        The log, with its quality report, its windows and the vehicle as methods got it.
    found
        Identified parameters; None where nothing could be identified.
    tuned
        Tuned methods.
    rows
        Scores of methods, tuned methods and baselines on the test windows.
    left_out
        Why other methods did not run, by choice.
    undetermined
        Sentences on what the log could not tell.
    folder
        Where recording, variants and rows lie.
    target
        The signal that was tuned and ranked for.
    """

    imported: ImportedLog
    found: Identified | None
    tuned: tuple[Tuned, ...]
    rows: tuple[Row, ...]
    left_out: dict[str, str]
    undetermined: tuple[str, ...]
    folder: Path
    target: str


def study(
    log: Path,
    channel_map: Path,
    folder: Path,
    target: str = "sideslip",
    budget: int = BUDGET,
    workers: int = 0,
    say: Callable[[str], None] = lambda text: None,
) -> Study:
    """Study a log.

    Parameters
    ----------
    log, channel_map
        The log, or the folder of the map's files, and the map.
    folder
        Where the recording, the tuned variants and the rows go.
    target
        The signal to tune and rank for.
    budget
        Trials of each method.
    workers
        Processes of the run; 0: one a core.
    say
        Called with a sentence as each part begins.

    Raises
    ------
    InputError
        On the first mistake in map or log, and if the reference does not have the target.
    """
    words: list[str] = []
    say("importing")
    imported = import_log(log, channel_map)
    first = imported.recordings[0]
    known = {*(first.truth.dtype.names or ()), *(bound.signal for bound in first.bounds)} - {"time"}
    if target not in known:
        shown = sorted(name for name in known if not name.endswith("_new"))
        raise InputError(
            f"{channel_map}: the reference has no '{target}' to study; "
            f"it has {', '.join(shown) or 'nothing'}"
        )
    if not any(any(one.windows.values()) for one in imported.recordings):
        imported = replace(imported, recordings=tuple(_halved(r) for r in imported.recordings))
        words.append(
            "The map names no windows: the first half of the log was taken for training, the "
            "second for the test."
        )
    say("identifying the vehicle on the training windows")
    found, imported = _identified(imported, words)
    words += _guesses(imported)
    kept = store(imported, folder / "recording")
    runs = imported.recordings
    choices, left_out = runnable(runs[0], (target,))
    for choice in [one for one in choices if not _quick(one)]:
        del choices[choice]
        left_out[choice] = "an optimiser solves its steps, too slow to tune: gripbench run runs it"
    to_tune = [
        choice
        for choice, spec in choices.items()
        if not spec.declaration.baseline and searched(choice)
    ]
    tuned: list[Tuned] = []
    for choice, found_or_why in _each_tuned(to_tune, runs, target, budget, workers):
        say(f"tuned {choice}")
        if isinstance(found_or_why, Tuned):
            tuned.append(found_or_why)
        else:
            words.append(f"{choice} was not tuned: {found_or_why}.")
    specs = list(choices.values())
    for one in tuned:
        path = folder / "variants" / f"{one.method.replace(':', '-')}.toml"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_variant(one, path)
        specs.append(choose_method(str(path)))
        if one.undetermined:
            words.append(
                f"{one.method}: {', '.join(one.undetermined)} ended at an end of the range, so the "
                "training windows do not settle it."
            )
    say("scoring on the test windows")
    scenario = recorded_scenario(str(kept))
    rows: list[Row] = []
    plan = Plan((scenario,), tuple(specs), range(scenario.runs))
    run_plan(plan, Store(folder / "results"), Backend("loky", workers), on_row=rows.append)
    return Study(imported, found, tuple(tuned), tuple(rows), left_out, tuple(words), folder, target)


def _quick(choice: str) -> bool:
    """Return whether a method's steps are compiled: sixty passes over a log then take seconds."""
    return not issubclass(built_in_methods()[choice.partition(":")[0]], SolvedMethod)


def _each_tuned(
    choices: Sequence[str], runs: Sequence[Recording], target: str, budget: int, workers: int
) -> Iterator[tuple[str, Tuned | str]]:
    """Yield each method with its tuning, or why there is none; several at once."""
    import joblib

    call = joblib.delayed(_tuned_or_why)
    made = joblib.Parallel(n_jobs=workers or -1, return_as="generator")(
        call(choice, runs, target, budget) for choice in choices
    )
    yield from zip(choices, made, strict=True)


def _tuned_or_why(choice: str, runs: Sequence[Recording], target: str, budget: int) -> Tuned | str:
    try:
        return tune(choice, runs, target, draws=budget)
    except InputError as error:
        return str(error)


def _halved(recording: Recording) -> Recording:
    end = float(recording.truth["time"][-1])
    start = recording.score_from
    middle = 0.5 * (start + end)
    return replace(recording, windows={"train": ((start, middle),), "test": ((middle, end),)})


def _identified(imported: ImportedLog, words: list[str]) -> tuple[Identified | None, ImportedLog]:
    """Return what was identified, and the log with it in its vehicle."""
    runs = imported.recordings
    if not with_velocity(runs):
        words.append("Without a velocity or sideslip reference no tyres were identified.")
        return None, imported
    try:
        found = identify_tyres(runs)
    except InputError as error:
        words.append(f"Nothing was identified: {error}.")
        return None, imported
    loose = found.undetermined()
    if loose is not None:
        words.append(f"{loose[:1].upper()}{loose[1:]}.")
    mass = runs[0].vehicle.get("mass")
    if mass is None:
        words.append("The vehicle gives no mass, so the tyres found are not in force.")
        return found, imported
    vehicle = dict(runs[0].vehicle)
    for name, parameter in _ON_PAPER.items():
        value = found.values.get(name)
        if value is not None and found.deviations[name] <= LOOSE * abs(value):
            vehicle[parameter] = mass * value
        elif value is not None:
            words.append(f"{parameter} stays as on paper, for the log does not settle it.")
    car = CarOnPaper(vehicle)
    runs = tuple(replace(_steered(run, found, words), vehicle=car) for run in runs)
    return found, replace(imported, recordings=runs)


def _steered(recording: Recording, found: Identified, words: list[str]) -> Recording:
    """Return a run with the steering angle that its tyres were identified with."""
    scale, offset = (found.values.get(name) for name in ("steer_scale", "steer_offset"))
    if scale is None or offset is None:
        return recording
    spread = found.deviations
    near = abs(scale - 1.0) <= 2.0 * spread["steer_scale"]
    if near and abs(offset) <= 2.0 * spread["steer_offset"]:
        return recording
    seen = recording.observations.copy()
    seen["steer_angle"] = scale * seen["steer_angle"] + offset
    said = (
        f"Methods got {scale:.4g} times the mapped steering angle {offset:+.2g} rad, as identified "
        "with the tyres: mend scale and offset in the map."
    )
    if said not in words:
        words.append(said)
    return replace(recording, observations=seen)


def _guesses(imported: ImportedLog) -> list[str]:
    """Return in words what of the vehicle is a guess that the log did not replace."""
    given = imported.provenance.channel_map.get("vehicle", "")
    car = imported.recordings[0].vehicle
    names = [
        name
        for name, about in (given.items() if isinstance(given, dict) else ())
        if about.get("guess") and car.get(name) == about["value"]
    ]
    if not names:
        return []
    return [f"Of the vehicle these are guesses, no data of this car: {', '.join(names)}."]


def address(study: Study) -> str:
    """Return the choice of its recording for other commands."""
    return f"{PREFIX}{study.folder / 'recording'}"
