"""`check_estimator`: named checks of what the harness, and a vehicle, expect of a method.

The same function serves a notebook, pytest and `gripbench check`. Every failure is one sentence
that says what is wrong and what to do. A method declares a check that it is known to fail by the
attribute `expected_failures = {"check": "reason"}`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy.typing as npt

from gripbench.bench.catalogue.arrays import given_state
from gripbench.bench.catalogue.declarations import Declaration, declaration_of
from gripbench.bench.catalogue.expectations import (
    CHECKS,
    FIRST,
    ExpectationError,
    NotApplicableError,
    Perform,
    Subject,
)
from gripbench.bench.catalogue.making import make
from gripbench.bench.catalogue.registry import (
    MethodSpec,
    choose_method,
    find_method,
    is_isolated,
    split_choice,
)
from gripbench.bench.catalogue.scenarios import all_scenario_files, find_scenario
from gripbench.bench.running.execution import missing, takes_samples
from gripbench.bench.running.fitting import fitted
from gripbench.bench.running.isolation.limits import CellFailure, Limits
from gripbench.bench.running.isolation.loading import Settings
from gripbench.bench.running.isolation.sandbox import Sandbox
from gripbench.bench.running.isolation.trials import Trial, has_batch, perform
from gripbench.bench.scoring.scoring import EstimateError
from gripbench.envs.recordings import Recording
from gripbench.envs.scenarios import Scenario
from gripbench.envs.signals import NEW
from gripbench.envs.vehicles import load_vehicle
from gripbench.envs.worlds import record
from gripbench.errors import InputError, describe_error, nearest

PASSED = "PASSED"
SKIPPED = "SKIPPED: "
EXPECTED = "EXPECTED: "


def check_estimator(
    method: Any,
    scenarios: Iterable[str] = (),
    *,
    variant: str = "",
    checks: Iterable[str] = (),
    seed: int = 0,
    limits: Limits | None = None,
    on_result: Callable[[str, str | None], Any] = lambda name, text: None,
    **parameters: Any,
) -> dict[str, str]:
    """Check a method against everything that is expected of one.

    Parameters
    ----------
    method
        Name, `file.py:Class`, class, or a callable that returns a new estimator. What does not
        ship with gripbench and is given by name or file runs in a process of its own.
    scenarios
        Scenarios to run it on; by default all that give its sensors.
    variant, **parameters
        Settings of the method.
    checks
        Names of the checks to make; by default all of `CHECKS`.
    seed
        Seed of the recordings.
    limits
        What one run over one recording may take in the process of its own.
    on_result
        Called with each check's name before it is made, and with its result after.

    Returns
    -------
    By name of the check: `PASSED`, `SKIPPED: why`, `EXPECTED: the declared reason`, or what is
    wrong in one sentence.

    Examples
    --------
    >>> results = check_estimator("slip_slope", ["constant_mu"])
    >>> failures(results)
    {}
    """
    wanted = tuple(checks) or tuple(CHECKS)
    for name in wanted:
        if name not in CHECKS:
            raise InputError(f"unknown check '{name}': {nearest(name, CHECKS)}")
    with ExitStack() as stack:
        on_result(FIRST, None)
        try:
            tried = _tried(method, variant, parameters, limits or Limits(), stack)
            for name in tried.expected:
                if name not in CHECKS:
                    raise InputError(
                        f"'expected_failures' names the unknown check '{name}': "
                        f"{nearest(name, CHECKS)}"
                    )
        except Exception as error:
            results = {FIRST: describe_error(error)}
            results |= {name: SKIPPED + f"mend '{FIRST}' first" for name in wanted if name != FIRST}
            for name, text in results.items():
                on_result(name, text)
            return results
        recordings, period = _recordings(tried.declaration, tuple(scenarios), seed)
        subject = Subject(
            tried.perform,
            tried.bounded,
            tried.declaration,
            tried.batch,
            tried.online,
            recordings,
            period,
        )
        results = {}
        for name in wanted:
            on_result(name, None)
            results[name] = _verdict(name, subject, tried.expected.get(name), results)
            on_result(name, results[name])
    return results


@dataclass(frozen=True)
class _Tried:
    """A method that can be tried: here, or in a process of its own."""

    perform: Perform
    bounded: Perform | None
    declaration: Declaration
    batch: bool
    online: bool
    expected: dict[str, str]


def _tried(
    method: Any, variant: str, parameters: dict[str, Any], limits: Limits, stack: ExitStack
) -> _Tried:
    if isinstance(method, str):
        name, chosen, given = split_choice(method)
        source, variant, parameters = find_method(name), variant or chosen, given | parameters
        if is_isolated(source):
            return _in_sandbox(name, Settings(source, variant, parameters), limits, stack)
        method = source.load()
    state = b""

    def create() -> Any:
        made = make(method, variant, parameters, getattr(method, "__name__", "method"))
        return given_state(made, state)

    instance = create()
    declaration = declaration_of(instance, variant, parameters)
    if declaration.fits:
        state = _fitted(choose_method(method, variant, parameters), limits)

    def here(
        form: str, vehicle: dict[str, float], observations: npt.NDArray[Any], period: float
    ) -> list[npt.NDArray[Any]]:
        return perform(form, Trial(create, declaration, vehicle, observations, period))

    expected = dict(getattr(instance, "expected_failures", {}))
    online = takes_samples(instance)
    return _Tried(here, None, declaration, has_batch(instance), online, expected)


def _in_sandbox(name: str, settings: Settings, limits: Limits, stack: ExitStack) -> _Tried:
    sandbox, bounded = Sandbox(limits), Sandbox(limits, bounds=True)
    for item in (sandbox, bounded):
        stack.callback(item.close)
    loaded = sandbox.load(settings)
    if loaded.declaration.fits:
        spec = choose_method(name, settings.variant, settings.parameters)
        settings = replace(settings, state=_fitted(spec, limits))
    return _Tried(
        partial(sandbox.perform, settings),
        partial(bounded.perform, settings),
        loaded.declaration,
        loaded.batch,
        loaded.online,
        loaded.expected_failures,
    )


def _fitted(spec: MethodSpec, limits: Limits) -> bytes:
    """Return what a method's `fit` makes of one drive of each of its training scenarios.

    Raises
    ------
    CellFailure
        If it fails.
    """
    found = fitted(spec, None, limits, each=1)
    if found.unfitted:
        raise CellFailure("failed", f"its fit failed: {found.unfitted}")
    return found.state


def failures(results: dict[str, str]) -> dict[str, str]:
    """Return the checks that failed and were not expected to."""
    return {
        name: text
        for name, text in results.items()
        if text != PASSED and not text.startswith((SKIPPED, EXPECTED))
    }


def tally(results: dict[str, str]) -> str:
    """Return how many checks passed, failed and said nothing, as one line."""
    failed = len(failures(results))
    skipped = sum(text.startswith(SKIPPED) for text in results.values())
    expected = sum(text.startswith(EXPECTED) for text in results.values())
    parts = [f"{len(results) - failed - skipped - expected} passed"]
    parts += [f"{failed} failed"] if failed else []
    parts += [f"{expected} failed as declared"] if expected else []
    parts += [f"{skipped} skipped"] if skipped else []
    return f"{', '.join(parts)} of {len(results)} checks"


def _verdict(name: str, subject: Subject, expected: str | None, before: dict[str, str]) -> str:
    function, remedy = CHECKS[name]
    if not subject.recordings and name != FIRST:
        return SKIPPED + "no scenario gives its sensors and vehicle parameters"
    try:
        if name != FIRST:
            subject.estimates(subject.observations)  # what fails here, fails everywhere
        function(subject)
    except NotApplicableError as reason:
        return SKIPPED + str(reason)
    except (ExpectationError, EstimateError) as error:
        cause, found = str(error), f"{error}; {remedy}"
    except CellFailure as error:
        cause = found = str(error)
        if not cause.startswith(("its process", "stopped after", "out of memory")):
            found = f"{error}; {remedy}"
    except Exception as error:
        cause = describe_error(error)
        found = f"it raised {cause}; {remedy}"
    else:
        if expected is not None:
            return f"it passes; remove '{name}' from 'expected_failures'"
        return PASSED
    if expected is not None:
        return EXPECTED + expected
    for earlier, text in before.items():
        if text.startswith((cause, f"it raised {cause}")):
            return SKIPPED + f"mend '{earlier}' first"
    return found


@cache
def _recording(scenario: str, seed: int) -> Recording:
    return record(find_scenario(scenario), seed)


@cache
def _channels(name: str) -> tuple[Scenario, tuple[str, ...], dict[str, float]]:
    """Return a scenario with its channels and vehicle, without simulating it."""
    scenario = find_scenario(name)
    sensors = scenario.all_sensors()
    channels = ["time", *sensors]
    channels += [channel + NEW for channel, sensor in sensors.items() if sensor.rate > 0.0]
    return scenario, tuple(channels), load_vehicle(scenario.vehicle).values()


def _recordings(
    declaration: Declaration, names: tuple[str, ...], seed: int
) -> tuple[tuple[Recording, ...], float]:
    """Return a run of each scenario that the method can run on, and the shortest sample time."""
    found, periods = [], []
    for name in names or tuple(all_scenario_files()):
        scenario, channels, vehicle = _channels(name)
        if missing(declaration, vehicle, channels):
            continue
        found.append(_recording(name, seed))
        periods.append(scenario.sample_time)
    return tuple(found), min(periods, default=math.nan)
