"""What a method says that it writes in; the names of the fields of its records out.

Beside an estimate a method may state how far it is off, by a variance or by quantiles, and it may
show its innovations. Each of these is a field of its own, named after the signal:

- `<signal>_variance`;
- `<signal>_q05`, `<signal>_q50`, `<signal>_q975`: the quantiles of the levels .05, .5 and .975, the
  digits of the level behind its point, two at least;
- `<channel>_innovation` and `<channel>_innovation_variance`: the last reading less its prediction
  [unit of the channel] and the variance that the filter expects of it. Where it takes no reading in
  a sample both stay as they were, or the variance is 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

from gripbench.envs.signals import INNOVATION, QUANTILE, VARIANCE
from gripbench.errors import InputError

_DIGITS = 6


def quantile_field(name: str, level: float) -> str:
    """Return the field that holds the quantile of a level.

    Examples
    --------
    >>> quantile_field("mu", 0.05), quantile_field("mu", 0.5), quantile_field("mu", 0.975)
    ('mu_q05', 'mu_q50', 'mu_q975')
    """
    digits = f"{level:.{_DIGITS}f}".partition(".")[2].rstrip("0")
    return f"{name}{QUANTILE}{digits.ljust(2, '0')}"


def fields_of(
    estimates: Iterable[str],
    variances: Iterable[str],
    quantiles: Mapping[str, Sequence[float]],
    innovations: Iterable[str],
) -> tuple[str, ...]:
    """Return the fields that a step writes: estimates, variances, quantiles, innovations."""
    return (
        *estimates,
        *(name + VARIANCE for name in variances),
        *(quantile_field(name, level) for name, levels in quantiles.items() for level in levels),
        *(name + INNOVATION + end for name in innovations for end in ("", VARIANCE)),
    )


def quantile_levels(name: str, fields: Iterable[str]) -> dict[str, float]:
    """Return the fields of a signal's quantiles with their levels, rising.

    Examples
    --------
    >>> quantile_levels("mu", ("mu", "mu_q95", "mu_q05"))
    {'mu_q05': 0.05, 'mu_q95': 0.95}
    """
    start = name + QUANTILE
    digits = {field: field.removeprefix(start) for field in fields if field.startswith(start)}
    found = {field: float(f"0.{text}") for field, text in digits.items() if text.isdecimal()}
    return dict(sorted(found.items(), key=lambda item: item[1]))


def checked_quantiles(
    method: str, given: Any, estimates: Sequence[str], variances: Sequence[str]
) -> dict[str, tuple[float, ...]]:
    """Return the levels of the quantiles that a method declares, by estimate.

    Raises
    ------
    InputError
        If it declares those of something else than its estimates, beside a variance, or levels
        that do not rise between 0 and 1.
    """
    where = f"{method}: 'quantiles'"
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise InputError(
            f"{where} is {type(given).__name__}; set it to a table of levels by estimate, such as "
            "{'mu': (0.05, 0.5, 0.95)}"
        )
    for name, levels in given.items():
        if name not in estimates:
            raise InputError(f"{where} names '{name}', which it does not estimate")
        if name in variances:
            raise InputError(f"{where} names '{name}', which has a variance: state one of the two")
        if not isinstance(levels, list | tuple) or not levels:
            raise InputError(
                f"{where} of '{name}' are {levels!r}; give levels such as (0.05, 0.5, 0.95)"
            )
        for level in levels:
            number = isinstance(level, float | int) and not isinstance(level, bool)
            if not number or not 0.0 < level < 1.0:
                raise InputError(
                    f"{where} of '{name}' holds the level {level!r}; it must lie between 0 and 1"
                )
            if round(level, _DIGITS) != level:
                raise InputError(
                    f"{where} of '{name}' holds the level {level!r}; give at most {_DIGITS} digits"
                )
        if any(high <= low for low, high in pairwise(levels)):
            raise InputError(f"{where} of '{name}' are {levels!r}; the levels must rise")
    return {str(name): tuple(float(level) for level in levels) for name, levels in given.items()}
