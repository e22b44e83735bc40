"""Anderson & Bevly (2004) run again: Table I, Figures 2 to 13 and the errata.

Figures of time histories carry no numbers; each stands for the claim that the text makes of it.
Errors are sideslip RMS where the vehicle turns by more than 1 degree a second, over all seeds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from math import degrees, radians, sqrt

import numpy as np
import numpy.typing as npt

from gripbench.bench.papers.anderson2004.riccati import RATES, SteadyState, poles, steady_state
from gripbench.bench.papers.claims import Paper, load_paper
from gripbench.bench.papers.reproduction import Progress, Reproduction, of_claims
from gripbench.bench.papers.sideslip import (
    pooled_rms,
    sideslip_error,
    sideslip_rms,
    steady,
    turning,
)
from gripbench.bench.scoring.consistency import normalised_squares, whiteness_test
from gripbench.envs.recordings import Recording
from gripbench.envs.scenarios import Scenario
from gripbench.envs.vehicles import GRAVITY, load_vehicle
from gripbench.envs.worlds import load_scenario, record
from gripbench.methods.contract import CompiledMethod
from gripbench.methods.kinematic_kalman_filter import KinematicKalmanFilter
from gripbench.methods.model_based_kalman_filter import ModelBasedKalmanFilter
from gripbench.methods.stiffness_update import StiffnessUpdate

NAME = "anderson2004"
SCALE = 1.02
"""Scale factor of the gyroscope in section IV."""

ANOTHER_VEHICLE = {
    "mass": 2350.0,
    "cg_to_front": 1.40,
    "cg_to_rear": 1.191,
    "yaw_inertia": 4200.0,
    "cornering_stiffness_front": 95e3,
    "cornering_stiffness_rear": 95e3,
}
"""Parameters of a heavier vehicle with the same wheelbase (Figure 6 names no vehicle)."""

Vehicle = Mapping[str, float]


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
    vehicle = load_vehicle("anderson2004_blazer").values()
    tuning = [record(load_scenario("two_turns"), seed) for seed in paper.seeds.tuning[:2]]
    identified = identify(tuning)
    parts: list[Callable[[], dict[str, float]]] = [
        partial(table_1, paper, vehicle),
        partial(covariance_figures, vehicle),
        partial(level_turns, chosen, identified),
        partial(banked_turn, chosen, identified),
        partial(cornering_test, chosen, identified),
    ]
    figures: dict[str, float] = {}
    for done, part in enumerate(parts):
        if progress:
            progress(done, len(parts))
        figures |= part()
    if progress:
        progress(len(parts), len(parts))
    return of_claims(paper, figures)


def table_1(paper: Paper, vehicle: Vehicle) -> dict[str, float]:
    """Return Table I from the steady-state Riccati equation, and what its columns have in common.

    Columns 3 and 4, the noise, are inputs. The steering noise is not given; at 1 deg/sqrt(Hz) and
    above the yaw rate no longer depends on it.
    """
    printed = {claim.item: claim.published for claim in paper.claims}
    columns = ("sideslip", "yaw_rate", "gyro", "course")
    cell = {
        (column, rate): _given(printed[f"table_1.{column}.{rate:g}hz"])
        for column in columns
        for rate in RATES
    }

    def state(rate: float, steer_noise: float) -> SteadyState:
        return steady_state(
            vehicle,
            speed=30.0,
            rate=rate,
            gyro_std=radians(cell["gyro", rate]),
            course_std=radians(cell["course", rate]),
            steer_noise=radians(steer_noise),
            bias_walk=radians(0.005),
        )

    figures = {}
    for rate in RATES:
        steady = state(rate, 1.0)
        figures[f"table_1.sideslip.{rate:g}hz"] = degrees(steady.sideslip)
        figures[f"table_1.yaw_rate.{rate:g}hz"] = degrees(steady.yaw_rate)
    figures["table_1.sideslip_ceiling"] = max(
        degrees(state(100.0, noise).sideslip) for noise in np.geomspace(1e-3, 1e3, 25)
    )
    figures["table_1.proportional"] = max(
        abs(cell[column, rate] / (cell[column, 100.0] * sqrt(rate / 100.0)) - 1.0)
        for column in columns
        for rate in RATES
    )
    own = [state(rate, 1.0).sideslip / sqrt(rate) for rate in RATES]
    figures["table_1.proportional_riccati"] = max(own) / min(own) - 1.0
    figures["errata.eq5_sign"] = float(poles(vehicle, 30.0, printed=True).real.max())
    figures["errata.eq5_corrected"] = float(poles(vehicle, 30.0).real.max())
    return figures


def covariance_figures(vehicle: Vehicle) -> dict[str, float]:
    """Return what Figure 4 shows: predicted sideslip error against steering process noise."""
    deviations = [
        steady_state(
            vehicle,
            speed=30.0,
            rate=100.0,
            gyro_std=radians(0.3),
            course_std=radians(0.0382),
            steer_noise=radians(noise),
            bias_walk=radians(0.005),
        ).sideslip
        for noise in (0.003, 0.01, 0.03, 0.1)
    ]
    share = vehicle["mass"] / (vehicle["cg_to_front"] + vehicle["cg_to_rear"])
    understeer = (
        share * vehicle["cg_to_rear"] / vehicle["cornering_stiffness_front"]
        - share * vehicle["cg_to_front"] / vehicle["cornering_stiffness_rear"]
    )
    return {
        "figure_2.understeer": degrees(understeer * GRAVITY),
        "figure_4.growth": min(b / a for a, b in pairwise(deviations)),
    }


def level_turns(seeds: Sequence[int], identified: Vehicle) -> dict[str, float]:
    """Return Figures 3, 5 to 7 and 12 and the residuals of eq. 8, on two level turns."""
    scenario = load_scenario("two_turns")
    clean = [record(scenario, seed) for seed in seeds]
    scaled = [record(with_gyro_scale(scenario), seed) for seed in seeds]
    vehicle = clean[0].vehicle
    another = vehicle | ANOTHER_VEHICLE
    kinematic, model = KinematicKalmanFilter(), ModelBasedKalmanFilter()
    calibrated = KinematicKalmanFilter(gyro_scale=SCALE)
    learning = KinematicKalmanFilter("scale_factor")
    updated = StiffnessUpdate(gyro_scale=SCALE)
    figures = {
        "figure_5.clean": sideslip_rms(kinematic, vehicle, clean),
        "figure_5.scale_factor": sideslip_rms(kinematic, vehicle, scaled),
        "figure_5.end_of_turn": float(np.mean([_end_of_turn(kinematic, run) for run in scaled])),
        "figure_5.scale_removed": sideslip_rms(calibrated, vehicle, scaled),
        "figure_5.scale_learnt": sideslip_rms(learning, vehicle, scaled),
        "figure_6.clean": sideslip_rms(model, another, clean),
        "figure_6.scale_factor": sideslip_rms(model, another, scaled),
        "figure_7.clean": sideslip_rms(model, identified, clean),
        "figure_7.scale_factor": sideslip_rms(model, identified, scaled),
        "section_4.softer_rear": sideslip_rms(model, _stiffer(identified, 1.0, 0.8), clean),
        "section_4.stiffer": sideslip_rms(model, _stiffer(identified, 1.2, 1.2), clean),
        "section_5.updated": sideslip_rms(updated, another, scaled),
    }
    for item, over, under in (
        ("figure_5.growth", "figure_5.scale_factor", "figure_5.clean"),
        ("figure_6.growth", "figure_6.clean", "figure_7.clean"),
        ("figure_7.share", "figure_7.scale_factor", "figure_5.scale_factor"),
        ("section_5.share", "section_5.updated", "figure_6.scale_factor"),
    ):
        figures[item] = figures[over] / figures[under]
    figures["figure_3.growth"], figures["figure_3.share"] = _covariances(identified, clean[0])
    cases: dict[str, tuple[CompiledMethod, Vehicle, list[Recording]]] = {
        "correct": (model, identified, clean),
        "scale_factor": (model, identified, scaled),
        "another_vehicle": (model, another, clean),
        "updated": (updated, another, scaled),
    }
    for name, case in cases.items():
        residuals = course_residuals(*case)
        figures[f"residuals.{name}.memory"] = residuals.memory
        figures[f"residuals.{name}.power"] = residuals.power
    figures["errata.eq8_covariance"] = _printed_over_actual(identified, clean[0])
    return figures


def banked_turn(seeds: Sequence[int], identified: Vehicle) -> dict[str, float]:
    """Return Figures 2 and 10, on the turn with 8 degrees of bank."""
    scenario = load_scenario("banked_turn")
    runs = [record(scenario, seed) for seed in seeds]
    level = record(_without_bank(scenario), seeds[0])
    model, informed = ModelBasedKalmanFilter(), ModelBasedKalmanFilter("bank")
    errors = [sideslip_error(model, identified, run)[steady(run)] for run in runs]
    steer = [np.mean(np.abs(run.truth["steer_angle"][steady(run)])) for run in (level, runs[0])]
    unknown, known = (sideslip_rms(method, identified, runs) for method in (model, informed))
    return {
        "figure_2.bank_steer": degrees(float(steer[0] - steer[1])),
        "figure_10.unknown_bank": float(np.mean(np.concatenate(errors))),
        "figure_10.known_bank": known,
        "figure_10.known_share": known / unknown,
        "figure_10.over_integration": unknown
        / pooled_rms([_integrated_accelerometer(run) for run in runs]),
    }


def cornering_test(seeds: Sequence[int], identified: Vehicle) -> dict[str, float]:
    """Return Figures 8, 9, 12 and 13, on a parking lot close to the limit of grip."""
    runs = [record(with_gyro_scale(load_scenario("parking_lot")), seed) for seed in seeds]
    model, updated = ModelBasedKalmanFilter(), StiffnessUpdate(gyro_scale=SCALE)
    before = course_residuals(model, identified, runs)
    after = course_residuals(updated, identified, runs)
    return {
        "figure_8.sideslip": sideslip_rms(model, identified, runs),
        "figure_9.memory": before.memory,
        "figure_9.whiteness": before.memory / before.band,
        "figure_12.sideslip": sideslip_rms(updated, identified, runs),
        "figure_13.memory": after.memory,
        "figure_13.whiteness": after.memory / after.band,
        "figure_13.power_ratio": after.power / before.power,
    }


def identify(runs: Sequence[Recording]) -> dict[str, float]:
    """Return the vehicle with the cornering stiffness that its steady turns show.

    Least squares of each axle's compliance over the force that the motion needs, from the true
    sideslip: what an instrumented vehicle on a test track gives.
    """
    vehicle = dict(runs[0].vehicle)
    a, b = vehicle["cg_to_front"], vehicle["cg_to_rear"]
    sums = np.zeros((2, 2))
    for run in runs:
        truth = run.truth[steady(run)]
        rate, speed, beta = truth["yaw_rate"], truth["speed_x"], truth["sideslip"]
        force = vehicle["mass"] * speed * rate / (a + b)
        front = truth["steer_angle"] - beta - a * rate / speed
        rear = b * rate / speed - beta
        for axle, (load, angle) in enumerate(((b * force, front), (a * force, rear))):
            sums[axle] += load @ load, load @ angle
    vehicle["cornering_stiffness_front"] = float(sums[0, 0] / sums[0, 1])
    vehicle["cornering_stiffness_rear"] = float(sums[1, 0] / sums[1, 1])
    return vehicle


@dataclass(frozen=True)
class CourseResiduals:
    """GPS residuals over several runs.

    Attributes
    ----------
    memory, power
        Lag-1 autocorrelation and mean normalised square, means over the runs; a right model has 0
        and 1.
    band
        Half width of the 95 % band of the autocorrelation of one run's white residuals.
    """

    memory: float
    power: float
    band: float


def course_residuals(
    method: CompiledMethod, vehicle: Vehicle, runs: Sequence[Recording]
) -> CourseResiduals:
    """Return what the GPS residuals from 5 s on say of the model."""
    memory, power, band = [], [], []
    for run in runs:
        estimates = method.run(vehicle, run.observations)
        taken = (run.observations["course_new"] > 0.0) & (run.observations["time"] > 5.0)
        residual = estimates["course_innovation"][taken]
        variance = estimates["course_innovation_variance"][taken]
        power.append(float(normalised_squares(residual, variance).mean()))
        test = whiteness_test(residual / np.sqrt(variance))
        memory.append(float(test.autocorrelation[0]))
        band.append(test.band)
    return CourseResiduals(*(float(np.mean(part)) for part in (memory, power, band)))


def with_gyro_scale(scenario: Scenario, scale: float = SCALE) -> Scenario:
    """Return a scenario whose yaw rate gyroscope has another scale factor."""
    gyro = scenario.all_sensors()["yaw_rate"].model_copy(update={"scale": scale})
    return scenario.model_copy(update={"sensors": {**scenario.sensors, "yaw_rate": gyro}})


def _without_bank(scenario: Scenario) -> Scenario:
    road = scenario.road.model_copy(update={"turn_bank": 0.0})  # type: ignore[attr-defined]
    return scenario.model_copy(update={"road": road})


def _stiffer(vehicle: Vehicle, front: float, rear: float) -> dict[str, float]:
    """Return a vehicle with its axles' stiffness times the given factors."""
    return dict(vehicle) | {
        "cornering_stiffness_front": front * vehicle["cornering_stiffness_front"],
        "cornering_stiffness_rear": rear * vehicle["cornering_stiffness_rear"],
    }


def _end_of_turn(method: CompiledMethod, run: Recording) -> float:
    """Return the sideslip error [deg], mean of the last second of the first turn's arc."""
    bend = steady(run)
    last = int(np.flatnonzero(bend[:-1] & ~bend[1:])[0])
    return float(sideslip_error(method, run.vehicle, run)[last - 100 : last].mean())


def _covariances(vehicle: Vehicle, run: Recording) -> tuple[float, float]:
    """Return the growth of the kinematic deviation in the first turn, and the model's over it."""
    bend = np.flatnonzero(turning(run))
    first, last = bend[0], bend[np.flatnonzero(np.diff(bend) > 1)[0]]
    kinematic = KinematicKalmanFilter().run(vehicle, run.observations)["sideslip_variance"]
    model = ModelBasedKalmanFilter().run(vehicle, run.observations)["sideslip_variance"]
    growth, share = kinematic[last] / kinematic[first], model[last] / kinematic[last]
    return sqrt(growth), sqrt(share)


def _printed_over_actual(vehicle: Vehicle, run: Recording) -> float:
    """Return the residual's deviation by the printed eq. 8 over the one with the covariance."""
    settled = run.observations["time"] > 5.0
    variances = [
        ModelBasedKalmanFilter(variant).run(vehicle, run.observations)[settled]
        for variant in ("paper", "corrected")
    ]
    field = "course_innovation_variance"
    return float(np.mean(np.sqrt(variances[0][field] / variances[1][field])))


def _integrated_accelerometer(run: Recording) -> npt.NDArray[np.float64]:
    """Return the error [deg] in the turn of sideslip from the integral of a_y/V - r."""
    seen = run.observations
    bend = np.flatnonzero(turning(run))
    first, last = bend[0], bend[-1]
    rate = seen["accel_y"] / seen["speed_gps"] - seen["yaw_rate"]
    elapsed = np.diff(seen["time"], prepend=seen["time"][0])
    angle = np.cumsum((rate * elapsed)[first : last + 1])
    return np.degrees(angle - run.truth["sideslip"][first : last + 1])


def _given(value: float | None) -> float:
    if value is None:
        raise ValueError("a cell of Table I has no published value")
    return value
