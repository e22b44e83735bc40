"""Units, signs and clocks by physics: what contradicts a law, and what mends the map.

Where some laws do not hold, the smallest change (another unit, the other sign, of one channel or
two) that makes all of them hold is the mend to suggest. Each is tried before it is suggested: the
changed series must satisfy every law.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gripbench.logs.channels.series import Series
from gripbench.logs.mapping.units import UNITS
from gripbench.logs.quality.alignment import Lag, lags, shifted
from gripbench.logs.quality.law_forms import Law
from gripbench.logs.quality.laws import laws_of
from gripbench.logs.quality.limits import limits_of
from gripbench.logs.quality.speeds import speed_of

__all__ = ["Misfit", "misfits", "speed_of"]

_STEERING_RATIO = 16.0  # a usual one
_RARE = ("mrad", "rev", "mrad/s", "deg/h", "rev/s", "ft/s", "mm/s", "ft/s^2", "mg", "us", "ns")
"""Units that nobody meant when another fits."""

_FAR = 2.0  # times a limit
_MOST_CHOICES = 50_000
_COST, _COST_OF_SIGN = 0.1, 0.2  # of a change, so that the fewest are made
_TRIED = 40  # mends at most, the likeliest first
_PASSES = 3
_SLOWEST, _FASTEST = 1.0, 2e-5  # s between samples of an inertial sensor


@dataclass(frozen=True)
class Misfit:
    """A law that does not hold, and the change of the map that mends it.

    Attributes
    ----------
    key
        The suspect, or several joined by `and`.
    message
        What was found.
    suggestion
        The change in words; empty where none mends it.
    check
        `physics`, `limits` or `clock`.
    changes
        The keys to set, by table.
    """

    key: str
    message: str
    suggestion: str = ""
    check: str = "physics"
    changes: dict[str, dict[str, str | float]] = field(default_factory=dict)


def misfits(
    channels: dict[str, Series], reference: dict[str, Series], vehicle: dict[str, float]
) -> list[Misfit]:
    """Return what contradicts physics; followed, the suggestions leave nothing to find.

    Parameters
    ----------
    channels, reference
        Series by signal name.
    vehicle
        Vehicle parameters; the laws that need one that is missing are left out or looser.
    """
    found = _of_sampling(channels)
    if found:  # with a wrong unit of time no other law means anything
        return found
    late: list[Lag] = []
    for _ in range(_PASSES):
        new = lags(channels, reference, vehicle)
        late += [one for one in new if one.key not in {known.key for known in late}]
        channels, reference = shifted(channels, new), shifted(reference, new)
        misfit, mend = _misfit_of_units(channels, reference, vehicle)
        found += misfit
        if not mend:
            break
        channels, reference = _scaled(channels, mend), _scaled(reference, mend)
    series = {s.key: s for s in [*channels.values(), *reference.values()]}
    return found + [_of_lag(lag, series[lag.key]) for lag in late]


def settled(
    channels: dict[str, Series],
    reference: dict[str, Series],
    vehicle: dict[str, float],
    free: set[str],
) -> dict[str, dict[str, str | float]]:
    """Return the keys to set so that the laws hold, where the units of `free` are not known.

    Parameters
    ----------
    channels, reference, vehicle
        As for `misfits`.
    free
        Keys of the series whose unit nobody wrote; the sign of every series may turn.

    Returns
    -------
    The keys of the map by table; empty where all laws hold or no choice makes them hold.
    """
    laws = [
        *limits_of(channels, reference, vehicle),
        *laws_of(channels, reference, vehicle),
    ]
    broken = [law for law in laws if not law.holds({})]
    if all(law.limit and law.factor <= _FAR for law in broken):
        return {}
    series = {s.key: s for s in [*channels.values(), *reference.values()]}
    bound = sorted({key for law in laws for key in law.powers if key in series})
    choices: list[list[float]] = []
    for key in bound:
        units = [f for f in _changes(series[key]) if f > 0.0] if key in free else []
        signs = (1.0,) if "speed_x" in key or "speed_gps" in key else (1.0, -1.0)
        alone = [law for law in laws if law.limit and set(law.powers) == {key}]
        possible = [f for f in (1.0, *units) if all(law.holds({key: f}) for law in alone)]
        choices.append([sign * f for f in possible for sign in signs])
    if math.prod(map(len, choices)) > _MOST_CHOICES:
        return {}
    best: tuple[float, dict[str, float]] | None = None
    for changes in itertools.product(*choices):
        mend = {key: one for key, one in zip(bound, changes, strict=True) if one != 1.0}
        if all(law.holds(mend) for law in laws):
            cost = _misfit(laws, mend) + _COST * len(mend)
            cost += _COST_OF_SIGN * sum(one < 0.0 for one in mend.values())
            if best is None or cost < best[0]:
                best = cost, mend
    if best is None:
        return {}
    return {key: _change_keys(series[key], change) for key, change in best[1].items()}


def _of_sampling(channels: dict[str, Series]) -> list[Misfit]:
    """Return that the unit of time is wrong, as the rate of inertial sensors shows."""
    for name in ("yaw_rate", "accel_y", "accel_x"):
        if name not in channels or len(channels[name].times) < 3:
            continue
        series = channels[name]
        usual = float(np.median(np.diff(series.times)))
        if _FASTEST < usual < _SLOWEST:
            return []
        # Seen in seconds; logs whose times are seconds already are the only ones that are so slow.
        fitting = [unit for unit, f in (("ms", 1e-3), ("us", 1e-6)) if 5e-4 <= usual * f <= 0.2]
        suggestion = f'time: unit = "{fitting[0]}"' if usual >= _SLOWEST and fitting else ""
        return [
            Misfit(
                series.key,
                f"samples come every {usual:.3g} s, no rate of such a sensor: is the unit of time "
                "right?",
                suggestion,
                changes={"time": {"unit": fitting[0]}} if suggestion else {},
            )
        ]
    return []


def _misfit_of_units(
    channels: dict[str, Series], reference: dict[str, Series], vehicle: dict[str, float]
) -> tuple[list[Misfit], dict[str, float]]:
    """Return what the laws find, and the change of each series that mends it."""
    laws = [
        *limits_of(channels, reference, vehicle),
        *laws_of(channels, reference, vehicle),
    ]
    broken = [law for law in laws if not law.holds({})]
    if not broken:
        return [], {}
    series = {s.key: s for s in [*channels.values(), *reference.values()]}
    found = [law.fault() for law in broken]
    mends = [
        mend
        for mend in _mends(laws, broken, series)
        if _mended(channels, reference, vehicle, mend, broken)
    ]
    if not mends:
        return [
            Misfit(next(iter(law.powers)), text) for law, text in zip(broken, found, strict=True)
        ], {}
    best = mends[0]
    suggestion = " and ".join(f"{key}: {_change_text(series[key], best[key])}" for key in best)
    if len(mends) > 1:
        others = [
            " and ".join(f"{key}: {_change_text(series[key], mend[key])}" for key in mend)
            for mend in mends[1:3]
        ]
        suggestion += "; or " + "; or ".join(others)
    changes = {key: _change_keys(series[key], change) for key, change in best.items()}
    # A limit alone, hardly passed, is no proof of another unit.
    check = "physics" if any(not law.limit or law.factor > _FAR for law in broken) else "limits"
    return [Misfit(" and ".join(best), "; ".join(found), suggestion, check, changes)], best


def _mended(
    channels: dict[str, Series],
    reference: dict[str, Series],
    vehicle: dict[str, float],
    mend: dict[str, float],
    broken: Sequence[Law],
) -> bool:
    """Whether no law is broken once the mend is made, of those that it could touch or others."""
    new_channels, new_reference = _scaled(channels, mend), _scaled(reference, mend)
    again = [
        *limits_of(new_channels, new_reference, vehicle),
        *laws_of(new_channels, new_reference, vehicle),
    ]
    return all(law.holds({}) or law.text.startswith("speed * sideslip") for law in again)


def _scaled(series: dict[str, Series], mend: dict[str, float]) -> dict[str, Series]:
    return {
        name: replace(one, values=one.values * mend[one.key]) if one.key in mend else one
        for name, one in series.items()
    }


def _of_lag(lag: Lag, series: Series) -> Misfit:
    column = series.column
    amount = round(lag.lag, 3)
    if series.key.startswith("reference.") and column.delay + amount >= 0.0:
        key, value = "delay", round(column.delay + amount, 3)
    else:
        key, value = "shift", round(column.shift - amount, 3)
    return Misfit(
        series.key,
        f"comes {abs(lag.lag):.3f} s +- {lag.deviation:.3f} s "
        f"{'late' if lag.lag > 0.0 else 'early'} against the {lag.against}",
        f"{series.key}: {key} = {value:g}",
        "clock",
        {series.key: {key: value}},
    )


def _mends(laws: list[Law], broken: list[Law], series: dict[str, Series]) -> list[dict[str, float]]:
    """Return the smallest changes after which every law holds, the likeliest first."""
    suspects = sorted({key for law in broken for key in law.powers if key in series})
    choices = {key: _changes(series[key]) for key in suspects}
    for size in (1, 2):
        mends = []
        for keys in itertools.combinations(suspects, size):
            for changes in itertools.product(*(choices[key] for key in keys)):
                mend = dict(zip(keys, changes, strict=True))
                if all(law.holds(mend) for law in laws):
                    mere_signs = all(abs(change) == 1.0 for change in changes)
                    mends.append((not mere_signs, _misfit(laws, mend), mend))
        if mends:
            mends.sort(key=lambda item: item[:2])
            return _one_a_series([mend for *_, mend in mends])[:_TRIED]
    return []


def _one_a_series(mends: list[dict[str, float]]) -> list[dict[str, float]]:
    """Keep the best change for each set of series."""
    kept: dict[tuple[str, ...], dict[str, float]] = {}
    for mend in mends:
        kept.setdefault(tuple(mend), mend)
    return list(kept.values())


def _misfit(laws: list[Law], mend: dict[str, float]) -> float:
    """Return how far the mended laws are from holding exactly; mere signs come first."""
    return sum(
        math.log(abs(law.changed(mend))) ** 2
        for law in laws
        if not law.limit and law.changed(mend) and math.isfinite(law.tolerance)
    )


def _changes(series: Series) -> list[float]:
    """Return the factors that another unit or sign of a series would bring."""
    given = UNITS[series.column.unit]
    factors: set[float] = {
        round(unit.factor / given.factor, 12)
        for name, unit in UNITS.items()
        if unit.dimension == given.dimension and name not in _RARE
    }
    if series.name == "steer_angle":
        factors |= {factor / _STEERING_RATIO for factor in factors}
    return [
        sign * factor for factor in sorted(factors) for sign in (1.0, -1.0) if sign * factor != 1.0
    ]


def _change_text(series: Series, change: float) -> str:
    """Return a change of the map in the map's own words."""
    parts = []
    for key, value in _change_keys(series, change).items():
        parts.append(f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value:.3g}")
        if key == "scale":
            parts[-1] += " (a steering wheel's angle? one over the steering ratio)"
    return ", ".join(parts)


def _change_keys(series: Series, change: float) -> dict[str, str | float]:
    """Return a change of the map as the keys to set."""
    given = UNITS[series.column.unit]
    keys: dict[str, str | float] = {}
    for divisor in (1.0, _STEERING_RATIO):
        matches = [
            name
            for name, unit in UNITS.items()
            if unit.dimension == given.dimension
            and abs(unit.factor / given.factor / divisor / abs(change) - 1.0) < 1e-6
        ]
        if matches:
            if divisor != 1.0:
                keys["scale"] = series.column.scale / divisor
            if series.column.unit not in matches:
                keys["unit"] = matches[0]
            break
    if change < 0.0:
        keys["sign"] = -series.column.sign
    return keys
