"""A simulated run in, the slopes of its plant along it out: what a bound linearises about."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from gripbench.envs.vehicles import CarOnRoad

Floats = npt.NDArray[np.float64]

ROAD = ("friction_along", "friction", "friction_right", "grade", "bank",
        *(f"friction_step_{number}" for number in range(1, 5)))  # fmt: skip
"""What of a road may be moved: its friction by the logarithm, the same by the deviation of a cause
(of log-odds), an inclination [rad]."""


@dataclass(frozen=True)
class Shift:
    """What is moved off the run; by default nothing.

    Attributes
    ----------
    state, given
        Index of a state or of a held input and by how much it moves at each sample.
    road
        One of `ROAD` and by how much.
    car
        Another car in place of the one that drove.
    """

    state: tuple[int, Floats] | None = None
    given: tuple[int, Floats] | None = None
    road: tuple[str, float] | None = None
    car: CarOnRoad | None = None


class Trajectory(ABC):
    """A run at samples of its own: state, held inputs, and what follows from them.

    Attributes
    ----------
    states
        Names of the states.
    given
        Names of the held inputs: what the driver does.
    truth_type
        Structured type of a sample of the truth.
    time
        Times of the samples [s], shape (n,), evenly spaced.
    state
        States along the run, shape (n, states).
    inputs
        Held inputs along the run, shape (n, inputs).
    jumps
        Process noise: standard deviation of each state's jump after each step of the plant,
        shape (n, states).
    plant_step
        Step of the plant [s].
    """

    states: ClassVar[tuple[str, ...]]
    given: ClassVar[tuple[str, ...]]
    truth_type: ClassVar[np.dtype[Any]]
    time: Floats
    state: Floats
    inputs: Floats
    jumps: Floats
    plant_step: float

    @abstractmethod
    def evaluate(self, shift: Shift) -> Floats:
        """Return the states' rates and the truth at every sample.

        Shape (n, states + fields of `truth_type`).
        """

    @abstractmethod
    def start(self, car: CarOnRoad | None = None) -> Floats:
        """Return the state in which a car starts the run, shape (states,)."""

    def slope(self, ahead: Shift, behind: Shift, size: Floats | float) -> Floats:
        """Return the central difference of `evaluate` between two shifts that lie 2 `size` apart.

        The right-hand side is smooth over such steps however stiff it is: nothing is integrated.
        """
        width = 2.0 * np.asarray(size, float).reshape(-1, 1)
        return np.asarray((self.evaluate(ahead) - self.evaluate(behind)) / width)

    def state_slope(self, index: int, share: float) -> Floats:
        """Return the slope to a state; it is moved by `share` of its size, of 1 at least."""
        size = share * np.maximum(np.abs(self.state[:, index]), 1.0)
        return self.slope(Shift(state=(index, size)), Shift(state=(index, -size)), size)

    def input_slope(self, index: int, share: float) -> Floats:
        """Return the slope to a held input; moved as in `state_slope`."""
        size = share * np.maximum(np.abs(self.inputs[:, index]), 1.0)
        return self.slope(Shift(given=(index, size)), Shift(given=(index, -size)), size)

    def road_slope(self, name: str, size: float) -> Floats:
        """Return the slope to one of `ROAD`, which is moved by `size`."""
        return self.slope(Shift(road=(name, size)), Shift(road=(name, -size)), size)


def moved(values: Floats, shift: tuple[int, Floats] | None) -> Floats:
    """Return values, shape (n, m), with one column moved."""
    if shift is None:
        return values
    changed = values.copy()
    changed[:, shift[0]] += shift[1]
    return changed
