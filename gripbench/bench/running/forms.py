"""A recording in, the form of each built-in method that can run on it out, and what others lack."""

from __future__ import annotations

from collections.abc import Collection

from gripbench.bench.catalogue.registry import MethodSpec, built_in_methods, choose_method
from gripbench.bench.running.execution import lacking, missing
from gripbench.envs.recordings import Recording
from gripbench.envs.signals import NEW


def runnable(
    recording: Recording, targets: Collection[str]
) -> tuple[dict[str, MethodSpec], dict[str, str]]:
    """Return the methods that a recording can run, and what the others lack, by choice.

    Of each method it is the first form, the method itself or a variant with other sensors, whose
    channels and vehicle parameters are there.

    Parameters
    ----------
    recording
        A run.
    targets
        Signals of which a method has to estimate one.
    """
    channels = recording.observations.dtype.names or ()
    found: dict[str, MethodSpec] = {}
    left_out: dict[str, str] = {}
    for name, forms in _forms(targets).items():
        reasons = []
        for choice, spec in forms.items():
            reason = missing(spec.declaration, recording.vehicle, channels)
            if not reason:
                found[choice] = spec
                break
            reasons.append(f"{choice}: {reason}" if choice != name else reason)
        else:
            left_out[name] = "; or ".join(reasons)
    return found, left_out


def what_would_run(recording: Recording, targets: Collection[str]) -> list[str]:
    """Return in sentences which methods a recording can run, and which keys of a map more need.

    Parameters
    ----------
    recording, targets
        As `runnable` takes them.
    """
    found, left_out = runnable(recording, targets)
    lines = [f"can run: {', '.join(found) or 'no method'}"]
    channels = recording.observations.dtype.names or ()
    wanted: dict[tuple[str, ...], list[str]] = {}
    for name, forms in _forms(targets).items():
        if name not in left_out:
            continue
        needs = {
            choice: lacking(spec.declaration, recording.vehicle, channels)
            for choice, spec in forms.items()
        }
        # what no channel has to be added for comes first
        choice = min(needs, key=lambda each: (len(needs[each][0]), len(needs[each][1])))
        sensors, parameters = needs[choice]
        columns = (key for key in sensors if key != "gps_time" and not key.endswith(NEW))
        keys = (*(f"channels.{key}" for key in columns), *(f"vehicle.{key}" for key in parameters))
        wanted.setdefault(keys, []).append(choice)
    for keys, names in sorted(wanted.items(), key=lambda item: len(item[0])):
        lines.append(f"needs {', '.join(keys)}: {', '.join(names)}")
    return lines


def _forms(targets: Collection[str]) -> dict[str, dict[str, MethodSpec]]:
    """Return each method that estimates one of the targets, with its variants of other sensors."""
    return {
        name: {
            choice: choose_method(choice)
            for choice in (
                name,
                *(
                    f"{name}:{key}"
                    for key, one in method.variants.items()
                    if one.sensors is not None
                ),
            )
        }
        for name, method in built_in_methods().items()
        if set(targets) & set(method.estimates)
    }
