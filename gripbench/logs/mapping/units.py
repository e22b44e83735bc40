"""The units that a channel map may name, and their conversion to the signal table's SI units.

An angle is a dimension of its own, so that degrees are not taken for a bare number; a length
"per radian" (the radius of a wheel) turns a circumferential speed into an angular one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from gripbench.errors import InputError, unknown

Dimension = tuple[int, int, int, int, int]
"""Exponents of kilogram, metre, second, ampere and radian."""


@dataclass(frozen=True)
class Unit:
    """One accepted unit: `SI value = factor * value`."""

    factor: float
    dimension: Dimension


def _unit(
    factor: float, kg: int = 0, m: int = 0, s: int = 0, ampere: int = 0, rad: int = 0
) -> Unit:
    return Unit(factor, (kg, m, s, ampere, rad))


STANDARD_GRAVITY = 9.80665
"""Acceleration [m/s^2] that the unit `g` stands for."""

_DEGREE = math.pi / 180.0

UNITS: dict[str, Unit] = {
    "-": _unit(1.0),
    "%": _unit(0.01),
    "s": _unit(1.0, s=1),
    "ms": _unit(1e-3, s=1),
    "us": _unit(1e-6, s=1),
    "ns": _unit(1e-9, s=1),
    "min": _unit(60.0, s=1),
    "h": _unit(3600.0, s=1),
    "d": _unit(86400.0, s=1),
    "m": _unit(1.0, m=1),
    "cm": _unit(1e-2, m=1),
    "mm": _unit(1e-3, m=1),
    "km": _unit(1e3, m=1),
    "ft": _unit(0.3048, m=1),
    "m/s": _unit(1.0, m=1, s=-1),
    "mm/s": _unit(1e-3, m=1, s=-1),
    "km/h": _unit(1.0 / 3.6, m=1, s=-1),
    "mph": _unit(0.44704, m=1, s=-1),
    "kn": _unit(1852.0 / 3600.0, m=1, s=-1),
    "ft/s": _unit(0.3048, m=1, s=-1),
    "m/s^2": _unit(1.0, m=1, s=-2),
    "ft/s^2": _unit(0.3048, m=1, s=-2),
    "g": _unit(STANDARD_GRAVITY, m=1, s=-2),
    "mg": _unit(1e-3 * STANDARD_GRAVITY, m=1, s=-2),
    "rad": _unit(1.0, rad=1),
    "mrad": _unit(1e-3, rad=1),
    "deg": _unit(_DEGREE, rad=1),
    "rev": _unit(2.0 * math.pi, rad=1),
    "rad/s": _unit(1.0, s=-1, rad=1),
    "mrad/s": _unit(1e-3, s=-1, rad=1),
    "deg/s": _unit(_DEGREE, s=-1, rad=1),
    "deg/h": _unit(_DEGREE / 3600.0, s=-1, rad=1),
    "rpm": _unit(2.0 * math.pi / 60.0, s=-1, rad=1),
    "rev/s": _unit(2.0 * math.pi, s=-1, rad=1),
    "rad/s^2": _unit(1.0, s=-2, rad=1),
    "deg/s^2": _unit(_DEGREE, s=-2, rad=1),
    "Pa": _unit(1.0, kg=1, m=-1, s=-2),
    "kPa": _unit(1e3, kg=1, m=-1, s=-2),
    "MPa": _unit(1e6, kg=1, m=-1, s=-2),
    "bar": _unit(1e5, kg=1, m=-1, s=-2),
    "psi": _unit(6894.757293168, kg=1, m=-1, s=-2),
    "N": _unit(1.0, kg=1, m=1, s=-2),
    "kN": _unit(1e3, kg=1, m=1, s=-2),
    "lbf": _unit(4.4482216152605, kg=1, m=1, s=-2),
    "N/rad": _unit(1.0, kg=1, m=1, s=-2, rad=-1),
    "N/deg": _unit(1.0 / _DEGREE, kg=1, m=1, s=-2, rad=-1),
    "N m": _unit(1.0, kg=1, m=2, s=-2),
    "kN m": _unit(1e3, kg=1, m=2, s=-2),
    "lbf ft": _unit(1.3558179483314, kg=1, m=2, s=-2),
    "T": _unit(1.0, kg=1, s=-2, ampere=-1),
    "mT": _unit(1e-3, kg=1, s=-2, ampere=-1),
    "uT": _unit(1e-6, kg=1, s=-2, ampere=-1),
    "nT": _unit(1e-9, kg=1, s=-2, ampere=-1),
    "G": _unit(1e-4, kg=1, s=-2, ampere=-1),
    "mG": _unit(1e-7, kg=1, s=-2, ampere=-1),
}
"""Every accepted unit, by the name that a channel map uses."""

_SPELLINGS = {
    "": "-", "1": "-", "none": "-", "sec": "s", "seconds": "s", "µs": "us", "μs": "us",
    "mps": "m/s", "m s-1": "m/s", "kph": "km/h", "kmh": "km/h", "kmph": "km/h", "knots": "kn",
    "m s^-1": "m/s", "m/sec": "m/s", "km/hr": "km/h", "mi/h": "mph", "kt": "kn", "kts": "kn",
    "m s^-2": "m/s^2", "m s-2": "m/s^2", "m/sec^2": "m/s^2", "m/s**2": "m/s^2", "g's": "g",
    "gs": "g", "gn": "g", "g0": "g", "rad s^-1": "rad/s", "rad/sec": "rad/s", "rad s-1": "rad/s",
    "deg s^-1": "deg/s", "degree/s": "deg/s", "degrees/s": "deg/s", "degrees/second": "deg/s",
    "grad": "deg", "grad/s": "deg/s", "º": "deg", "º/s": "deg/s", "u/min": "rpm", "1/min.": "rpm",
    "m/s2": "m/s^2", "m/s²": "m/s^2", "mps2": "m/s^2", "m/s/s": "m/s^2",
    "degree": "deg", "degrees": "deg", "°": "deg", "radians": "rad",
    "°/s": "deg/s", "deg/sec": "deg/s", "dps": "deg/s", "rps": "rad/s", "rads": "rad/s",
    "rad/s²": "rad/s^2", "rad/s2": "rad/s^2", "1/min": "rpm", "1/s": "rev/s",
    "nm": "N m", "n.m": "N m", "n*m": "N m", "n·m": "N m",
    "µt": "uT", "μt": "uT", "ut": "uT", "nt": "nT", "gauss": "G", "mgauss": "mG",
}  # fmt: skip


def proposed_unit(text: str) -> str | None:
    """Return the accepted unit that a log's own unit text means, or None.

    Used to propose a map only; a map itself must name an accepted unit exactly.
    """
    stripped = text.strip().strip("[]()").strip()
    if stripped in UNITS and stripped != "G":
        return stripped
    if stripped == "G":  # of an accelerometer; a magnetometer's map says it itself
        return "g"
    lower = stripped.lower()
    known = _SPELLINGS.get(lower)
    if known is None:
        known = next((unit for unit in UNITS if unit.lower() == lower), None)
    return known


def dimension_text(dimension: Dimension) -> str:
    """Return a dimension in words of SI base units, such as `m s^-2`."""
    names = ("kg", "m", "s", "A", "rad")
    parts = [
        name if power == 1 else f"{name}^{power}"
        for name, power in zip(names, dimension, strict=True)
        if power
    ]
    return " ".join(parts) or "-"


def conversion(unit: str, target: str, per: str = "") -> float:
    """Return the factor from a unit to the SI unit of a signal.

    Parameters
    ----------
    unit
        Unit of the log's column.
    target
        Unit of the signal.
    per
        Unit of the vehicle parameter by which the column is divided; empty: none. A length is
        then one per radian (a wheel's radius).

    Raises
    ------
    InputError
        If the unit is not accepted or measures another quantity.

    Examples
    --------
    >>> round(conversion("km/h", "m/s"), 4)
    0.2778
    >>> conversion("m/s", "rad/s", per="m")
    1.0
    """
    if unit not in UNITS:
        raise unknown("unit", unit, UNITS)
    given, wanted = UNITS[unit], UNITS[target]
    dimension = given.dimension
    if per:
        divisor = UNITS[per].dimension
        if per == "m":
            divisor = (0, 1, 0, 0, -1)
        dimension = tuple(a - b for a, b in zip(dimension, divisor, strict=True))  # type: ignore[assignment]
    if dimension != wanted.dimension:
        fitting = [
            name
            for name, entry in UNITS.items()
            if dimension_text(entry.dimension) == dimension_text(wanted.dimension)
        ]
        raise InputError(
            f"unit '{unit}'{f' per {per}' if per else ''} is no unit of a signal in {target}: "
            f"allowed are {', '.join(fitting)}"
        )
    return given.factor / wanted.factor
