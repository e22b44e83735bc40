"""Dakhlallah, Glaser, Mammar & Sebsadji (2008) run again: Figures 3 to 13 and the errata.

The paper shows one drive of moderate lateral acceleration, without numbers. It is run here with
the paper's vehicle on Magic Formula tyres, which the filter does not know, and so are a hard drive
and one at the limit, which tell more: in the mild one the model alone does as well.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gripbench.bench.papers.claims import Paper, load_paper
from gripbench.bench.papers.reproduction import Progress, Reproduction, of_claims
from gripbench.bench.papers.sideslip import pooled_rms
from gripbench.bench.scoring.observability import dugoff_observability
from gripbench.envs.recordings import Recording
from gripbench.envs.vehicles import GRAVITY, Value, Vehicle, load_vehicle
from gripbench.envs.worlds import load_scenario, record
from gripbench.methods.dugoff_ekf import DugoffEkf

NAME = "dakhlallah2008"
DRIVES = ("mild", "hard", "limit")
AVAILABLE = 0.8
"""Friction coefficient of the road."""

ASSUMED = 0.5
"""Friction coefficient that the sweep assumes on that road."""

VARIANTS = (
    "paper_step",
    "paper_slip",
    "paper_load_transfer",
    "paper_jacobian",
    "paper_update",
    "paper",
)
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")


def load() -> Paper:
    """Return the paper's file."""
    return load_paper(NAME)


def reproduce(progress: Progress | None = None, seeds: Sequence[int] | None = None) -> Reproduction:
    """Return every claim of the paper with our figure.

    Parameters
    ----------
    progress
        Called with the parts done and their number.
    seeds
        Seeds of the runs; by default the test seeds of the paper's file.
    """
    paper = load()
    chosen = list(paper.seeds.test) if seeds is None else list(seeds)
    figures: dict[str, float] = {}
    for done, drive in enumerate(DRIVES):
        if progress:
            progress(done, len(DRIVES))
        figures |= drive_figures(drive, chosen)
    if progress:
        progress(len(DRIVES), len(DRIVES))
    figures["mild.used_share"] = figures["mild.largest_used_friction"] / AVAILABLE
    return of_claims(paper, figures)


def drive_figures(drive: str, seeds: Sequence[int]) -> dict[str, float]:
    """Return the figures of one drive, with its name in front."""
    scenario = load_scenario(f"dakhlallah_{drive}")
    runs = [record(scenario, seed) for seed in seeds]
    same_tyre = scenario.model_copy(update={"tyre": "dugoff"})
    same_vehicle = _with_constant_stiffness(load_vehicle(scenario.vehicle))
    matched = [record(same_tyre, seed, same_vehicle) for seed in seeds]
    figures = errors(DugoffEkf(), runs)
    figures["open_loop"] = errors(DugoffEkf("open_loop"), runs)["sideslip"]
    figures["assumed_friction"] = errors(DugoffEkf(friction=ASSUMED), runs)["sideslip"]
    figures["matched_tyre"] = errors(DugoffEkf(), matched)["sideslip"]
    for variant in VARIANTS:
        figures[f"errata.{variant}"] = errors(DugoffEkf(variant), runs)["sideslip"]
    figures["largest_used_friction"] = largest_used_friction(runs)
    figures |= observability(runs[0])
    return {f"{drive}.{name}": value for name, value in figures.items()}


def errors(method: DugoffEkf, runs: Sequence[Recording]) -> dict[str, float]:
    """Return RMS errors pooled over runs (and wheels) from the scenario's `score_from` on.

    Sideslip in degrees, v_x and v_y in m/s, yaw rate in deg/s, tyre forces over the static load
    of a wheel, used lateral friction F_y / F_z (eq. 16).
    """
    parts: dict[str, list[npt.NDArray[np.float64]]] = {}

    def add(name: str, error: npt.NDArray[np.float64]) -> None:
        parts.setdefault(name, []).append(error)

    for run in runs:
        scored = run.truth["time"] >= run.score_from
        estimates = method.run(run.vehicle, run.observations)[scored]
        truth = run.truth[scored]
        load = run.vehicle["mass"] * GRAVITY / 4.0
        add("sideslip", np.degrees(estimates["sideslip"] - truth["sideslip"]))
        add("speed_x", estimates["speed_x"] - truth["speed_x"])
        add("speed_y", estimates["speed_y"] - truth["speed_y"])
        add("yaw_rate", np.degrees(estimates["yaw_rate"] - truth["yaw_rate"]))
        for wheel in WHEELS:
            for axis in ("x", "y"):
                name = f"force_{axis}_{wheel}"
                add(f"force_{axis}", (estimates[name] - truth[name]) / load)
            add("friction_y", _used(estimates, wheel) - _used(truth, wheel))
    return {name: pooled_rms(values) for name, values in parts.items()}


def largest_used_friction(runs: Sequence[Recording]) -> float:
    """Return the largest used lateral friction that the filter reports."""
    return max(
        float(np.abs(_used(DugoffEkf().run(run.vehicle, run.observations), wheel)).max())
        for run in runs
        for wheel in WHEELS
    )


def observability(run: Recording) -> dict[str, float]:
    """Return rank and condition number (eq. 13-15) along a run, with and without v_x measured."""
    estimates = DugoffEkf().run(run.vehicle, run.observations)
    both = dugoff_observability(run.vehicle, run.observations, estimates)
    alone = dugoff_observability(run.vehicle, run.observations, estimates, outputs=("yaw_rate",))
    return {
        "rank": float(both.rank.min()),
        "condition": float(np.median(both.condition)),
        "condition_worst": float(both.condition.max()),
        "condition_yaw_rate_only": float(np.median(alone.condition)),
    }


def _with_constant_stiffness(vehicle: Vehicle) -> Vehicle:
    """Return a vehicle whose tyre stiffness does not change with load, as the filter has it."""
    constant = {"stiffness_load_exponent": Value(value=0.0, source="model of the filter")}
    return vehicle.model_copy(update={"parameters": {**vehicle.parameters, **constant}})


def _used(samples: npt.NDArray[np.void], wheel: str) -> npt.NDArray[np.float64]:
    load = samples[f"force_z_{wheel}"]
    return np.asarray(samples[f"force_y_{wheel}"] / np.maximum(load, 50.0) * (load > 50.0))
