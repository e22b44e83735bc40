"""The native vector environment: lanes of one scenario, stepped together.

All lanes advance in one compiled call and are measured in one compiled call, so that a step costs
little more than the plants themselves. Observations, rewards, flags and infos are those of
`gymnasium.vector.SyncVectorEnv` over single environments, in every autoreset mode: each lane has
a stream of its own, so that later episodes, too, follow from the lane's seed alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from gripbench.envs.gym.arguments import (
    RESET_MASK,
    ArgumentError,
    NotResetError,
    action_rows,
    integer,
    lane_seeds,
    split_options,
)
from gripbench.envs.gym.environment import ActionMap
from gripbench.envs.gym.episodes import Episodes, observation_space
from gripbench.envs.gym.rendering import RENDER_MODES, TopView, checked_mode
from gripbench.envs.instruments.fault_injection import Faults
from gripbench.envs.instruments.suite import SensorLanes

Observations = dict[str, npt.NDArray[np.float64]]


class VehicleVectorEnvironment(VectorEnv[Observations, npt.NDArray[np.float64], npt.NDArray[Any]]):
    """Several vehicles in one scenario, each with its own seed.

    Parameters
    ----------
    num_envs
        Number of lanes.
    scenario
        Name of a scenario that ships, or path of its TOML file.
    max_episode_steps
        An episode is truncated after so many steps at the latest; None or -1: at the horizon.
    autoreset_mode
        When a lane that has ended starts again, see `gymnasium.vector.AutoresetMode`.
    render_mode
        `rgb_array`, `human` or None, see `gripbench.envs.gym.rendering`.
    idealised
        Whether observations also hold the scenario's channels that no sensor in a vehicle gives.
    """

    metadata: dict[str, Any] = {
        "autoreset_mode": AutoresetMode.NEXT_STEP,
        "render_modes": list(RENDER_MODES),
        "render_fps": 100,
    }

    def __init__(
        self,
        num_envs: int,
        scenario: str,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        idealised: bool = False,
    ) -> None:
        self.num_envs = integer(num_envs, "num_envs", 1)
        endless = max_episode_steps is None or max_episode_steps == -1
        self._limit = None if endless else integer(max_episode_steps, "max_episode_steps", 1)
        self._mode = _autoreset_mode(autoreset_mode)
        self._episodes = Episodes(scenario, idealised)
        self.scenario = self._episodes.scenario
        self.vehicle = self._episodes.vehicle
        self._own = [self._episodes.simulation() for _ in range(self.num_envs)]
        self._changed = np.zeros(self.num_envs, bool)
        one = self._own[0]
        self._lanes = one.together(self._own)
        self._measuring = SensorLanes([self._episodes.suite(run, 0) for run in self._own])
        self._truth_type = one.truth_type
        self.single_observation_space = observation_space(self._episodes.channels)
        self.action_map = ActionMap.of(one.actions)
        self.single_action_space = self.action_map.space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.render_mode = checked_mode(render_mode)
        self.metadata = {
            **type(self).metadata,
            "autoreset_mode": self._mode,
            "render_fps": 1.0 / self.scenario.sample_time,
        }
        self._views = [
            TopView(self.scenario, self.render_mode)
            for _ in range(self.num_envs if self.render_mode else 0)
        ]
        self._faults: list[Faults | None] = [None] * self.num_envs
        self._streams: list[np.random.Generator | None] = [None] * self.num_envs
        self._seeds = [-1] * self.num_envs
        self._observed = np.zeros(self.num_envs, self._measuring.observation_type)
        self._steps = np.zeros(self.num_envs, np.int64)
        self._ended = np.zeros(self.num_envs, bool)
        self._started = False

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The stream of each lane."""
        return tuple(self._stream(lane) for lane in range(self.num_envs))

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seed of each lane's stream."""
        for lane in range(self.num_envs):
            self._stream(lane)
        return tuple(self._seeds)

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start every lane, or those of a mask.

        Parameters
        ----------
        seed
            One integer, from which the lanes take seed, seed + 1, ...; or one a lane, None for a
            lane that goes on in its own stream.
        options
            `reset_mask`, shape (num_envs,), bool: the lanes to start; and what this episode
            changes of the scenario, see `gripbench.envs.gym.arguments.OPTIONS`.
        """
        given = lane_seeds(seed, self.num_envs)
        mask, others = split_options(options, self.num_envs)
        if not self._started and not mask.all():
            raise NotResetError(f"reset every lane before a reset with {RESET_MASK!r}")
        changed = self._episodes.changed(others) is not self._episodes.scenario
        lanes = np.flatnonzero(mask)
        truth = np.zeros(self.num_envs, self._truth_type)
        for lane in map(int, lanes):
            if given[lane] is not None:
                self._streams[lane], self._seeds[lane] = seeding.np_random(given[lane])
            simulation = self._episodes.simulation(others) if changed else None
            truth[lane] = self._begin(lane, given[lane], simulation)
        self._observe(truth, lanes)
        self._started = True
        return self._episodes.observation(self._observed), self._info(truth, mask)

    def step(
        self, actions: npt.NDArray[np.float64]
    ) -> tuple[Observations, npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any], dict[str, Any]]:
        """Hold the inputs of every lane for one sample time.

        Parameters
        ----------
        actions
            Shape (num_envs, inputs), each -1 to 1, clipped to the inputs' ranges. The action of a
            lane that starts again is ignored.
        """
        if not self._started:
            raise NotResetError("call reset before step")
        rows = action_rows(actions, (self.num_envs, self.action_map.scale.size))
        begun = np.flatnonzero(self._ended)
        if len(begun) and self._mode is AutoresetMode.DISABLED:
            raise NotResetError(
                f"lanes {begun.tolist()} have ended: reset them, options={{{RESET_MASK!r}: ...}}"
            )
        going = ~self._ended
        rows[begun] = 0.0
        inputs = self.action_map.inputs(rows)
        reward = self.action_map.reward(inputs, self._lanes.drive())
        reward[begun] = 0.0
        truth = self._lanes.advance(inputs, going)
        terminated = np.array([bool(reason) for reason in self._lanes.terminations]) & going
        self._steps[going] += 1
        truncated = (self._steps >= self.scenario.steps) & ~terminated & going
        if self._limit is not None:
            truncated |= (self._steps >= self._limit) & going
        self._follow(truth, np.flatnonzero(going))
        for lane in map(int, begun):
            truth[lane] = self._begin(lane, None, None)
        self._observe(truth, np.arange(self.num_envs))
        self._ended = terminated | truncated
        info: dict[str, Any] = {}
        if self._mode is AutoresetMode.SAME_STEP and self._ended.any():
            info = self._final(truth)
            begun = np.flatnonzero(self._ended)
            for lane in map(int, begun):
                truth[lane] = self._begin(lane, None, None)
            self._observe(truth, begun)
        info |= self._info(truth, np.ones(self.num_envs, bool))
        return (
            self._episodes.observation(self._observed), reward, terminated, truncated, info
        )  # fmt: skip

    def render(self) -> tuple[Any, ...] | None:
        """Return a frame of each lane, see `gripbench.envs.gym.rendering`."""
        return tuple(view.render() for view in self._views) if self._views else None

    def close_extras(self, **_: Any) -> None:
        """Close the windows, if there are some."""
        for view in self._views:
            view.close()

    def driver_actions(self) -> npt.NDArray[np.float64]:
        """Return the actions of the scenario's own driver, shape (num_envs, inputs)."""
        if not self._started:
            raise NotResetError("call reset before driver_actions")
        return self.action_map.action(self._lanes.drive())

    def _begin(self, lane: int, seed: int | None, simulation: Any) -> Any:
        """Start an episode in a lane, in another simulation or its own; return the first sample."""
        run = int(self._stream(lane).integers(2**31)) if seed is None else seed
        if simulation is not None or self._changed[lane]:
            self._lanes.replace(lane, simulation or self._own[lane])
            self._changed[lane] = simulation is not None
        first = self._lanes.reset(lane, run)[0]
        self._measuring.replace(lane, self._episodes.suite(self._own[lane], run))
        self._faults[lane] = self._episodes.faults(self._own[lane], run)
        self._steps[lane] = 0
        self._ended[lane] = False
        if self._views:
            self._views[lane].begin(first, self._lanes.path(lane))
        return first

    def _stream(self, lane: int) -> np.random.Generator:
        stream = self._streams[lane]
        if stream is None:
            stream, self._seeds[lane] = seeding.np_random()
            self._streams[lane] = stream
        return stream

    def _observe(self, truth: npt.NDArray[Any], lanes: npt.NDArray[np.intp]) -> None:
        observed = self._measuring.observe(truth, lanes)
        for lane in lanes:
            faults = self._faults[lane]
            if faults is not None:
                faults.apply(observed[lane : lane + 1])
        self._observed[lanes] = observed[lanes]

    def _follow(self, truth: npt.NDArray[Any], lanes: npt.NDArray[np.intp]) -> None:
        if self._views:
            reasons = self._lanes.terminations
            for lane in lanes:
                if reasons[lane] != "diverged":
                    self._views[lane].follow(truth[lane], reasons[lane])

    def _final(self, truth: npt.NDArray[Any]) -> dict[str, Any]:
        """Return what `info` says of the episodes that have just ended."""
        last = np.full(self.num_envs, None, object)
        for lane in np.flatnonzero(self._ended):
            last[lane] = self._episodes.observation(self._observed[lane])
        return {
            "final_obs": last,
            "_final_obs": self._ended.copy(),
            "final_info": self._info(truth, self._ended),
            "_final_info": self._ended.copy(),
        }

    def _info(self, truth: npt.NDArray[Any], mask: npt.NDArray[np.bool_]) -> dict[str, Any]:
        """Return the lanes' infos as Gymnasium stacks them: arrays, each with its mask."""
        values: dict[str, Any] = {}
        for name in truth.dtype.names or ():
            values[name] = np.where(mask, truth[name], 0.0)
            values["_" + name] = mask.copy()
        reasons = np.full(self.num_envs, None, object)
        ends = self._lanes.terminations
        for lane in np.flatnonzero(mask):
            reasons[lane] = ends[lane]
        return {
            "truth": values,
            "_truth": mask.copy(),
            "termination": reasons,
            "_termination": mask.copy(),
        }


def _autoreset_mode(given: str | AutoresetMode) -> AutoresetMode:
    try:
        return AutoresetMode(given)
    except ValueError:
        known = ", ".join(mode.value for mode in AutoresetMode)
        raise ArgumentError(f"autoreset_mode is {given!r}: known are {known}") from None
