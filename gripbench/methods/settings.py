"""A method's settings: typed parameters, and variants that change settings, sensors and step."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gripbench.errors import InputError, nearest

Setting = float | bool | str
"""Value of a parameter: a number, a yes or no, or one of its choices."""


@dataclass(frozen=True)
class Parameter:
    """A tuning parameter of a method; its default says of which type it is.

    Attributes
    ----------
    name
        Name; the step reads `params.<name>`, always a float64.
    default
        A float for a number, an int for a whole number, a bool for a switch (1.0 or 0.0 in the
        step), one of `choices` for a choice (its index in the step).
    unit
        SI unit, `-` where there is none.
    description
        What it is.
    low, high
        Allowed range of a number, which is also the range that a search may look in.
    choices
        Names that a choice may take.
    """

    name: str
    default: Setting
    unit: str
    description: str
    low: float = -np.inf
    high: float = np.inf
    choices: tuple[str, ...] = ()

    @property
    def is_switch(self) -> bool:
        """Whether it is a yes or no."""
        return isinstance(self.default, bool)

    @property
    def is_integer(self) -> bool:
        """Whether it is a whole number."""
        return isinstance(self.default, int) and not self.is_switch

    def checked(self, value: Any, method: str) -> Setting:
        """Return a value in the parameter's type.

        Raises
        ------
        InputError
            If the value is of another type or out of range.
        """
        name = f"{method}: parameter '{self.name}' is {value!r}"
        number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
        if self.choices:
            if number and value in range(len(self.choices)):
                return self.choices[int(value)]
            if value not in self.choices:
                raise InputError(f"{name}; allowed is one of {', '.join(self.choices)}")
            return str(value)
        if self.is_switch:
            if not isinstance(value, bool | np.bool_) and not (number and value in (0, 1)):
                raise InputError(f"{name}; it is a switch: allowed is 0 (no) or 1 (yes)")
            return bool(value)
        if not (number and self.low <= value <= self.high):
            if not number and np.isinf([self.low, self.high]).all():
                raise InputError(f"{name}; give a number")
            raise InputError(f"{name}; allowed is {self.low:g} to {self.high:g} {self.unit}")
        if self.is_integer:
            if value != int(value):
                raise InputError(f"{name}; it is a whole number")
            return int(value)
        return float(value)

    def number(self, value: Setting) -> float:
        """Return a checked value as the step sees it."""
        if self.choices:
            return float(self.choices.index(str(value)))
        return float(value)


@dataclass(frozen=True)
class Variant:
    """A named form of a method: whatever differs from the method itself.

    Attributes
    ----------
    settings
        Values of parameters.
    sensors
        Channels that it reads instead of the method's.
    step
        Its step instead of the method's.
    vehicle_parameters
        Vehicle parameters that it reads instead of the method's.
    functions
        By function of the method: what its step calls instead, at any depth.
    unread
        Which vehicle parameters it does not read under its settings, instead of the method's
        `unread`.
    """

    settings: Mapping[str, Setting] = field(default_factory=dict)
    sensors: tuple[str, ...] | None = None
    step: Callable[..., Any] | None = None
    vehicle_parameters: tuple[str, ...] | None = None
    functions: Mapping[Callable[..., Any], Callable[..., Any]] = field(default_factory=dict)
    unread: Callable[[Mapping[str, Setting]], Collection[str]] | None = None


class Variants(Mapping[str, Variant]):
    """The variants of a method by name: its own, then the forms that its paper prints.

    Parameters
    ----------
    name
        Name of the method.
    own
        Its variants, each a `Variant` or only its settings.
    printed
        Module whose `FORMS` hold the printed ones by method; it imports the method, so it is read
        when a variant is first looked for. Empty: none.
    """

    def __init__(self, name: str, own: Mapping[str, Any], printed: str) -> None:
        self._name, self._printed = name, printed
        self._known = {
            key: given if isinstance(given, Variant) else Variant(given)
            for key, given in own.items()
        }

    def __getitem__(self, name: str) -> Variant:
        return self._all()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())

    def _all(self) -> dict[str, Variant]:
        if self._printed:
            forms = importlib.import_module(self._printed).FORMS[self._name]
            self._known, self._printed = forms | self._known, ""
        return self._known


def scaled(parameters: tuple[Parameter, ...], factors: Mapping[str, float]) -> dict[str, Setting]:
    """Return settings: the defaults of some parameters times factors.

    A Kalman filter whose noise and first covariance are all larger by one factor in variance has
    the same gains, hence the same estimates, and a covariance that is larger by it.
    """
    known = {parameter.name: parameter.default for parameter in parameters}
    return {name: factor * float(known[name]) for name, factor in factors.items()}


def checked_settings(
    method: str, parameters: tuple[Parameter, ...], *given: Mapping[str, Setting]
) -> dict[str, Setting]:
    """Return every parameter's value: the defaults, changed by `given` one after the other.

    Raises
    ------
    InputError
        If a name is no parameter's, or a value is not allowed.
    """
    known = {parameter.name: parameter for parameter in parameters}
    settings: dict[str, Setting] = {item.name: item.default for item in parameters}
    for changes in given:
        for key in changes:
            if key not in known:
                raise InputError(f"{method}: unknown parameter '{key}': {nearest(key, known)}")
        settings |= dict(changes)
    return {key: known[key].checked(value, method) for key, value in settings.items()}
