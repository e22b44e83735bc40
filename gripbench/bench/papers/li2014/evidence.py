"""What each erratum and each setting behind Tables IV and V of Li, Du & Li (2014) is worth.

Every row changes one thing of the reproduction and counts again. Where cells cannot show it, a
direct figure does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.catalogue.registry import built_in_methods
from gripbench.bench.papers.li2014 import evidence_figures as figures
from gripbench.bench.papers.li2014 import tables as paper_tables
from gripbench.bench.papers.li2014.tables import MethodColumn, Outcome, RecordingMethod
from gripbench.bench.publishing.columns import Column, Table
from gripbench.envs.instruments.suite import SensorSuite
from gripbench.envs.plants.longitudinal.scenario import LongitudinalScenario
from gripbench.envs.plants.longitudinal.world import LongitudinalSimulation
from gripbench.envs.recordings import Recording
from gripbench.envs.scenarios import Scenario
from gripbench.envs.vehicles import GRAVITY, CarOnPaper, load_vehicle
from gripbench.envs.worlds import load_scenario, record
from gripbench.methods.proposed_observer import ProposedObserver

_NOISY, _SIMPLE = "li2014_noisy_acceleration", "li2014_constant_mu"

Recorder = Callable[[Scenario, int], Recording]
Chooser = Callable[[MethodColumn, str], RecordingMethod]


@cache
def _named(name: str, seed: int) -> Recording:
    return record(load_scenario(name), seed)


def _as_is(scenario: Scenario, seed: int) -> Recording:
    return _named(scenario.name, seed)  # most rows run over the same recordings


@dataclass(frozen=True)
class Change:
    """One thing done otherwise: in the world, in the methods, or shown by a figure only."""

    group: str
    item: str
    alternative: str
    recorder: Recorder | None = None
    chooser: Chooser | None = None
    figure: Callable[[Outcome | None], str] | None = None


def _of_scenario(**changes: Any) -> Recorder:
    def recorder(scenario: Scenario, seed: int) -> Recording:
        return record(scenario.model_copy(update=changes), seed)

    return recorder


def _of_vehicle(parameter: str, value: float) -> Recorder:
    def recorder(scenario: Scenario, seed: int) -> Recording:
        assert isinstance(scenario, LongitudinalScenario)
        vehicle = figures.with_parameter(load_vehicle(scenario.vehicle), parameter, value)
        simulation = LongitudinalSimulation(scenario, vehicle)
        truth = simulation.run(seed)
        suite = SensorSuite(scenario.all_sensors(), simulation.truth_type, None, seed)
        return Recording(
            scenario.name, seed, CarOnPaper(vehicle.values()), suite.observe(truth), truth
        )

    return recorder


def _of_channels(change: Callable[[npt.NDArray[Any]], Mapping[str, Any]]) -> Recorder:
    """Return a recorder that replaces observed channels by others computed from them."""

    def recorder(scenario: Scenario, seed: int) -> Recording:
        run = _as_is(scenario, seed)
        observations = run.observations.copy()
        for name, values in change(run.observations).items():
            observations[name] = values
        return Recording(run.scenario, seed, run.vehicle, observations, run.truth)

    return recorder


def _without_ramp(scenario: Scenario, seed: int) -> Recording:
    assert isinstance(scenario, LongitudinalScenario)
    flat = tuple(piece.model_copy(update={"first": piece.last}) for piece in scenario.driver.front)
    driver = scenario.driver.model_copy(update={"front": flat})
    return record(scenario.model_copy(update={"driver": driver}), seed)


def _without_friction_step(scenario: Scenario, seed: int) -> Recording:
    if scenario.name != _NOISY:
        return _as_is(scenario, seed)
    friction = load_scenario(_SIMPLE).model_dump()["friction"]
    changed = type(scenario).model_validate({**scenario.model_dump(), "friction": friction})
    return record(changed, seed)


def _differenced(observations: npt.NDArray[Any]) -> dict[str, Any]:
    elapsed = np.diff(observations["time"])
    return {
        f"wheel_acceleration_{axle}": np.append(
            0.0, np.diff(observations[f"wheel_speed_{axle}"]) / elapsed
        )
        for axle in ("front", "rear")
    }


def _with(method: str, variant: str = "", noisy: bool = True, **overrides: float) -> Chooser:
    """Return a choice of methods with another setting of one of them, or of all for `*`."""

    def chooser(column: MethodColumn, scenario: str) -> RecordingMethod:
        usual = column.exceptions.get(scenario, column.variant)
        if method not in ("*", column.method) or (scenario == _NOISY and not noisy):
            return paper_tables.method_of(column, scenario)
        return built_in_methods()[column.method](variant=variant or usual, **overrides)

    return chooser


def _law_of_noisy_row(normalised: float) -> Chooser:
    def chooser(column: MethodColumn, scenario: str) -> RecordingMethod:
        if column.method == "proposed_observer" and scenario == _NOISY:
            return ProposedObserver("paper_noise", normalised=normalised)
        return paper_tables.method_of(column, scenario)

    return chooser


@dataclass(frozen=True)
class _Clipped:
    """A method whose friction is limited to 0 to 1."""

    method: RecordingMethod

    def run(self, vehicle: dict[str, float], observations: npt.NDArray[Any]) -> npt.NDArray[Any]:
        estimates = self.method.run(vehicle, observations)
        estimates["mu_front"] = np.clip(estimates["mu_front"], 0.0, 1.0)
        return estimates


def _clipped(column: MethodColumn, scenario: str) -> RecordingMethod:
    return _Clipped(paper_tables.method_of(column, scenario))


@dataclass(frozen=True)
class _GradientTerm:
    """The observer with the term -m g sin(theta) of eq. 29 in its balance of forces.

    The term acts like a smaller rolling resistance; what that does to the velocity observer is
    taken back through the torque, which enters there only.
    """

    method: RecordingMethod

    def run(self, vehicle: dict[str, float], observations: npt.NDArray[Any]) -> npt.NDArray[Any]:
        slope = float(np.sin(observations["road_grade"][0]))
        changed = vehicle | {"rolling_resistance": vehicle["rolling_resistance"] - slope}
        obs = observations.copy()
        obs["torque_front"] -= vehicle["mass"] * GRAVITY * slope * vehicle["wheel_radius"]
        return self.method.run(changed, obs)


def _gradient_term(column: MethodColumn, scenario: str) -> RecordingMethod:
    usual = paper_tables.method_of(column, scenario)
    return _GradientTerm(usual) if column.method == "proposed_observer" else usual


def _ratios(outcome: Outcome | None) -> str:
    """Return the ratios of the proposed observer's cells that bear on its open cell."""
    assert outcome is not None
    texts = []
    for table in outcome.paper.tables:
        cells = [c for c in outcome.of_table(table.label) if c.method == "Proposed"]
        ratios = ", ".join(f"{cell.ratio:.2f}" for cell in cells)
        texts.append(f"{table.label}: {ratios}")
    return "Proposed, ours over published, " + "; ".join(texts)


def _cell(label: str, scenario: str, method: str) -> Callable[[Outcome | None], str]:
    def figure(outcome: Outcome | None) -> str:
        assert outcome is not None
        found = next(
            c
            for c in outcome.of_table(label)
            if c.scenario == f"li2014_{scenario}" and c.method == method
        )
        return f"{method}, table {label}, {scenario}: ratio {found.ratio:.2f}"

    return figure


def _largest_ratio(outcome: Outcome | None) -> str:
    assert outcome is not None
    worst = max(outcome.cells, key=lambda cell: abs(np.log(cell.ratio)))
    return (
        f"worst cell: {worst.method}, table {worst.table}, "
        f"{worst.scenario.removeprefix('li2014_')}: ratio {worst.ratio:.3g}"
    )


def _noisy_run(seed: int) -> Recording:
    return _named(_NOISY, seed)


def changes(seeds: int) -> tuple[Change, ...]:
    """Return every row of the evidence; `seeds` is the number of the noisy row's."""
    observer = "proposed_observer"
    combined = "li2014_combined_traction_braking"

    def noisy(**settings: float) -> Callable[[Outcome | None], str]:
        method = ProposedObserver("paper_noise", **settings)
        return lambda _: figures.single_seeds(_noisy_run, seeds, method)

    return (
        Change("", "none", "as reproduced", figure=_largest_ratio, recorder=_as_is),
        Change(
            "errata", "Table III: C_r", "1.5", figure=lambda _: figures.rolling_resistance()
        ),
        Change("errata", "Table III: C_r", "0.02", _of_vehicle("rolling_resistance", 0.02)),
        Change(
            "errata", "eq. 24: argument of Sat", "as printed, d = 0.1",
            figure=lambda _: figures.sat_argument(_named(_SIMPLE, 0)),
        ),
        Change(
            "errata", "eq. 25: d", "0.1",
            figure=lambda _: figures.sat_width(_named(_SIMPLE, 0)),
        ),
        Change(
            "errata", "eq. 27: convergence", "accelerometer with a bias",
            figure=lambda _: figures.accelerometer_bias(),
        ),
        Change(
            "errata", "eq. 29: -m g sin(theta)", "with the term", chooser=_gradient_term,
            figure=_cell("IV", "gradient", "Proposed"),
        ),
        Change(
            "errata", "Figure 19: k_dot = -K_e e", "as printed",
            figure=lambda _: figures.printed_stiffness_law(_named(combined, 0)),
        ),
        Change(
            "errata", "Table III: C_s", "two tyres an axle, 100000 N",
            _of_vehicle("longitudinal_stiffness", 1e5),
            figure=lambda o: f"{figures.tyre_slope()}; {_cell('V', 'gradient', 'Proposed')(o)}",
        ),
        Change(
            "errata", "eq. 15: map", "unbiased, k/30",
            chooser=_with("*", slope_gain=1.0 / 30.0, slope_offset=0.0),
            figure=lambda _: "printed map " + figures.friction_map(),
        ),
        Change(
            "errata", "eq. 16-20: v_x", "open loop, as printed",
            figure=lambda _: figures.open_loop_speed(_named(_SIMPLE, 0)),
        ),
        Change(
            "errata", "eq. 20: a_x of the EKF", "accelerometer instead of v_dot",
            _of_channels(lambda obs: {"speed_x_rate": obs["accel_x"]}),
            figure=_cell("IV", "gradient", "EKF"),
        ),
        Change(
            "settings", "solver", "accurate integrator, no noise",
            _of_scenario(integrator="ros3"),
            figure=lambda _: figures.solver_error(_named(_SIMPLE, 0)),
        ),
        Change(
            "settings", "solver", "accurate, wheel speed noise 3.6e-4",
            _of_scenario(integrator="ros3", wheel_speed_noise=3.6e-4),
        ),
        Change("settings", "torque", "no ramp in the first second", _without_ramp),
        Change(
            "settings", "noisy row: friction", "constant 0.9 instead of the step",
            _without_friction_step, figure=_cell("V", "noisy_acceleration", "Method 2"),
        ),
        Change("settings", "RLS: lambda", "0.999", chooser=_with("*", forgetting=0.999)),
        Change("settings", "friction", "limited to 0 to 1", chooser=_clipped),
        Change(
            "settings", "Method 2: gains", "natural frequency 50 rad/s",
            chooser=_with("individual_wheel_torque", wheel_gain=210.0, force_gain=15000.0),
        ),
        Change(
            "settings", "wheel accelerations", "differenced wheel speeds",
            _of_channels(_differenced), figure=_ratios,
        ),
        Change(
            "settings", "noisy row: stiffness law", "normalised, 140/s (as reproduced)",
            figure=noisy(),
        ),
        Change(
            "settings", "noisy row: stiffness law", "not normalised, K_e 140",
            chooser=_law_of_noisy_row(0.0),
            figure=noisy(normalised=0.0),
        ),
        Change(
            "open cell", "gradient, friction", "as reproduced",
            figure=lambda _: figures.early_error(_named("li2014_gradient", 0)),
        ),
        *(
            Change(
                "open cell", "velocity gain of the observer", f"K_a {gain:.2g}",
                chooser=_with(observer, "", False, velocity_gain=gain),
                figure=_ratios,
            )
            for gain in (6e5, 8e5, 1.1e6, 1.2e6, 1.5e6)
        ),
        Change(
            "open cell", "gains of the observer", "K_a 1.5e6, K_e 5e4",
            chooser=_with(observer, "", False, velocity_gain=1.5e6, stiffness_gain=5e4),
            figure=_ratios,
        ),
        Change(
            "open cell", "slip of the observer", "true speed, all rows",
            chooser=_with(
                observer, "paper_noise", False, stiffness_gain=8e4, normalised=0.0
            ),
            figure=_ratios,
        ),
    )  # fmt: skip


def evidence(paper: paper_tables.PaperTables, advance: Callable[[], None] = lambda: None) -> Table:
    """Return the table: one row a change, with what becomes of the cells.

    Parameters
    ----------
    paper
        The published tables of this paper.
    advance
        Called after each row, for a progress bar.
    """
    seeds = next(row.seeds for row in paper.scenarios if row.scenario == _NOISY)
    rows = []
    for change in changes(seeds):
        outcome = None
        if change.recorder or change.chooser:
            outcome = paper_tables.reproduce(
                paper, recorder=change.recorder or _as_is, chooser=change.chooser
            )
        row: dict[str, Any] = {
            "group": change.group,
            "item": change.item,
            "alternative": change.alternative,
            "figure": change.figure(outcome) if change.figure else "",
        }
        for label in ("IV", "V"):
            row[f"{label}_matches"] = row[f"{label}_mean"] = None
            if outcome is not None:
                row[f"{label}_matches"] = sum(c.matches for c in outcome.of_table(label))
                row[f"{label}_mean"] = outcome.mean_log_ratio(label)
        rows.append(row)
        advance()
    _named.cache_clear()
    return Table(
        columns=(
            Column("item", "Item"),
            Column("alternative", "Alternative"),
            Column("IV_matches", "IV: cells"),
            Column("IV_mean", "IV: mean |ln|", "", ".2f"),
            Column("V_matches", "V: cells"),
            Column("V_mean", "V: mean |ln|", "", ".2f"),
            Column("figure", "Figure"),
        ),
        rows=tuple(rows),
        caption="Li, Du & Li (2014): cells within a factor of 2 of the published value, of 30 in "
        "each table, and mean |ln(ours/published)|, when one thing is done otherwise",
        group_by="group",
    )
