"""How a method was trained: what it declares of it, the record of it, seeds that no test may touch.

A trained method has `fit(recordings, budget)` and says by `trained_on` from where its training
drives are: the name of a population, or names of scenarios. A method that brings its weights in a
file says by `trained` how it came to them.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from gripbench.configuration import Configuration, parse
from gripbench.envs.signals import SIGNALS
from gripbench.errors import InputError, one_line, unknown
from gripbench.methods.settings import Parameter

TRAINING_SEEDS = range(1_000_000_000, 2_000_000_000)
"""Seeds of training drives; a method that was trained is never tested on one of them."""

TRAINING_LEVEL = 1
"""Level of the population that training drives are from."""


class Training(Configuration):
    """How a method was trained, as far as it is the same whenever it is trained.

    Attributes
    ----------
    how
        `fitted` by its own `fit`, `tuned` by a search over its settings, or `declared` by its
        author, who did it elsewhere.
    on
        Population, or scenarios, and level of the training drives.
    seeds
        First seed of the training drives, and the one behind the last.
    drives
        Number of training drives.
    budget
        Passes over them, or trials, that were allowed; None: nobody says.
    """

    how: Literal["fitted", "tuned", "declared"] = "declared"
    on: str
    seeds: tuple[int, int]
    drives: int = Field(ge=1)
    budget: int | None = Field(default=None, ge=1)

    @model_validator(mode="after")
    def _check_seeds(self) -> Self:
        first, last = self.seeds
        if not 0 <= first < last:
            raise ValueError(f"seeds {first} to {last}: give the first and the one behind the last")
        return self

    @property
    def text(self) -> str:
        """What a table says of it."""
        return f"{self.how}: {self.drives} drives of {self.on}"


class Declared(Training):
    """What an author says of a training elsewhere.

    Attributes
    ----------
    seconds
        How long it took [s].
    """

    seconds: float | None = Field(default=None, ge=0.0)


@dataclass(frozen=True)
class Trained:
    """A method's training and what came of it.

    Attributes
    ----------
    training
        The record of it.
    seconds
        How long it took [s]; None: nobody says.
    state
        What `fit` returned, see `gripbench.bench.catalogue.arrays`; empty: nothing is handed over.
    digest
        Digest of the state and of the record.
    """

    training: Training
    seconds: float | None = None
    state: bytes = field(default=b"", repr=False)
    digest: str = ""


def training_of(method: Any, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return what an estimator says of its training, and the ranges that a search may look in.

    Parameters
    ----------
    method
        An instance.
    parameters
        With which it was made.
    """
    return {
        "fits": callable(getattr(method, "fit", None)),
        "trained_on": getattr(method, "trained_on", ()),
        "training_truth": getattr(method, "training_truth", ()),
        "trained": getattr(method, "trained", None),
        "ranges": _ranges_of(method, parameters),
    }


def _ranges_of(method: Any, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return low end, value and high end of every parameter that a search may change.

    They are numbers with a finite range: of a plain class those in its `ranges`.
    """
    found: dict[str, Any] = {}
    given = getattr(method, "parameters", ())
    if isinstance(given, list | tuple) and all(isinstance(item, Parameter) for item in given):
        settings = {item.name: item.default for item in given} | dict(parameters)
        own_settings = getattr(method, "settings", {})
        settings |= own_settings if isinstance(own_settings, Mapping) else {}
        found = {item.name: (item.low, settings[item.name], item.high) for item in given}
        found = {name: ends for name, ends in found.items() if isinstance(ends[1], float)}
    own = getattr(method, "ranges", None)
    if isinstance(own, Mapping):
        known = inspect.signature(type(method)).parameters
        for name, ends in own.items():
            default = known[name].default if name in known else None
            low, high = ends if isinstance(ends, list | tuple) and len(ends) == 2 else (None, None)
            found[name] = (low, parameters.get(name, default), high)
    return found


def checked_training(given: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return the fields of a declaration that are about training, after checking each.

    Raises
    ------
    InputError
        If one is not of its type, or what goes together does not.
    """
    on = given.get("trained_on") or ()
    on = (on,) if isinstance(on, str) else on
    if not isinstance(on, list | tuple) or not all(isinstance(item, str) and item for item in on):
        raise InputError(
            f"{name}: set 'trained_on' to the name of a population, such as 'cornering', or a "
            f"tuple of scenarios (it is {one_line(repr(on), 120)})"
        )
    fits = given.get("fits") is True
    if fits and not on:
        raise InputError(
            f"{name}: has 'fit', so set 'trained_on' to the name of the population of its training "
            "drives, such as 'cornering'"
        )
    if on and not fits:
        raise InputError(f"{name}: has 'trained_on', so add the method 'fit(recordings, budget)'")
    truth = given.get("training_truth") or ()
    if not isinstance(truth, list | tuple) or not all(isinstance(item, str) for item in truth):
        raise InputError(f"{name}: set 'training_truth' to a tuple of signal names")
    for item in truth:
        if item not in SIGNALS:
            raise unknown(f"signal in 'training_truth' of {name}:", item, SIGNALS)
    trained = given.get("trained")
    if trained is not None:
        if not isinstance(trained, Mapping):
            raise InputError(f"{name}: set 'trained' to a dict with on, seeds, drives, seconds")
        if fits:
            raise InputError(f"{name}: has 'fit', so it says no 'trained'")
        trained = parse(Declared, dict(trained), f"{name}: 'trained'").model_dump(mode="json")
    return {
        "fits": fits,
        "trained_on": tuple(on),
        "training_truth": tuple(truth),
        "trained": trained,
        "ranges": _checked_ranges(given.get("ranges") or {}, name),
    }


def _checked_ranges(given: Mapping[str, Any], name: str) -> dict[str, tuple[float, float, float]]:
    """Return the ranges that have two different and finite ends."""
    for key, ends in given.items():
        if not all(isinstance(end, float | int) and not isinstance(end, bool) for end in ends):
            raise InputError(
                f"{name}: 'ranges' must give '{key}' two numbers, and its default must be a number"
            )
    return {
        key: (float(low), float(value), float(high))
        for key, (low, value, high) in given.items()
        if math.isfinite(low) and math.isfinite(high) and low < high
    }


def declared(said: Mapping[str, Any] | None) -> Trained | None:
    """Return what an author declared of a training elsewhere; None: nothing."""
    if said is None:
        return None
    content = {key: value for key, value in said.items() if key != "seconds"}
    return Trained(parse(Training, content, "trained"), said.get("seconds"))


def check_test_seeds(label: str, training: Training | None, tested: Iterable[int]) -> None:
    """Check that a trained method is not tested on seeds that it was, or may be, trained on.

    Parameters
    ----------
    label
        The method.
    training
        How it was trained; None: it is going to be.
    tested
        Seeds of a run.

    Raises
    ------
    InputError
        If it is.
    """
    used = [TRAINING_SEEDS, *([range(*training.seeds)] if training else [])]
    for seed in tested:
        for kept in used:
            if seed in kept:
                raise InputError(
                    f"{label}: is a trained method, and seed {seed} of this run is one of those "
                    f"for training, {kept.start}:{kept.stop}; choose other --seeds"
                )
