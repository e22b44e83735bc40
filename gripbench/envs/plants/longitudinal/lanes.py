"""Several runs of a longitudinal scenario, advanced in one compiled call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.envs.drivers.profiles import profile_value
from gripbench.envs.plants.longitudinal.plant import TYRE_TYPE, compiled
from gripbench.envs.plants.longitudinal.world import (
    NOISE_BLOCK,
    TRUTH_TYPE,
    LongitudinalSimulation,
    advance_one,
    command,
)
from gripbench.envs.plants.simulation import Lanes


class LongitudinalLanes(Lanes):
    """Several runs of a longitudinal scenario, advanced in one compiled call."""

    def __init__(self, simulations: Sequence[LongitudinalSimulation]) -> None:
        super().__init__(simulations)
        self._runs = simulations
        count = len(simulations)
        self._x = np.zeros((count, 3))
        self._steps = np.zeros(count)
        self._k = np.zeros(count, np.int64)
        self._jumps = np.zeros((count, NOISE_BLOCK, 2))
        self._tyres = np.zeros(count, TYRE_TYPE)
        self._ended = [""] * count

    @property
    def terminations(self) -> list[str]:
        """Why each lane has ended; empty while it goes on."""
        return self._ended

    def reset(self, lane: int, seed: int) -> npt.NDArray[Any]:
        """Start a lane; return its first sample."""
        run = self._runs[lane]
        truth = run.reset(seed)
        self._x[lane], self._steps[lane], self._k[lane] = run._x, run._step, 0
        self._tyres[lane] = run._tyres[0]
        self._ended[lane] = ""
        return truth

    def drive(self) -> npt.NDArray[np.float64]:
        """Return the torques of the scenario's profiles in each lane."""
        front, rear, _ = self._runs[0]._profiles
        torques = np.empty((len(self._runs), 2))
        _drive_lanes(self._k, self._runs[0].scenario.sample_time, front, rear, torques)
        return torques

    def advance(self, actions: npt.NDArray[np.float64]) -> npt.NDArray[Any]:
        """Hold the axle torques of each lane for one sample time."""
        first = self._runs[0]
        for lane in map(int, np.flatnonzero(self._k % NOISE_BLOCK == 0)):
            self._jumps[lane] = self._runs[lane]._draw(NOISE_BLOCK)
        truth = np.zeros(len(self._runs), TRUTH_TYPE)
        _advance_lanes(
            self._k,
            first.scenario.sample_time,
            self._x,
            self._steps,
            actions,
            first._inputs,
            first._plant,
            first._integrator,
            first._profiles,
            first.scenario.road_grade,
            self._jumps,
            self._tyres,
            first._work,
            truth,
        )
        self._k += 1
        for lane in map(int, np.flatnonzero(~np.isfinite(self._x).all(axis=1))):
            self._ended[lane] = "diverged"
        return truth


@compiled
def _drive_lanes(k, sample_time, front, rear, torques):  # type: ignore[no-untyped-def]
    for lane in range(k.shape[0]):
        middle = (k[lane] + 0.5) * sample_time
        torques[lane, 0] = profile_value(middle, front)
        torques[lane, 1] = profile_value(middle, rear)


@compiled
def _advance_lanes(  # type: ignore[no-untyped-def]
    k,
    sample_time,
    x,
    steps,
    actions,
    inputs,
    plant,
    integrator,
    profiles,
    grade,
    jumps,
    tyres,
    work,
    truth,
):
    front, rear, friction = profiles
    for lane in range(x.shape[0]):
        command(k[lane], sample_time, front, rear, friction, grade, inputs[0])
        inputs[0].torque_front = actions[lane, 0]
        inputs[0].torque_rear = actions[lane, 1]
        steps[lane] = advance_one(
            k[lane],
            sample_time,
            x[lane],
            steps[lane],
            inputs[0],
            plant[0],
            integrator,
            jumps[lane, k[lane] % jumps.shape[1]],
            tyres[lane],
            work,
            truth[lane],
        )
