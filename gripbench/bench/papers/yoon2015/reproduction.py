"""Claims of Yoon, Li & Ahn (2015) beside what the magnetometer-GPS cascade reaches here.

Sideslip RMS values are pooled over samples and runs. The friction's steady-state error is the mean
of mu_hat / mu - 1 over the excited samples of the last 2 s of excitation; its delay is the time
from the first excited sample to the one from which mu_hat stays within 20 % for 1 s.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.papers.claims import Paper, load_paper
from gripbench.bench.papers.reproduction import Progress, Reproduction, of_claims
from gripbench.bench.papers.yoon2015.brush_identification import (
    PARAMETERS,
    identify,
    lateral_test,
    separability,
)
from gripbench.compilation import replacing
from gripbench.envs.plants.planar.world import PlanarScenario
from gripbench.envs.recordings import Recording
from gripbench.envs.roads.road import MagneticField
from gripbench.envs.vehicles import GRAVITY
from gripbench.envs.worlds import load_scenario, record
from gripbench.methods.heading_ekf import field_in_vehicle
from gripbench.methods.magnetometer_gps_cascade import MagnetometerGpsCascade
from gripbench.methods.printed.yoon2015 import EQ_6

NAME = "yoon2015"

Array = npt.NDArray[np.float64]

TRACK = ("double_lane_change_snow", "double_lane_change_ice", "slalom_snow", "slalom_ice")
PUBLIC = "public_road"
JUMP = "mu_jump_lane_change"

EXCITED = 0.4
"""Share of mu g that the lateral acceleration of an excited sample exceeds."""

_BAND, _HOLD, _LAST = 0.2, 1.0, 2.0
_PASSING = MagneticField(pulse_rate=0.15)  # as on the public road

_METHODS: dict[str, MagnetometerGpsCascade] = {
    variant: MagnetometerGpsCascade(variant)
    for variant in ("corrected", *MagnetometerGpsCascade.variants)
}
_PRINTED_FIELD = replacing(field_in_vehicle, EQ_6, "paper_6")
_ON_PUBLIC_ROADS = (
    "corrected",
    "pitch_aware",
    "table_1_noise",
    "no_roll_model",
    "no_rejection",
    "no_delay_handling",
    "no_bias_states",
)


def friction_error_and_delay(truth: npt.NDArray[Any], mu: Array) -> tuple[float, float]:
    """Return the normalised steady-state error of the friction and its delay [s].

    Parameters
    ----------
    truth
        Truth of a run with `time`, `mu` and `accel_y`, shape (n,).
    mu
        Estimate, shape (n,).

    Returns
    -------
    Error, and delay; the delay is inf if the estimate never settles. Both are NaN without
    excitation.
    """
    times = truth["time"]
    excited = np.flatnonzero(np.abs(truth["accel_y"]) > EXCITED * truth["mu"] * GRAVITY)
    if len(excited) == 0:
        return np.nan, np.nan
    ratio = mu / truth["mu"] - 1.0
    last = excited[times[excited] > times[excited[-1]] - _LAST]
    return float(np.mean(ratio[last])), _settling(times, ratio, excited[0])


def _settling(times: Array, ratio: Array, start: int) -> float:
    """Return the time [s] from sample `start` until |ratio| stays below 0.2 for 1 s."""
    outside = np.flatnonzero(~(np.abs(ratio[start:]) <= _BAND)) + start
    edges = np.concatenate([[start - 1], outside, [len(times)]])
    for before, after in pairwise(edges):
        if after - before > 1 and times[after - 1] - times[before + 1] >= _HOLD:
            return float(times[before + 1] - times[start])
    return np.inf


@dataclass
class _Collected:
    """Sums over the runs, by name of the method or figure."""

    squares: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    samples: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    friction: dict[str, list[tuple[float, float]]] = field(
        default_factory=lambda: defaultdict(list)
    )
    diverged: int = 0
    runs: int = 0

    def add(self, name: str, errors: Array) -> None:
        """Add the errors of a run."""
        self.squares[name] += float(errors @ errors)
        self.samples[name] += len(errors)

    def rms(self, name: str) -> float:
        """Return the RMS pooled over samples and runs."""
        return float(np.sqrt(self.squares[name] / self.samples[name]))

    def rms_degrees(self, name: str) -> float:
        """Return the same in degrees."""
        return float(np.degrees(self.rms(name)))


def load() -> Paper:
    """Return the paper's file."""
    return load_paper(NAME)


def reproduce(progress: Progress | None = None, seeds: Sequence[int] | None = None) -> Reproduction:
    """Run the paper's comparison and set our figures beside its claims.

    Parameters
    ----------
    progress
        Called with the number of finished runs and of all runs.
    seeds
        Seeds to run; None: the test seeds of the paper's file.
    """
    paper = load()
    found = figures(paper.seeds.test if seeds is None else seeds, progress)
    found["public_over_track"] = found["public_sideslip"] / found["track_sideslip"]
    found["pitch_share"] = found["public_sideslip_pitch_aware"] / found["public_sideslip"]
    return of_claims(paper, found)


def figures(seeds: Sequence[int], progress: Progress | None = None) -> dict[str, float]:
    """Return our figures by item of the paper's file; arguments as of `reproduce`."""
    total = (2 * len(TRACK) + 2) * len(seeds)
    done = 0

    def advance() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, total)

    passing = [_scenario(name).model_copy(update={"magnetic": _PASSING}) for name in TRACK]
    return (
        _track(_recordings([_scenario(name) for name in TRACK], seeds, advance))
        | _passing_vehicles(_recordings(passing, seeds, advance))
        | _public(_recordings([_scenario(PUBLIC)], seeds, advance))
        | _jump(_recordings([_scenario(JUMP)], seeds, advance))
        | _identification()
    )


def _scenario(name: str) -> PlanarScenario:
    scenario = load_scenario(name)
    assert isinstance(scenario, PlanarScenario)
    return scenario


def _recordings(
    scenarios: list[PlanarScenario], seeds: Sequence[int], advance: Callable[[], None]
) -> Iterator[Recording]:
    for scenario in scenarios:
        for seed in seeds:
            yield record(scenario, seed)
            advance()


def _estimates(recording: Recording, name: str) -> npt.NDArray[Any]:
    return _METHODS[name].run(recording.vehicle, recording.observations)


def _sideslip_errors(recording: Recording, estimates: npt.NDArray[Any]) -> Array:
    errors: Array = estimates["sideslip"] - recording.truth["sideslip"]
    return errors[recording.truth["time"] >= recording.score_from]


def _track(recordings: Iterator[Recording]) -> dict[str, float]:
    names = [name for name in _METHODS if name not in ("no_rejection", "paper_4")]
    seen = _Collected()
    for recording in recordings:
        seen.runs += 1
        for name in names:
            estimates = _estimates(recording, name)
            if name == "single_delay":
                speed = np.abs(estimates["speed_y"]).max()
                seen.diverged += not speed < 100.0
                continue
            seen.add(name, _sideslip_errors(recording, estimates))
            seen.friction[name].append(friction_error_and_delay(recording.truth, estimates["mu"]))
        _printed_on_track(seen, recording)
    errors, delays = np.abs(np.array(seen.friction["corrected"])).T
    found = {
        "track_runs": float(seen.runs),
        "track_sideslip": seen.rms_degrees("corrected"),
        "track_sideslip_pitch_aware": seen.rms_degrees("pitch_aware"),
        "track_sideslip_as_printed": seen.rms_degrees("paper"),
        "track_sideslip_table_1": seen.rms_degrees("table_1_noise"),
        "track_sideslip_zero": seen.rms_degrees("zero"),
        "friction_error_mean": float(errors.mean()),
        "friction_error_largest": float(errors.max()),
        "friction_delay_mean": float(delays.mean()),
        "friction_delay_largest": float(delays.max()),
        "friction_error_as_printed": float(np.abs(np.array(seen.friction["paper"])[:, 0]).mean()),
        "track_no_roll_model": seen.rms_degrees("no_roll_model"),
        "track_no_delay_handling": seen.rms_degrees("no_delay_handling"),
        "track_no_bias_states": seen.rms_degrees("no_bias_states"),
        "single_delay_diverged": seen.diverged / seen.runs,
        "printed_6_field": seen.rms("printed_6_field") * 1e7,
        "printed_8_accel": seen.rms("printed_8_accel"),
        "printed_12_angle": seen.rms_degrees("printed_12_angle"),
        "printed_16_accel": seen.rms("printed_16_accel"),
    }
    for number in (6, 7):
        found[f"printed_{number}_sideslip"] = seen.rms_degrees(f"paper_{number}")
    for number in (15, 16):
        errors = np.array(seen.friction[f"paper_{number}"])[:, 0]
        found[f"printed_{number}_friction"] = float(np.abs(errors).mean())
    return found


def _printed_on_track(seen: _Collected, recording: Recording) -> None:
    """Add how far printed equations are from the truth, without any noise or filter."""
    truth = recording.truth[recording.truth["time"] >= recording.score_from]
    seen.add("zero", truth["sideslip"])
    speed_x, speed_y = truth["speed_x"], truth["speed_y"]
    yaw_speed = np.gradient(np.unwrap(truth["yaw"]), truth["time"])
    rate = np.gradient(speed_x, truth["time"])
    seen.add("printed_8_accel", truth["accel_x"] - rate - yaw_speed * speed_y)
    moving = np.abs(speed_y) > 1e-3  # eq. 12 divides by it
    printed = np.arctan(speed_x[moving] / speed_y[moving])
    seen.add("printed_12_angle", printed - truth["sideslip"][moving])
    forces = truth["force_y_front"] * np.cos(truth["steer_angle"]) + truth["force_y_rear"]
    bias = np.mean(recording.observations["accel_y"] - recording.truth["accel_y"])
    difference = truth["accel_y"] + bias - forces / recording.vehicle["mass"]
    seen.add("printed_16_accel", difference)
    settings = _METHODS["corrected"].settings
    horizontal, up = settings["field_horizontal"], settings["field_up"]
    every = truth[:: max(len(truth) // 200, 1)]
    z = [
        _PRINTED_FIELD(yaw, roll, 0.0, horizontal, up)[2]
        for yaw, roll in zip(every["yaw"], every["roll"], strict=True)
    ]
    seen.add("printed_6_field", np.array(z) - every["magnetic_field_z"])


def _passing_vehicles(recordings: Iterator[Recording]) -> dict[str, float]:
    seen = _Collected()
    for recording in recordings:
        for name in ("corrected", "no_rejection", "paper_4"):
            seen.add(name, _sideslip_errors(recording, _estimates(recording, name)))
    return {
        "passing_with_rejection": seen.rms_degrees("corrected"),
        "passing_no_rejection": seen.rms_degrees("no_rejection"),
        "passing_printed_4": seen.rms_degrees("paper_4"),
    }


def _public(recordings: Iterator[Recording]) -> dict[str, float]:
    seen = _Collected()
    for recording in recordings:
        for name in _ON_PUBLIC_ROADS:
            seen.add(name, _sideslip_errors(recording, _estimates(recording, name)))
        truth = recording.truth[recording.truth["time"] >= recording.score_from]
        seen.add("zero", truth["sideslip"])
        roll_speed = np.gradient(truth["roll"], truth["time"])
        seen.add("printed_7_rate", roll_speed - truth["roll_rate"])
    return {
        "public_sideslip": seen.rms_degrees("corrected"),
        "public_sideslip_pitch_aware": seen.rms_degrees("pitch_aware"),
        "public_sideslip_table_1": seen.rms_degrees("table_1_noise"),
        "public_sideslip_zero": seen.rms_degrees("zero"),
        "public_no_roll_model": seen.rms_degrees("no_roll_model"),
        "public_no_rejection": seen.rms_degrees("no_rejection"),
        "public_no_delay_handling": seen.rms_degrees("no_delay_handling"),
        "public_no_bias_states": seen.rms_degrees("no_bias_states"),
        "printed_7_rate": seen.rms_degrees("printed_7_rate"),
    }


def _jump(recordings: Iterator[Recording]) -> dict[str, float]:
    delays = []
    for recording in recordings:
        mu, truth = _estimates(recording, "corrected")["mu"], recording.truth
        jumped = int(np.flatnonzero(truth["mu"] <= truth["mu"].min() + 1e-9)[0])
        delays.append(_settling(truth["time"], mu / truth["mu"] - 1.0, jumped))
    return {"friction_delay_after_jump": float(np.median(delays))}


def _identification() -> dict[str, float]:
    """Identify the tyre on snow from the tuning seeds: that is calibration, not a test."""
    seeds = load().seeds.tuning
    recordings = [
        record(_scenario(name), seed)
        for name in ("double_lane_change_snow", "slalom_snow")
        for seed in seeds[:3]
    ]
    tests = [lateral_test(recording, every=10) for recording in recordings]
    vehicle = recordings[0].vehicle
    tyre = identify(tests, vehicle)
    true = vehicle | {"mu": float(recordings[0].truth["mu"][0])}
    found = {f"identified_{name}": tyre.values[name] / true[name] - 1.0 for name in PARAMETERS}
    found |= {
        f"identified_{name}_std": tyre.standard_deviations[name] / tyre.values[name]
        for name in PARAMETERS
    }
    slips = np.concatenate([test.slip_front for test in tests])
    wheel_load = 0.25 * vehicle["mass"] * GRAVITY
    found["identified_residual"] = tyre.residual_rms
    found["separability"] = separability(slips, true["mu"], wheel_load, 3e6, 0.09)[0]
    return found
