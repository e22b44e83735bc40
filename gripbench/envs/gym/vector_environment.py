"""The native vector environment: lanes of one scenario, stepped together.

All lanes advance in one compiled call and are measured in one compiled call, so that a step costs
little more than the plants themselves. Each lane gives the bytes of a single environment with its
seed. A lane that has ended is reset by the next step, whose action it ignores
(`AutoresetMode.NEXT_STEP`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from gripbench.envs.gym.environment import ActionMap, observation_space
from gripbench.envs.instruments.sensors import SensorLanes, SensorSuite
from gripbench.envs.worlds import load_scenario, simulation_of

Observations = dict[str, npt.NDArray[np.float64]]


class VehicleVectorEnvironment(VectorEnv[Observations, npt.NDArray[np.float64], npt.NDArray[Any]]):
    """Several vehicles in one scenario, each with its own seed.

    Parameters
    ----------
    num_envs
        Number of lanes.
    scenario
        Name of a scenario that ships, or path of its TOML file.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, num_envs: int, scenario: str) -> None:
        self.num_envs = num_envs
        self.scenario = load_scenario(scenario)
        runs = [simulation_of(self.scenario) for _ in range(num_envs)]
        one = runs[0]
        self._lanes = one.together(runs)
        self._truth_type, self._sample_time = one.truth_type, one.sample_time
        self._sensors = self.scenario.all_sensors()
        self._channels = self._suite(0).observation_type.names or ()
        self.single_observation_space = observation_space(self._channels)
        self.action_map = ActionMap.of(one.actions)
        self.single_action_space = self.action_map.space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._steps = np.zeros(num_envs, np.int64)
        self._ended = np.zeros(num_envs, bool)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start every lane; from a single seed the lanes take seed, seed + 1, ..."""
        single = seed if isinstance(seed, int) else None
        super().reset(seed=single)
        given = seed if isinstance(seed, list) else [None] * self.num_envs
        runs = [
            single + lane if single is not None else self._draw() if one is None else one
            for lane, one in enumerate(given)
        ]
        self._measuring = SensorLanes([self._suite(run) for run in runs])
        truth = np.concatenate([self._lanes.reset(lane, run) for lane, run in enumerate(runs)])
        self._steps[:] = 0
        self._ended[:] = False
        return self._observations(truth), self._info(truth)

    def step(
        self, actions: npt.NDArray[np.float64]
    ) -> tuple[Observations, npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any], dict[str, Any]]:
        """Hold the inputs of every lane for one sample time.

        Parameters
        ----------
        actions
            Shape (num_envs, inputs), each -1 to 1, clipped to the inputs' ranges.
        """
        inputs = self.action_map.inputs(actions)
        reward = self.action_map.reward(inputs, self._lanes.drive())
        begun = np.flatnonzero(self._ended)
        truth = self._lanes.advance(inputs)
        self._steps += 1
        for lane in begun:
            run = self._draw()
            truth[lane] = self._lanes.reset(int(lane), run)[0]
            self._measuring.replace(int(lane), self._suite(run))
            self._steps[lane] = 0
            reward[lane] = 0.0
        terminated = np.array([bool(reason) for reason in self._lanes.terminations])
        truncated = (self._steps >= self.scenario.steps) & ~terminated
        self._ended = terminated | truncated
        return self._observations(truth), reward, terminated, truncated, self._info(truth)

    def driver_actions(self) -> npt.NDArray[np.float64]:
        """Return the actions of the scenario's own driver, shape (num_envs, inputs)."""
        return self.action_map.action(self._lanes.drive())

    def _draw(self) -> int:
        return int(self.np_random.integers(2**31))

    def _suite(self, seed: int) -> SensorSuite:
        return SensorSuite(self._sensors, self._truth_type, self._sample_time, seed)

    def _observations(self, truth: npt.NDArray[Any]) -> Observations:
        observed = self._measuring.observe(truth)
        return {name: np.array(observed[name]) for name in self._channels}

    def _info(self, truth: npt.NDArray[Any]) -> dict[str, Any]:
        names = truth.dtype.names or ()
        return {
            "truth": {name: np.array(truth[name]) for name in names},
            "termination": np.array(self._lanes.terminations),
        }
