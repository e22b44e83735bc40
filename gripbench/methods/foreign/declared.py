"""What methods in other languages have in common: a declaration in Python beside a file of theirs.

The class says what the method reads and estimates and which file it is; settings and variants work
as for compiled methods.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from gripbench.envs.vehicles import require
from gripbench.errors import unknown
from gripbench.methods.outputs import fields_of
from gripbench.methods.settings import Parameter, Setting, Variant, checked_settings


class ForeignMethod:
    """Base of the methods that are a class in Python around something that is not.

    Parameters
    ----------
    variant
        Name of one of `variants`.
    **overrides
        Values of single parameters.

    Attributes
    ----------
    name, title, reference, sensors, estimates, variances, quantiles, innovations, \
    vehicle_parameters, parameters, variants
        As of a `CompiledMethod`.
    """

    name: ClassVar[str]
    sensors: ClassVar[tuple[str, ...]]
    estimates: ClassVar[tuple[str, ...]]
    variances: ClassVar[tuple[str, ...]] = ()
    quantiles: ClassVar[Mapping[str, tuple[float, ...]]] = {}
    innovations: ClassVar[tuple[str, ...]] = ()
    vehicle_parameters: ClassVar[tuple[str, ...]] = ()
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    variants: ClassVar[Mapping[str, Any]] = {}

    def __init__(self, variant: str = "", **overrides: Setting) -> None:
        given = self.variants.get(variant, {})
        if variant and variant not in self.variants:
            raise unknown(f"variant of {self.name}", variant, self.variants)
        settings = given.settings if isinstance(given, Variant) else given
        self.settings = checked_settings(self.name, self.parameters, settings, overrides)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of what it writes: estimates, variances, quantiles, innovations."""
        return fields_of(self.estimates, self.variances, self.quantiles, self.innovations)

    def place(self, file: str) -> Path:
        """Return the path of a file that is named relative to the method's own."""
        own = getattr(sys.modules.get(type(self).__module__), "__file__", None)
        return (Path(own).resolve().parent if own else Path.cwd()) / file

    def numbers(self) -> dict[str, float]:
        """Return the values of its parameters as numbers."""
        return {item.name: item.number(self.settings[item.name]) for item in self.parameters}

    def paper(self, vehicle: Mapping[str, float]) -> dict[str, float]:
        """Return the vehicle parameters that it declares.

        Raises
        ------
        InputError
            If the vehicle does not give one.
        """
        return require(dict(vehicle), self.vehicle_parameters, self.name)
