"""Several runs of a longitudinal scenario, advanced in one compiled call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.compilation import compiled
from gripbench.envs.plants.longitudinal.plant import INPUT_TYPE, TYRE_TYPE
from gripbench.envs.plants.longitudinal.sampling import TRUTH_TYPE, advance_one, command, decide
from gripbench.envs.plants.longitudinal.world import NOISE_BLOCK, LongitudinalSimulation
from gripbench.envs.plants.simulation import Lanes, Simulation


class LongitudinalLanes(Lanes):
    """Several runs of a longitudinal scenario, advanced in one compiled call.

    Each lane has its own vehicle and profiles; sample time and integrator are those of all.
    """

    def __init__(self, simulations: Sequence[LongitudinalSimulation]) -> None:
        super().__init__(simulations)
        self._runs = list(simulations)
        count = len(simulations)
        self._x = np.zeros((count, 3))
        self._steps = np.zeros(count)
        self._k = np.zeros(count, np.int64)
        self._jumps = np.zeros((count, NOISE_BLOCK, 2))
        self._tyres = np.zeros(count, TYRE_TYPE)
        self._inputs = np.zeros(count, INPUT_TYPE)
        self._ended = [""] * count
        self._stack()

    @property
    def terminations(self) -> list[str]:
        """Why each lane has ended; empty while it goes on."""
        return list(self._ended)

    def replace(self, lane: int, simulation: Simulation) -> None:
        """Put another simulation into a lane; it has the same sample time and is reset next."""
        assert isinstance(simulation, LongitudinalSimulation)
        super().replace(lane, simulation)
        self._runs[lane] = simulation
        self._stack()

    def reset(self, lane: int, seed: int) -> npt.NDArray[Any]:
        """Start a lane; return its first sample."""
        run = self._runs[lane]
        truth = run.reset(seed)
        self._x[lane], self._steps[lane], self._k[lane] = run._x, run._step, 0
        self._tyres[lane] = run._tyres[0]
        self._inputs[lane] = run._inputs[0]
        self._lay_roads()
        self._ended[lane] = ""
        return truth

    def drive(self) -> npt.NDArray[np.float64]:
        """Return the torques of the scenario's profiles in each lane."""
        front, rear, _ = self._profiles
        torques = np.empty((len(self._runs), 2))
        _drive_lanes(
            self._k, self._runs[0].scenario.sample_time, self._x, front, rear, self._slip_limits,
            self._plants, torques,
        )  # fmt: skip
        return torques

    def advance(
        self, actions: npt.NDArray[np.float64], going: npt.NDArray[np.bool_]
    ) -> npt.NDArray[Any]:
        """Hold the axle torques of each lane that is going for one sample time."""
        first = self._runs[0]
        lanes = np.flatnonzero(going)
        for lane in map(int, lanes[self._k[lanes] % NOISE_BLOCK == 0]):
            self._jumps[lane] = self._runs[lane]._draw(NOISE_BLOCK)
        truth = np.zeros(len(self._runs), TRUTH_TYPE)
        _advance_lanes(
            lanes,
            self._k,
            first.scenario.sample_time,
            self._x,
            self._steps,
            actions,
            self._inputs,
            self._plants,
            first._integrator,
            self._profiles[2],
            self._grades,
            self._roads,
            self._jumps,
            self._tyres,
            first._work,
            truth,
        )
        self._k[lanes] += 1
        for lane in map(int, lanes[~np.isfinite(self._x[lanes]).all(axis=1)]):
            self._ended[lane] = "diverged"
        return truth

    def _stack(self) -> None:
        """Lay the vehicles, grades and profiles of the lanes side by side.

        Profiles of fewer pieces are filled with pieces of no length, which add nothing.
        """
        self._plants = np.concatenate([run._plant for run in self._runs])
        self._grades = np.array([run.scenario.road_grade for run in self._runs])
        self._slip_limits = np.array([run.scenario.driver.slip_limit for run in self._runs])
        self._lay_roads()
        stacked = []
        for part in range(3):
            pieces = [run._profiles[part] for run in self._runs]
            table = np.zeros((len(pieces), max(map(len, pieces))), pieces[0].dtype)
            for lane, given in enumerate(pieces):
                table[lane, : len(given)] = given
            stacked.append(table)
        self._profiles = tuple(stacked)

    def _lay_roads(self) -> None:
        """Lay the roads of the lanes side by side; behind its end a road stays as it is."""
        roads = [run._road for run in self._runs]
        longest = max(map(len, roads))
        self._roads = np.stack(
            [np.pad(road, ((0, longest - len(road)), (0, 0)), mode="edge") for road in roads]
        )


@compiled
def _drive_lanes(k, sample_time, x, front, rear, slip_limits, plants, torques):
    for lane in range(k.shape[0]):
        decide(
            k[lane], sample_time, x[lane], front[lane], rear[lane], slip_limits[lane],
            plants[lane], torques[lane],
        )  # fmt: skip


@compiled
def _advance_lanes(
    lanes,
    k,
    sample_time,
    x,
    steps,
    actions,
    inputs,
    plants,
    integrator,
    friction,
    grades,
    roads,
    jumps,
    tyres,
    work,
    truth,
):
    for lane in lanes:
        now = inputs[lane]
        command(k[lane], sample_time, friction[lane], grades[lane], roads[lane], plants[lane], now)
        now.torque_front = actions[lane, 0]
        now.torque_rear = actions[lane, 1]
        steps[lane] = advance_one(
            k[lane],
            sample_time,
            x[lane],
            steps[lane],
            now,
            plants[lane],
            integrator,
            jumps[lane, k[lane] % jumps.shape[1]],
            tyres[lane],
            work,
            truth[lane],
        )
