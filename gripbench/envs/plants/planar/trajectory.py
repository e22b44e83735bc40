"""A run of the planar world in, its plant's slopes along it out; see `Trajectory`.

Position and distance are no states here: they only say where on the road the car is, and the road
is held as it was met. The steering angle is an input.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from gripbench.compilation import compiled
from gripbench.envs.plants.planar import plant
from gripbench.envs.plants.planar.run import HEADING, NORTH, UP, Run, act, begin, decide
from gripbench.envs.plants.planar.truth import TRUTH, write_truth
from gripbench.envs.plants.planar.world import WHEELS, PlanarScenario, PlanarSimulation
from gripbench.envs.plants.trajectory import Floats, Shift, Trajectory, moved
from gripbench.envs.populations.drives import friction_slope
from gripbench.envs.roads.road import Ground, Road, feel_road, lay_road
from gripbench.envs.vehicles import CarOnRoad

_KEPT = (*range(plant.V_X, plant.LAGGED_Y + 1), plant.YAW)


@compiled
def _trace(run, parts, every, truth, columns, states, torques):
    """Run to the end and keep every so many samples of state and torques; return how many."""
    kept = 1
    states[0] = run.state
    for k in range(1, (states.shape[0] - 1) * every + 1):
        decide(run, k - 1)
        code = act(run, k, parts, run.action, truth, columns, 0)
        if code != 0 or not np.isfinite(run.state[plant.V_X]):
            break
        if k % every == 0:
            states[kept] = run.state
            torques[kept] = run.inputs[plant.TORQUE : plant.TORQUE + 4]
            kept += 1
    return kept


@compiled
def _sample(
    time, states, torques, disturbance, car, friction, profile, site, u, wheels, dx, rates, truth,
    columns,
):  # fmt: skip
    for k in range(time.shape[0]):
        u[:] = 0.0
        for i in range(4):
            u[plant.TORQUE + i] = torques[k, i]
        feel_road(states[k], car[0], friction[0], profile, u)
        write_truth(
            time[k], states[k], u, car[0], site[HEADING], site[NORTH], site[UP], disturbance[k],
            wheels, dx, truth[k], columns[k],
        )  # fmt: skip
        rates[k] = dx


class PlanarTrajectory(Trajectory):
    """A run of a scenario that a seed has drawn.

    Parameters
    ----------
    scenario
        The drawn scenario.
    car
        The car that drove.
    seed
        Seed of the run.
    step
        Time between the samples [s], a multiple of the scenario's.
    """

    states: ClassVar[tuple[str, ...]] = (
        "speed_x", "speed_y", "yaw_rate", *(f"wheel_speed_{wheel}" for wheel in WHEELS),
        "suspension_roll", "suspension_roll_rate", "lagged_x", "lagged_y", "yaw",
    )  # fmt: skip
    given: ClassVar[tuple[str, ...]] = (
        "steer_angle", *(f"torque_{wheel}" for wheel in WHEELS),
    )  # fmt: skip
    truth_type = TRUTH

    def __init__(self, scenario: PlanarScenario, car: CarOnRoad, seed: int, step: float) -> None:
        simulation = PlanarSimulation(scenario, car)
        simulation.reset(seed)
        run: Run = simulation._run
        every = max(round(step / scenario.sample_time), 1)
        count = scenario.steps // every + 1
        row = np.zeros(1, TRUTH)
        columns = row.view(np.float64).reshape(1, -1)
        states, torques = np.zeros((count, plant.STATES)), np.zeros((count, 4))
        parts = round(scenario.sample_time / plant.STEP)
        kept = _trace(run, parts, every, row, columns, states, torques)
        self._scenario, self._car, self._seed = scenario, car, seed
        self._run, self._full, self._torques = run, states[:kept], torques[:kept]
        self._disturbance = np.resize(run.disturbance[::every], (kept, 3))
        self.time = np.arange(kept) * (every * scenario.sample_time)
        self.state = np.ascontiguousarray(self._full[:, _KEPT])
        self.inputs = np.column_stack([self._full[:, plant.STEER], self._torques])
        self.jumps = np.zeros_like(self.state)
        self.plant_step = plant.STEP

    def evaluate(self, shift: Shift) -> Floats:
        """Return rates and truth, see `Trajectory`."""
        car = self._run.plant
        if shift.car is not None:
            car = plant.plant_record(self._scenario.tyre, shift.car)
        friction, profile = self._run.friction, self._run.profile
        if shift.road is not None:
            ground = self._ground(*shift.road)
            friction, profile = ground.friction, ground.profile
        given = moved(self.inputs, shift.given)
        states = self._full.copy()
        states[:, _KEPT] = moved(self.state, shift.state)
        states[:, plant.STEER] = given[:, 0]
        n = len(states)
        rates, truth = np.zeros((n, plant.STATES)), np.zeros(n, TRUTH)
        columns = truth.view(np.float64).reshape(n, -1)
        _sample(
            self.time, states, given[:, 1:], self._disturbance, car, friction, profile,
            self._run.site, np.zeros(plant.INPUTS), np.zeros((4, plant.WHEEL_COLUMNS)),
            np.zeros(plant.STATES), rates, truth, columns,
        )  # fmt: skip
        return np.hstack([rates[:, _KEPT], columns])

    def start(self, car: CarOnRoad | None = None) -> Floats:
        """Return the state at the start: rolling straight ahead, the body settled."""
        record = self._run.plant if car is None else plant.plant_record(self._scenario.tyre, car)
        first = np.zeros(1, TRUTH)
        columns = first.view(np.float64).reshape(1, -1)
        state = np.zeros(plant.STATES)
        run = self._run._replace(plant=record, state=state, inputs=np.zeros(plant.INPUTS))
        begin(run, self._scenario.speed, first, columns)
        return state[list(_KEPT)]

    def _ground(self, name: str, size: float) -> Ground:
        """Return the road with one thing of it moved."""
        road = self._scenario.road

        def moved_by(value: float) -> float:
            if value <= 0.0:
                return value
            steep = 1.0 if name == "friction_along" else friction_slope(value)
            return value * float(np.exp(size * steep))

        changes: dict[str, Any] = {}
        if name in ("grade", "bank"):
            changes[name] = getattr(road, name) + size
        elif name in ("friction", "friction_along"):
            changes = {key: moved_by(getattr(road, key)) for key in ("mu", "mu_right", "mu_after")}
            changes["surfaces"] = tuple(
                one.model_copy(update={"mu": moved_by(one.mu)}) for one in road.surfaces
            )
        elif name == "friction_right":
            changes["mu_right"] = moved_by(road.mu_right)
        else:
            number = int(name.rpartition("_")[2])
            changes["surfaces"] = tuple(
                one.model_copy(update={"mu": moved_by(one.mu) if place == number else one.mu})
                for place, one in enumerate(road.surfaces, 1)
            )
            if number == 1:
                changes["mu_after"] = moved_by(road.mu_after)
        return _laid(road.model_copy(update=changes), self._run.path, self._scenario, self._seed)


def _laid(road: Road, path: Floats, scenario: PlanarScenario, seed: int) -> Ground:
    return lay_road(road, path[:, 3], scenario.longest(), seed)
