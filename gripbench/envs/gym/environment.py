"""The Gymnasium environment of every scenario.

An observation is a dict of what the scenario's sensors give, `time` included; the truth is in
`info["truth"]` only. An action holds the plant's inputs (axle torques, or steering and torques)
for one sample time; each is given as a share, -1 to 1, of a power of two in its unit
(`action_scale`), so that scaling loses no bit. The reward is minus half of the mean distance
between the action and that of the scenario's own driver: 0 for the driver itself, at least -1. An
episode is truncated at the scenario's horizon and terminated where the simulation ends a run by
name (`info["termination"]`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from gripbench.envs.instruments.sensors import SensorSuite
from gripbench.envs.plants.simulation import Action
from gripbench.envs.signals import NEW, signal
from gripbench.envs.worlds import load_scenario, simulation_of
from gripbench.errors import InputError

Observation = dict[str, npt.NDArray[np.float64]]

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


@dataclass(frozen=True)
class ActionMap:
    """How actions, -1 to 1, become the plant's inputs in their units."""

    scale: npt.NDArray[np.float64]
    low: npt.NDArray[np.float64]
    high: npt.NDArray[np.float64]

    @classmethod
    def of(cls, actions: tuple[Action, ...]) -> ActionMap:
        """Return the map of a plant's inputs."""
        low = np.array([action.low for action in actions])
        high = np.array([action.high for action in actions])
        largest = np.maximum(np.abs(low), np.abs(high))
        return cls(np.exp2(np.ceil(np.log2(largest))), low, high)

    @property
    def space(self) -> spaces.Box:
        """The space of one action."""
        return spaces.Box(-1.0, 1.0, self.scale.shape, np.float64)

    def inputs(self, action: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return the plant's inputs within their range, shape (..., inputs)."""
        given = np.asarray(action, np.float64)
        if given.shape[-1:] != self.scale.shape:
            raise InputError(f"the action's shape is {given.shape}; its last is {self.scale.size}")
        if not np.isfinite(given).all():
            raise InputError(f"the action {action} is not finite")
        return np.clip(given * self.scale, self.low, self.high)

    def action(self, inputs: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return the action that gives the inputs, shape (..., inputs)."""
        return inputs / self.scale

    def reward(
        self, inputs: npt.NDArray[np.float64], driver: npt.NDArray[np.float64]
    ) -> npt.NDArray[np.float64]:
        """Return minus half of the mean distance from the driver's inputs, shape (...)."""
        return -0.5 * np.mean(np.abs(inputs - driver) / self.scale, axis=-1)


class VehicleEnvironment(gymnasium.Env[Observation, npt.NDArray[np.float64]]):
    """One vehicle in one scenario.

    Parameters
    ----------
    scenario
        Name of a scenario that ships, or path of its TOML file.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self, scenario: str) -> None:
        self.scenario = load_scenario(scenario)
        self.simulation = simulation_of(self.scenario)
        self._sensors = self.scenario.all_sensors()
        suite = self._suite(0)
        self._channels = suite.observation_type.names or ()
        self.observation_space: spaces.Space[Any] = observation_space(self._channels)
        self.action_map = ActionMap.of(self.simulation.actions)
        self.action_space: spaces.Space[Any] = self.action_map.space
        self._steps = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a run; without a seed, one is drawn from the environment's own stream."""
        super().reset(seed=seed)
        run = seed if seed is not None else int(self.np_random.integers(2**31))
        self._steps = 0
        self._measuring = self._suite(run)
        return self._sample(self.simulation.reset(run))

    def step(
        self, action: npt.NDArray[np.float64]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold the plant's inputs for one sample time.

        Parameters
        ----------
        action
            Shape (inputs,), each -1 to 1, clipped to the inputs' ranges.
        """
        inputs = self.action_map.inputs(action)
        reward = float(self.action_map.reward(inputs, self.simulation.drive()))
        observation, info = self._sample(self.simulation.advance(inputs))
        self._steps += 1
        ended = bool(self.simulation.termination)
        return observation, reward, ended, self._steps >= self.scenario.steps and not ended, info

    def driver_action(self) -> npt.NDArray[np.float64]:
        """Return the action of the scenario's own driver, shape (inputs,)."""
        return self.action_map.action(self.simulation.drive())

    def _suite(self, seed: int) -> SensorSuite:
        simulation = self.simulation
        return SensorSuite(self._sensors, simulation.truth_type, simulation.sample_time, seed)

    def _sample(self, truth: npt.NDArray[Any]) -> tuple[Observation, dict[str, Any]]:
        observed = self._measuring.observe(truth)[0]
        observation = {name: np.array(observed[name]) for name in self._channels}
        names = truth.dtype.names or ()
        info = {
            "truth": dict(zip(names, truth[0].item(), strict=True)),
            "termination": self.simulation.termination,
        }
        return observation, info
