"""A run of straight driving in, its plant's slopes along it out; see `Trajectory`."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gripbench.compilation import compiled
from gripbench.envs.plants.longitudinal.plant import (
    INPUT_TYPE,
    TYRE_TYPE,
    evaluate_tyres,
    plant_record,
)
from gripbench.envs.plants.longitudinal.sampling import TRUTH_TYPE, write_truth
from gripbench.envs.plants.longitudinal.scenario import LongitudinalScenario
from gripbench.envs.plants.longitudinal.world import LongitudinalSimulation
from gripbench.envs.plants.trajectory import Floats, Shift, Trajectory, moved
from gripbench.envs.populations.drives import friction_slope
from gripbench.envs.vehicles import CarOnRoad

_RATES = ("speed_x_rate", "wheel_acceleration_front", "wheel_acceleration_rear")
_STATES = ("speed_x", "wheel_speed_front", "wheel_speed_rear")
_TORQUES = ("torque_front", "torque_rear")


@compiled
def _sample(time, states, inputs, plant, tyres, truth):
    for k in range(time.shape[0]):
        evaluate_tyres(states[k], plant[0], tyres[0])
        write_truth(time[k], states[k], inputs[k], plant[0], tyres[0], truth[k])


class LongitudinalTrajectory(Trajectory):
    """A run of a scenario that a seed has drawn.

    Parameters
    ----------
    scenario
        The drawn scenario; it has samples (not the paper's solver).
    car
        The car that drove.
    seed
        Seed of the run.
    step
        Time between the samples [s], a multiple of the scenario's.
    """

    states: ClassVar[tuple[str, ...]] = _STATES
    given: ClassVar[tuple[str, ...]] = _TORQUES
    truth_type = TRUTH_TYPE

    def __init__(
        self, scenario: LongitudinalScenario, car: CarOnRoad, seed: int, step: float
    ) -> None:
        truth = LongitudinalSimulation(scenario, car).run(seed)
        every = max(round(step / scenario.sample_time), 1)
        self._scenario, self._car = scenario, car
        self._truth = truth[::every]
        self.time = np.ascontiguousarray(self._truth["time"])
        self.state = np.stack([self._truth[name] for name in _STATES], axis=1)
        self.inputs = np.stack([self._truth[name] for name in _TORQUES], axis=1)
        self.plant_step = scenario.sample_time
        relative = scenario.wheel_speed_noise * np.sqrt(scenario.sample_time / 1e-3)
        self.jumps = relative * np.abs(self.state)
        self.jumps[:, 0] = 0.0
        pieces = sorted(scenario.friction, key=lambda piece: piece.start)
        starts = [piece.start for piece in pieces]
        held = self.time - 0.5 * scenario.sample_time  # a sample has the friction of what led to it
        self._piece = np.maximum(np.searchsorted(starts, held, side="right") - 1, 0)
        self._steepness = np.array([friction_slope(one.first) for one in pieces])[self._piece]

    def evaluate(self, shift: Shift) -> Floats:
        """Return rates and truth, see `Trajectory`."""
        truth, car = self._truth, shift.car or self._car
        inputs = np.zeros(len(truth), INPUT_TYPE)
        torques = moved(self.inputs, shift.given)
        inputs["torque_front"], inputs["torque_rear"] = torques[:, 0], torques[:, 1]
        inputs["road_grade"] = truth["road_grade"]
        for axle in ("front", "rear"):
            tyres = getattr(car, f"peak_{axle}") / getattr(self._car, f"peak_{axle}")
            inputs[f"mu_{axle}"] = truth[f"mu_{axle}"] * tyres
        if shift.road is not None:
            name, size = shift.road
            if name == "grade":
                inputs["road_grade"] += size
            elif name == "friction_along":
                inputs["mu_front"] *= np.exp(size)
                inputs["mu_rear"] *= np.exp(size)
            elif name == "friction" or name.startswith("friction_step_"):
                number = int(name.rpartition("_")[2]) if name != "friction" else -1
                factor = np.where(
                    (number < 0) | (self._piece == number), np.exp(size * self._steepness), 1.0
                )
                inputs["mu_front"] *= factor
                inputs["mu_rear"] *= factor
        found = np.zeros(len(truth), TRUTH_TYPE)
        plant = plant_record(car, self._scenario.tyre)
        states = moved(self.state, shift.state)
        _sample(self.time, states, inputs, plant, np.zeros(1, TYRE_TYPE), found)
        rates = np.stack([found[name] for name in _RATES], axis=1)
        return np.hstack([rates, found.view(np.float64).reshape(len(found), -1)])

    def start(self, car: CarOnRoad | None = None) -> Floats:
        """Return the state at the start: the wheels roll without slip."""
        plant = plant_record(car or self._car, self._scenario.tyre)
        speed = self._scenario.initial_speed
        return np.array(
            [speed, *(speed / plant[f"radius_{axle}"][0] for axle in ("front", "rear"))]
        )
