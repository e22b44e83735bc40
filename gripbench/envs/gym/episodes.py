"""What an episode is made of: from scenario, options and seed to a simulation and its sensors."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from gripbench.envs.gym.arguments import scenario_with
from gripbench.envs.instruments.fault_injection import Faults
from gripbench.envs.instruments.suite import SensorSuite
from gripbench.envs.plants.simulation import Simulation
from gripbench.envs.populations.draws import paper_of
from gripbench.envs.scenarios import Scenario
from gripbench.envs.signals import NEW, signal
from gripbench.envs.worlds import faults_of, load_scenario, sensors_of, simulation_of

_LARGEST = {
    "s": 1e5,
    "m": 1e6,
    "m/s": 1e3,
    "m/s^2": 1e6,
    "rad": 1e2,
    "rad/s": 1e5,
    "rad/s^2": 1e8,
    "N": 1e7,
    "N m": 1e6,
    "T": 1.0,
    "-": 1e3,
}
"""Bounds of observations by unit: far beyond a vehicle, but finite, as Gymnasium asks."""


def observation_space(channels: tuple[str, ...]) -> spaces.Dict:
    """Return the space of a dict of scalar channels."""
    boxes: dict[str, spaces.Space[Any]] = {}
    for name in channels:
        if name.endswith(NEW):
            boxes[name] = spaces.Box(0.0, 1.0, (), np.float64)
        else:
            bound = _LARGEST[signal(name).unit]
            boxes[name] = spaces.Box(-bound, bound, (), np.float64)
    return spaces.Dict(boxes)


class Episodes:
    """The episodes of one environment.

    Parameters
    ----------
    scenario
        Name of a scenario that ships, or path of its TOML file.
    idealised
        Whether observations also hold the scenario's channels that no sensor in a vehicle gives.

    Attributes
    ----------
    scenario
        The scenario.
    vehicle
        The car on paper, which is all that a method may know of it.
    channels
        What an observation holds, in order.
    """

    def __init__(self, scenario: str, idealised: bool) -> None:
        self.scenario = load_scenario(scenario)
        self.vehicle = paper_of(self.scenario)
        self._sensors = self.scenario.all_sensors()
        self._observed = self.suite(self.simulation(), 0).observation_type
        names = self._observed.names or ()
        self.channels = tuple(
            name for name in names if idealised or not signal(name.removesuffix(NEW)).idealised
        )

    def simulation(self, options: dict[str, Any] | None = None) -> Simulation:
        """Return a simulation of the scenario, changed by the options of an episode."""
        return simulation_of(self.changed(options))

    def changed(self, options: dict[str, Any] | None) -> Scenario:
        """Return the scenario with the options of an episode; itself if there are none."""
        return scenario_with(self.scenario, options)

    def suite(self, simulation: Simulation, seed: int) -> SensorSuite:
        """Return the sensors of the episode with a seed; they have not measured yet."""
        sensors = sensors_of(self.scenario, seed) if self.scenario.level else self._sensors
        return SensorSuite(sensors, simulation.truth_type, simulation.sample_time, seed)

    def faults(self, simulation: Simulation, seed: int) -> Faults | None:
        """Return the faults of the episode with a seed; None where the scenario has none."""
        return faults_of(self.scenario, self._observed, simulation.sample_time, seed)

    def observation(
        self, observed: npt.NDArray[Any] | np.void
    ) -> dict[str, npt.NDArray[np.float64]]:
        """Return what sensors measured, one record or one a lane, as an observation of copies."""
        return {name: np.array(observed[name]) for name in self.channels}
