"""What a user hands to an environment, checked: seeds, options, actions, numbers of lanes.

Every mistake becomes one line. The errors are Gymnasium's own or Python's as well, so that code
written for other environments catches them.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt

from gripbench.configuration import parse
from gripbench.envs.plants.driven import DrivenScenario
from gripbench.envs.plants.longitudinal.scenario import LongitudinalScenario
from gripbench.envs.plants.planar.world import PlanarScenario
from gripbench.envs.scenarios import Scenario
from gripbench.errors import InputError, nearest

RESET_MASK = "reset_mask"
"""Option of a vector environment: which lanes a reset starts, shape (num_envs,), bool."""

OPTIONS = {
    "mu": "friction coefficient of the whole road, 0.01 to 2",
    "speed": "speed at the start, and that the driver holds [m/s], 0 to 100",
}
"""What `reset(options=...)` can change for one episode."""

_RANGES = {"mu": (0.01, 2.0), "speed": (0.0, 100.0)}


class ArgumentError(InputError, ValueError):
    """An argument that an environment cannot take."""


class NotResetError(InputError, gymnasium.error.ResetNeeded):
    """A step, or a reset of some lanes, where a whole reset must come first."""


def integer(value: Any, what: str, least: int) -> int:
    """Return a Python integer; NumPy's integers count, truth values and floats do not.

    Raises
    ------
    ArgumentError
        If the value is no integer, or below `least`.
    """
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if not isinstance(value, bool | np.bool_):
        try:
            number = operator.index(value)
        except TypeError:
            pass
        else:
            if number >= least:
                return number
    raise ArgumentError(f"{what} is {value!r}: it must be an integer, {least} or more")


def lane_seeds(seed: Any, lanes: int) -> list[int | None]:
    """Return the seed of every lane, None where it is to be drawn.

    Parameters
    ----------
    seed
        None; an integer, from which the lanes take seed, seed + 1, ...; or one seed a lane, in a
        list, a tuple or an array.
    lanes
        Number of lanes.

    Raises
    ------
    ArgumentError
        If it is anything else, or the number of seeds is not that of the lanes.
    """
    if seed is None:
        return [None] * lanes
    rows = isinstance(seed, np.ndarray) and seed.ndim == 1
    if not rows and (isinstance(seed, str | bytes) or not isinstance(seed, Sequence)):
        first = integer(seed, "seed", 0)
        return [first + lane for lane in range(lanes)]
    given = list(seed)
    if len(given) != lanes:
        raise ArgumentError(f"seed holds {len(given)} seeds for {lanes} lanes: give one a lane")
    return [
        None if one is None else integer(one, f"seed[{lane}]", 0) for lane, one in enumerate(given)
    ]


def split_options(options: Any, lanes: int) -> tuple[npt.NDArray[np.bool_], dict[str, Any]]:
    """Return which lanes a reset starts, and the other options.

    Raises
    ------
    ArgumentError
        If the mask is not a NumPy array of truth values, one a lane, with one of them true.
    """
    others = dict(_mapping(options))
    mask = others.pop(RESET_MASK, None)
    if mask is None:
        return np.ones(lanes, bool), others
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (lanes,):
        raise ArgumentError(
            f"options[{RESET_MASK!r}] is {mask!r}: it must be a NumPy array of truth values, "
            f"shape ({lanes},)"
        )
    if not mask.any():
        raise ArgumentError(f"options[{RESET_MASK!r}] names no lane: one at least must be true")
    return mask.copy(), others


def scenario_with(scenario: Scenario, options: Any) -> Scenario:
    """Return the scenario with what an episode's options change of it.

    Parameters
    ----------
    scenario
        The scenario of the environment.
    options
        None, or numbers by the names of `OPTIONS`.

    Raises
    ------
    ArgumentError
        If an option is unknown, no number, out of range or without meaning in this world.
    """
    changes: dict[str, Any] = {}
    for name, value in _mapping(options).items():
        number = _option(name, value)
        if name == "speed" and isinstance(scenario, LongitudinalScenario):
            changes["initial_speed"] = number
        elif name == "speed" and isinstance(scenario, DrivenScenario):
            changes["speed"] = number
        elif isinstance(scenario, LongitudinalScenario):
            ends = {"start": 0.0, "end": scenario.horizon}
            changes["friction"] = [{**ends, "first": number, "last": number}]
        elif isinstance(scenario, PlanarScenario):
            plain = {"mu": number, "mu_right": 0.0, "mu_after": 0.0, "mu_jump_at": 0.0}
            changes["road"] = {**scenario.road.model_dump(mode="json"), **plain}
        else:
            raise ArgumentError(
                f"options[{name!r}]: {scenario.name} has no friction limit, its tyres are linear"
            )
    if not changes:
        return scenario
    try:
        return parse(type(scenario), {**scenario.model_dump(mode="json"), **changes}, "options")
    except InputError as error:
        raise ArgumentError(str(error)) from None


def action_rows(actions: Any, shape: tuple[int, ...]) -> npt.NDArray[np.float64]:
    """Return actions as an array of exactly this shape; they may still be anything but numbers.

    Raises
    ------
    ArgumentError
        If they are no real numbers or have another shape: nothing is broadcast.
    """
    try:
        given = np.asarray(actions)
    except ValueError:
        given = np.empty(0, object)  # rows of different lengths
    if given.dtype.kind not in "fiu":
        raise ArgumentError(f"the action {actions!r} holds no real numbers of shape {shape}")
    if given.shape != shape:
        raise ArgumentError(f"the action's shape is {given.shape}; it must be {shape}")
    return given.astype(np.float64)


def _mapping(options: Any) -> Mapping[str, Any]:
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise ArgumentError(f"options are {options!r}: they must be a dict")
    return options


def _option(name: Any, value: Any) -> float:
    if name not in OPTIONS:
        raise ArgumentError(f"unknown option {name!r}: {nearest(str(name), OPTIONS)}")
    number = math.nan
    if isinstance(value, int | float | np.number) and not isinstance(value, bool | complex):
        number = float(value)
    low, high = _RANGES[name]
    if not low <= number <= high:
        raise ArgumentError(f"options[{name!r}] is {value!r}: allowed is {low:g} to {high:g}")
    return number
