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

from gripbench.envs.gym.arguments import ArgumentError, NotResetError, action_rows, integer
from gripbench.envs.gym.episodes import Episodes, observation_space
from gripbench.envs.gym.rendering import RENDER_MODES, TopView, checked_mode
from gripbench.envs.plants.simulation import Action, Simulation

Observation = dict[str, npt.NDArray[np.float64]]


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
        if not np.isfinite(action).all():
            raise ArgumentError(f"the action {action} is not finite")
        return np.clip(action * self.scale, self.low, self.high)

    def action(self, inputs: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return the action that gives the inputs, shape (..., inputs)."""
        return inputs / self.scale

    def reward(
        self, inputs: npt.NDArray[np.float64], driver: npt.NDArray[np.float64]
    ) -> npt.NDArray[np.float64]:
        """Return minus half of the mean distance from the driver's inputs, shape (...)."""
        return -0.5 * np.mean(np.abs(inputs - driver) / self.scale, axis=-1)


def seeded(seed: Any) -> int | None:
    """Return the seed of one environment as Gymnasium wants it."""
    return None if seed is None else integer(seed, "seed", 0)


class VehicleEnvironment(gymnasium.Env[Observation, npt.NDArray[np.float64]]):
    """One vehicle in one scenario.

    Parameters
    ----------
    scenario
        Name of a scenario that ships, or path of its TOML file.
    render_mode
        `rgb_array`, `human` or None, see `gripbench.envs.gym.rendering`.
    idealised
        Whether observations also hold the scenario's channels that no sensor in a vehicle gives.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 100}

    def __init__(
        self, scenario: str, render_mode: str | None = None, idealised: bool = False
    ) -> None:
        self._episodes = Episodes(scenario, idealised)
        self.scenario = self._episodes.scenario
        self.vehicle = self._episodes.vehicle
        self.simulation: Simulation = self._episodes.simulation()
        self._own_simulation = self.simulation
        self.observation_space: spaces.Space[Any] = observation_space(self._episodes.channels)
        self.action_map = ActionMap.of(self.simulation.actions)
        self.action_space: spaces.Space[Any] = self.action_map.space
        self.render_mode = checked_mode(render_mode)
        self.metadata = {**type(self).metadata, "render_fps": 1.0 / self.scenario.sample_time}
        self._view = TopView(self.scenario, self.render_mode) if self.render_mode else None
        self._steps = 0
        self._going = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode; without a seed, one is drawn from the environment's own stream.

        Parameters
        ----------
        seed
            Seed of all randomness of the episode, and of the stream for later ones.
        options
            What this episode changes of the scenario, see `gripbench.envs.gym.arguments.OPTIONS`.
        """
        seed = seeded(seed)
        changed = self._episodes.changed(options) is not self._episodes.scenario
        super().reset(seed=seed)
        run = seed if seed is not None else int(self.np_random.integers(2**31))
        self.simulation = self._episodes.simulation(options) if changed else self._own_simulation
        self._steps = 0
        self._going = True
        self._measuring = self._episodes.suite(self.simulation, run)
        self._faults = self._episodes.faults(self.simulation, run)
        truth = self.simulation.reset(run)
        if self._view is not None:
            self._view.begin(truth[0], self.simulation.path())
        return self._sample(truth)

    def step(
        self, action: npt.NDArray[np.float64]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold the plant's inputs for one sample time.

        Parameters
        ----------
        action
            Shape (inputs,), each -1 to 1, clipped to the inputs' ranges.
        """
        if not self._going:
            started = self._steps > 0
            raise NotResetError(
                "the episode has ended: call reset" if started else "call reset before step"
            )
        inputs = self.action_map.inputs(action_rows(action, self.action_map.scale.shape))
        reward = float(self.action_map.reward(inputs, self.simulation.drive()))
        truth = self.simulation.advance(inputs)
        self._steps += 1
        ended = bool(self.simulation.termination)
        truncated = self._steps >= self.scenario.steps and not ended
        self._going = not (ended or truncated)
        if self._view is not None and self.simulation.termination != "diverged":
            self._view.follow(truth[0], self.simulation.termination)
        observation, info = self._sample(truth)
        return observation, reward, ended, truncated, info

    def render(self) -> Any:
        """Return a frame, shape (height, width, 3), in `rgb_array`; None in other modes."""
        return None if self._view is None else self._view.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._view is not None:
            self._view.close()

    def driver_action(self) -> npt.NDArray[np.float64]:
        """Return the action of the scenario's own driver, shape (inputs,)."""
        if not self._going:
            raise NotResetError("call reset before driver_action")
        return self.action_map.action(self.simulation.drive())

    def _sample(self, truth: npt.NDArray[Any]) -> tuple[Observation, dict[str, Any]]:
        observed = self._measuring.observe(truth)
        if self._faults is not None:
            self._faults.apply(observed)
        observation = self._episodes.observation(observed[0])
        info = {
            "truth": dict(zip(truth.dtype.names or (), truth[0].item(), strict=True)),
            "termination": self.simulation.termination,
        }
        return observation, info
