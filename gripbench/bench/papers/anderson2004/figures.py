"""Figures 2 to 13 of Anderson & Bevly (2004), by their numbers.

Figures 3 and 5 to 7 are the paper's simulation of two 180 degree turns; its measured runs (8 to
13) are the scenarios of the same manoeuvres. As in the paper, the gyroscope has a scale factor of
1.02 where the text says so.
"""

from __future__ import annotations

from functools import partial
from math import degrees, radians
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.papers.anderson2004.reproduction import (
    ANOTHER_VEHICLE,
    SCALE,
    identify,
    with_gyro_scale,
)
from gripbench.bench.papers.anderson2004.riccati import steady_state
from gripbench.bench.papers.figures import PaperFigure
from gripbench.bench.papers.panels import Panel, draw_panels, signal_panel
from gripbench.bench.papers.sideslip import steady
from gripbench.bench.publishing.figures.runs import Runs
from gripbench.bench.publishing.figures.style import (
    TRUTH,
    line,
    new_figure,
    series_style,
    zero_line,
)
from gripbench.envs.recordings import Recording
from gripbench.envs.vehicles import GRAVITY, load_vehicle
from gripbench.envs.worlds import load_scenario, record
from gripbench.methods.contract import CompiledMethod
from gripbench.methods.kinematic_kalman_filter import KinematicKalmanFilter
from gripbench.methods.model_based_kalman_filter import ModelBasedKalmanFilter
from gripbench.methods.stiffness_update import StiffnessUpdate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TURNS, BANKED, CORNERING = "two_turns", "banked_turn", "parking_lot"
STATES = ("sideslip", "yaw_rate")
BANK = radians(8.0)
"""Bank of the turn of Figures 2, 10 and 11 [rad]."""


def _scaled(scenario: str) -> Recording:
    return record(with_gyro_scale(load_scenario(scenario)), 0)


def _identified(runs: Runs) -> dict[str, float]:
    return identify([runs.recording(TURNS, seed) for seed in (0, 1)])


def _states(
    run: Recording, vehicle: dict[str, float], methods: dict[str, CompiledMethod]
) -> Figure:
    estimates = [
        (label, method.run(vehicle, run.observations)) for label, method in methods.items()
    ]
    panels = [signal_panel(name, run.truth, estimates) for name in STATES]
    return draw_panels(run.truth["time"], panels, height=2.1)


def _understeer(runs: Runs) -> Figure:
    """Draw the steering that a turn needs, level and banked, and what the plant used."""
    vehicle = _identified(runs)
    scenario = load_scenario(BANKED)
    flat = scenario.road.model_copy(update={"turn_bank": 0.0})  # type: ignore[attr-defined]
    level = record(scenario.model_copy(update={"road": flat}), 0)
    a, b = vehicle["cg_to_front"], vehicle["cg_to_rear"]
    share = vehicle["mass"] / (a + b)
    understeer = share * (
        b / vehicle["cornering_stiffness_front"] - a / vehicle["cornering_stiffness_rear"]
    )
    figure = new_figure(3.2)
    axes = figure.subplots()
    lateral = np.linspace(0.2 * GRAVITY, 0.6 * GRAVITY, 50)
    cases = ((level, 0.0, "level"), (runs.recording(BANKED), BANK, "banked 8°"))
    for index, (run, bank, label) in enumerate(cases):
        bend = steady(run)
        rate, speed = run.truth["yaw_rate"][bend], run.truth["speed_x"][bend]
        curvature = float(np.mean(np.abs(rate / speed)))
        steer = (a + b) * curvature + understeer * (lateral - GRAVITY * np.sin(bank))
        look = series_style(index)
        line(axes, lateral / GRAVITY, np.degrees(steer), f"Bicycle, {label}", look)
        axes.plot(
            float(np.mean(np.abs(rate * speed))) / GRAVITY,
            degrees(float(np.mean(np.abs(run.truth["steer_angle"][bend])))),
            linestyle="", marker="X", markersize=9, color=look.color, label=f"Plant, {label}",
        )  # fmt: skip
    axes.set(xlabel="Lateral acceleration V²/R [g]", ylabel="Steering angle [°]")
    figure.legend(loc="outside upper center", ncols=4)
    return figure


def _covariance(runs: Runs) -> Figure:
    run, vehicle = runs.recording(TURNS), _identified(runs)
    curves = tuple(
        (
            label,
            np.degrees(np.sqrt(method.run(vehicle, run.observations)["sideslip_variance"])),
        )
        for label, method in (
            ("Kinematic filter", KinematicKalmanFilter()),
            ("Model-based filter", ModelBasedKalmanFilter()),
        )
    )
    panel = Panel("Predicted standard deviation of the sideslip angle [°]", curves, (0.0, 0.5))
    return draw_panels(run.truth["time"], [panel], height=2.8)


def _process_noise(runs: Runs) -> Figure:
    vehicle = load_vehicle("anderson2004_blazer").values()
    noise = np.geomspace(1e-3, 1.0, 30)
    deviation = [
        degrees(
            steady_state(
                vehicle,
                speed=30.0,
                rate=100.0,
                gyro_std=radians(0.3),
                course_std=radians(0.0382),
                steer_noise=radians(value),
                bias_walk=radians(0.005),
            ).sideslip
        )
        for value in noise
    ]
    figure = new_figure(3.0)
    axes = figure.subplots()
    axes.plot(noise, deviation, color=TRUTH.color, linewidth=TRUTH.linewidth)
    axes.set_xscale("log")
    axes.set(
        xlabel="Process noise of the steering angle [°/√Hz]",
        ylabel="Standard deviation of the\nsideslip angle [°]",
    )
    axes.set_ylim(bottom=0.0)
    return figure


def _kinematic(runs: Runs) -> Figure:
    run = _scaled(TURNS)
    return _states(run, run.vehicle, {"Kinematic filter": KinematicKalmanFilter()})


def _model(runs: Runs, right: bool) -> Figure:
    vehicle = _identified(runs) if right else _identified(runs) | ANOTHER_VEHICLE
    return _states(_scaled(TURNS), vehicle, {"Model-based filter": ModelBasedKalmanFilter()})


def _measured(runs: Runs, scenario: str, updated: bool = False) -> Figure:
    method = StiffnessUpdate(gyro_scale=SCALE) if updated else ModelBasedKalmanFilter()
    label = "With stiffness update" if updated else "Model-based filter"
    return _states(_scaled(scenario), _identified(runs), {label: method})


def _residuals(runs: Runs, scenario: str, updated: bool = False) -> Figure:
    run = _scaled(scenario)
    method = StiffnessUpdate(gyro_scale=SCALE) if updated else ModelBasedKalmanFilter()
    estimates = method.run(_identified(runs), run.observations)
    figure = new_figure(3.9)
    rows = figure.subplots(2, 1, sharex=True)
    for index, (axes, name, flag) in enumerate(
        zip(rows, ("yaw_rate_innovation", "course_innovation"), (None, "course_new"), strict=True)
    ):
        taken = _taken(run, flag)
        axes.plot(
            run.observations["time"][taken],
            np.degrees(estimates[name][taken]),
            color=series_style(index).color,
            linewidth=0.6,
        )
        zero_line(axes)
    rows[0].set_ylabel("Residual of the\nyaw rate [°/s]")
    rows[1].set_ylabel("Residual of the\nGPS course [°]")
    rows[1].set_xlabel("Time [s]")
    return figure


def _taken(run: Recording, flag: str | None) -> npt.NDArray[Any]:
    """Return the samples with a measurement, the first second without."""
    settled = run.observations["time"] > 1.0
    if flag is None:
        return np.asarray(settled)
    return np.asarray(settled & (run.observations[flag] > 0.0))


def _figures() -> tuple[PaperFigure, ...]:
    described = (
        (2, "Steady-state cornering, level and banked",
         "The bank carries part of the lateral acceleration: the banked turn needs less steering.",
         _understeer),
        (3, "Predicted error of the sideslip angle",
         "In the turns, where it gets no heading, the kinematic filter's deviation grows; the "
         "model-based filter's stays. The axis is cut at 0.5°, above which both start.",
         _covariance),
        (4, "Process noise against error",
         "The more the steering is distrusted, the larger the error, up to a ceiling that the "
         "measurements set.", _process_noise),
        (5, "Kinematic filter with a 2 % scale factor",
         "The scale factor integrates to a sideslip error that grows through each turn.",
         _kinematic),
        (6, "Model-based filter with another vehicle's parameters",
         "Wrong parameters bias both states, although the yaw rate is measured.",
         partial(_model, right=False)),
        (7, "Model-based filter with the right parameters",
         "With the right parameters the scale factor hardly matters.", partial(_model, right=True)),
        (8, "Cornering test", "Close to the limit of grip the linear model gives too much "
         "sideslip.", partial(_measured, scenario=CORNERING)),
        (9, "Residuals of the cornering test", "The residuals have a pattern: the model is wrong.",
         partial(_residuals, scenario=CORNERING)),
        (10, "Banked turn", "The unknown bank shifts both states.",
         partial(_measured, scenario=BANKED)),
        (11, "Residuals of the banked turn",
         "As long as the bank lasts, the residuals have a mean.",
         partial(_residuals, scenario=BANKED)),
        (12, "Cornering test with updated stiffness",
         "The stiffness learnt on the way brings the estimate closer to the truth.",
         partial(_measured, scenario=CORNERING, updated=True)),
        (13, "Residuals with updated stiffness", "Less pattern is left than in Figure 9.",
         partial(_residuals, scenario=CORNERING, updated=True)),
    )  # fmt: skip
    return tuple(PaperFigure(str(n), title, text, draw) for n, title, text, draw in described)


FIGURES = _figures()
"""Every result figure of the paper, in order."""
