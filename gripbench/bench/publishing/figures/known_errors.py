"""Methods and a run in; where their sensors can tell a signal, and their errors there, out."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from gripbench.bench.bounds.bound import Bound, bounds, channels_of
from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.publishing.figures.runs import Runs
from gripbench.envs.signals import difference, signal
from gripbench.envs.worlds import sensors_of


def knowable_errors(
    runs: Runs, scenario: str, methods: Sequence[str], name: str, seed: int
) -> tuple[Bound, list[str]]:
    """Return the bound of what the methods read together, and a line for each of them.

    A line says the RMS error over the samples that count, and over those of them in which the
    signal can be known. Without methods the bound is that of all sensors.

    Raises
    ------
    InputError
        If the scenario has no bound, or its truth no such signal.
    """
    chosen = find_scenario(scenario)
    present = sensors_of(chosen, seed)
    read = [
        channel
        for method in methods
        for channel in runs.method(method).declaration.sensors
        if channel in present
    ]
    (bound,) = bounds(chosen, seed, [channels_of(chosen, read)], [name], step=0.02)
    truth = runs.recording(scenario, seed).truth
    scored = truth["time"] >= chosen.score_from
    at = np.clip(np.searchsorted(bound.time, truth["time"], side="right") - 1, 0, None)
    known = scored & bound.knowable[at]
    factor = signal(name).display_factor
    unit = signal(name).display_unit.replace("-", "")
    share = 100.0 * float(known.sum()) / max(int(scored.sum()), 1)
    lines = [f"{name} can be known in {share:.0f} % of the drive, best {factor * bound.rms:.3g}"
             f" {unit}".rstrip() + " RMS"]  # fmt: skip
    for method in methods:
        error = difference(name, runs.estimates(scenario, method, seed)[name], truth[name])
        rms = [
            f"{factor * math.sqrt(float(np.mean(error[part] ** 2))):.3g}" if part.any() else "n/a"
            for part in (scored, known)
        ]
        label = runs.method(method).label
        lines.append(f"{label}: RMS {rms[0]} {unit}".rstrip() + f", where it can be known {rms[1]}")
    return bound, lines
