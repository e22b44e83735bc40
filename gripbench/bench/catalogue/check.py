"""`check_estimator`: named checks of what the harness, and a vehicle, expect of a method.

The same function serves a notebook, pytest and `gripbench check`. Every failure is one sentence
that says what is wrong and what to do. A method declares a check that it is known to fail by the
attribute `expected_failures = {"check": "reason"}`.
"""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.catalogue import distortions
from gripbench.bench.catalogue.declarations import Declaration, declaration_of, describe_error, make
from gripbench.bench.catalogue.registry import (
    all_scenario_files,
    find_method,
    find_scenario,
    split_choice,
)
from gripbench.bench.running.execution import ONLINE_SAMPLES, execute, missing, run_online
from gripbench.bench.scoring.scoring import EstimateError, check_estimates
from gripbench.envs.recordings import Recording, select_channels
from gripbench.envs.scenarios import Scenario
from gripbench.envs.signals import NEW, VARIANCE
from gripbench.envs.vehicles import load_vehicle
from gripbench.envs.worlds import record
from gripbench.errors import InputError, nearest

PASSED = "PASSED"
SKIPPED = "SKIPPED: "
EXPECTED = "EXPECTED: "

SAMPLES = 2000
"""Samples of the recording that most checks run on."""

SLOW_SAMPLES = 10_000
"""Samples of each scenario that a method without a batch form has to get through."""


class _FailedError(Exception):
    """What a check found."""


class _NotApplicableError(Exception):
    """Why a check says nothing about this method."""


@dataclass
class _Subject:
    """A method and what it is checked with."""

    create: Callable[[], Any]
    declaration: Declaration
    recordings: tuple[Recording, ...]
    period: float

    @property
    def vehicle(self) -> dict[str, float]:
        return self.recordings[0].vehicle

    @property
    def observations(self) -> npt.NDArray[Any]:
        return select_channels(self.recordings[0].observations[:SAMPLES], self.declaration.sensors)

    def estimates(self, observations: npt.NDArray[Any], method: Any = None) -> npt.NDArray[Any]:
        """Run a method, a new one unless given, in the form that the benchmark runs."""
        method = self.create() if method is None else method
        outcome = execute(
            method, self.declaration, self.vehicle, observations, self.period, timed=False
        )
        check_estimates(outcome.estimates, self.declaration.outputs, len(observations))
        return outcome.estimates.copy()


def check_estimator(
    method: Any,
    scenarios: Iterable[str] = (),
    *,
    variant: str = "",
    checks: Iterable[str] = (),
    seed: int = 0,
    **parameters: Any,
) -> dict[str, str]:
    """Check a method against everything that is expected of one.

    Parameters
    ----------
    method
        Name, `file.py:Class`, class, or a callable that returns a new estimator.
    scenarios
        Scenarios to run it on; by default all that give its sensors.
    variant, **parameters
        Settings of the method.
    checks
        Names of the checks to make; by default all of `CHECKS`.
    seed
        Seed of the recordings.

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
    if isinstance(method, str):
        name, chosen, given = split_choice(method)
        method, variant = find_method(name).load(), variant or chosen
        parameters = given | parameters

    def create() -> Any:
        return make(method, variant, parameters, getattr(method, "__name__", "method"))

    try:
        instance = create()
        declaration = declaration_of(instance, variant, parameters)
        expected = dict(getattr(instance, "expected_failures", {}))
        for name in expected:
            if name not in CHECKS:
                raise InputError(
                    f"'expected_failures' names the unknown check '{name}': {nearest(name, CHECKS)}"
                )
    except Exception as error:
        reason = describe_error(error)
        return {
            name: reason if name == _FIRST else SKIPPED + f"mend '{_FIRST}' first"
            for name in (_FIRST, *(name for name in wanted if name != _FIRST))
        }
    recordings, period = _recordings(declaration, tuple(scenarios), seed)
    subject = _Subject(create, declaration, recordings, period)
    return {name: _verdict(name, subject, expected.get(name)) for name in wanted}


def failures(results: dict[str, str]) -> dict[str, str]:
    """Return the checks that failed and were not expected to."""
    return {
        name: text
        for name, text in results.items()
        if text != PASSED and not text.startswith((SKIPPED, EXPECTED))
    }


def _verdict(name: str, subject: _Subject, expected: str | None) -> str:
    function, remedy = CHECKS[name]
    if not subject.recordings and name != _FIRST:
        return SKIPPED + "no scenario gives its sensors and vehicle parameters"
    try:
        function(subject)
    except _NotApplicableError as reason:
        return SKIPPED + str(reason)
    except (_FailedError, EstimateError) as error:
        found = f"{error}; {remedy}"
    except Exception as error:
        found = f"it raised {describe_error(error)}; {remedy}"
    else:
        if expected is not None:
            return f"it passes; remove '{name}' from 'expected_failures'"
        return PASSED
    return EXPECTED + expected if expected is not None else found


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


def _declares_its_channels(subject: _Subject) -> None:
    del subject  # its declaration was read and checked before any other check


def _reads_only_its_channels(subject: _Subject) -> None:
    # Neither form is given more than the declared channels: reading another one raises.
    subject.estimates(subject.observations)
    run_online(subject.create(), subject.declaration, subject.vehicle, subject.observations[:200])


def _reset_equals_fresh(subject: _Subject) -> None:
    method = subject.create()
    first = _online(subject, method, subject.observations)
    again = _online(subject, method, subject.observations)
    _same(first, again, "after reset its estimates differ from those of a new one")


def _same_input_same_output(subject: _Subject) -> None:
    first = subject.estimates(subject.observations)
    _same(first, subject.estimates(subject.observations), "two runs over the same data differ")


def _causal(subject: _Subject) -> None:
    observations = subject.observations
    whole = subject.estimates(observations)
    for share in (3, 2):
        length = max(len(observations) // share, 2)
        part = subject.estimates(observations[:length])
        _same(whole[:length], part, "estimates change when later samples are cut off")


def _copy_safe(subject: _Subject) -> None:
    observations = subject.observations[:500]
    fresh = _online(subject, subject.create(), observations)
    method = subject.create()
    method.reset(dict(subject.vehicle), subject.period)
    names = observations.dtype.names or ()
    buffer: dict[str, float] = {}
    outputs = subject.declaration.outputs
    kept: list[Any] = []
    copies = np.empty((len(observations), len(outputs)))
    for k, sample in enumerate(observations.tolist()):
        buffer.update(zip(names, sample, strict=True))
        before = dict(buffer)
        given = method.update(buffer)
        if buffer != before:
            raise _FailedError("update changes the observation that it is given")
        copies[k] = [given[name] for name in outputs]
        kept.append(given)
        for name in names:  # whoever looks at the old sample later finds this
            buffer[name] = math.nan
    for column, name in enumerate(outputs):
        if not np.array_equal(copies[:, column], fresh[name], equal_nan=True):
            raise _FailedError("its estimates change when the observation's dict is used again")
    if any([given[name] for name in outputs] != list(copies[k]) for k, given in enumerate(kept)):
        raise _FailedError("update changes estimates that it returned before")


def _runs(subject: _Subject) -> Iterator[tuple[Recording, npt.NDArray[Any], npt.NDArray[Any]]]:
    """Yield each recording with the samples that the method was run over, and its estimates."""
    fast = callable(getattr(subject.create(), "run", None))
    for recording in subject.recordings:
        observations = recording.observations if fast else recording.observations[:SLOW_SAMPLES]
        outcome = execute(
            subject.create(),
            subject.declaration,
            recording.vehicle,
            observations,
            subject.period,
            timed=False,
        )
        check_estimates(outcome.estimates, subject.declaration.outputs, len(observations))
        yield recording, observations, outcome.estimates


def _finite_on_every_scenario(subject: _Subject) -> None:
    for recording, observations, estimates in _runs(subject):
        _finite(subject, estimates, observations, f" in scenario {recording.scenario}")


def _survives(
    distort: Callable[[npt.NDArray[Any]], npt.NDArray[Any]], where: str
) -> Callable[[_Subject], None]:
    def check(subject: _Subject) -> None:
        observations = distort(subject.observations)
        _finite(subject, subject.estimates(observations), observations, where)

    return check


def _variance_not_negative(subject: _Subject) -> None:
    if not subject.declaration.variances:
        raise _NotApplicableError("it declares no variance")
    for recording, _, estimates in _runs(subject):
        for name in subject.declaration.variances:
            lowest = float(np.min(estimates[name + VARIANCE]))
            if not lowest >= 0.0:
                where = f"in scenario {recording.scenario}"
                raise _FailedError(f"{name}{VARIANCE} is as low as {lowest:g} {where}")


def _online_and_batch_agree(subject: _Subject) -> None:
    if not callable(getattr(subject.create(), "run", None)):
        raise _NotApplicableError("it has no batch form")
    batch = subject.estimates(subject.observations)
    online = _online(subject, subject.create(), subject.observations)
    for name in subject.declaration.outputs:
        scale = float(np.max(np.abs(online[name]), initial=1e-300))
        worst = float(np.max(np.abs(batch[name] - online[name])))
        if not worst <= 1e-9 * scale:
            raise _FailedError(f"run and update give {name} with a difference of {worst:g}")


def _picklable(subject: _Subject) -> None:
    method = subject.create()
    _online(subject, method, subject.observations[:100])
    twin = pickle.loads(pickle.dumps(method))
    original = subject.estimates(subject.observations, method)
    _same(original, subject.estimates(subject.observations, twin), "its unpickled copy differs")


def _step_within_sample_time(subject: _Subject) -> None:
    observations = subject.recordings[0].observations[:ONLINE_SAMPLES]
    runtime = execute(
        subject.create(),
        subject.declaration,
        subject.vehicle,
        observations,
        subject.period,
        timed=True,
    ).runtime
    if runtime.p50 is not None and runtime.p50 > subject.period:
        raise _FailedError(
            f"half of its steps take more than {runtime.p50 * 1e3:.2f} ms, "
            f"and a sample comes every {subject.period * 1e3:g} ms"
        )


def _online(subject: _Subject, method: Any, observations: npt.NDArray[Any]) -> npt.NDArray[Any]:
    return run_online(method, subject.declaration, subject.vehicle, observations)


def _same(first: npt.NDArray[Any], second: npt.NDArray[Any], message: str) -> None:
    for name in first.dtype.names or ():
        differs = ~(
            (first[name] == second[name]) | (np.isnan(first[name]) & np.isnan(second[name]))
        )
        if differs.any():
            raise _FailedError(f"{message} ({name}, from sample {int(np.argmax(differs))})")


def _finite(
    subject: _Subject, estimates: npt.NDArray[Any], observations: npt.NDArray[Any], where: str
) -> None:
    for name in subject.declaration.outputs:
        finite = np.isfinite(estimates[name])
        if not finite.all():
            first = int(np.argmin(finite))
            time = float(observations["time"][first])
            raise _FailedError(f"{name} is {estimates[name][first]} at t = {time:.6g} s{where}")


_FIRST = "declares_its_channels"

CHECKS: dict[str, tuple[Callable[[_Subject], None], str]] = {
    _FIRST: (_declares_its_channels, "declare name, sensors and estimates"),
    "reads_only_its_channels": (
        _reads_only_its_channels,
        "declare every channel that update reads in 'sensors' and every result in 'estimates'",
    ),
    "reset_equals_fresh": (_reset_equals_fresh, "let reset set every attribute to its start"),
    "same_input_same_output": (
        _same_input_same_output,
        "draw from a generator that reset seeds, and keep nothing in class or module variables",
    ),
    "causal": (_causal, "use the present sample and past ones only"),
    "copy_safe": (
        _copy_safe,
        "keep numbers instead of the dict that update is given, and return a new dict each time",
    ),
    "finite_on_every_scenario": (
        _finite_on_every_scenario,
        "guard divisions, roots and logarithms, and limit what may grow without bound",
    ),
    "survives_missing_samples": (
        _survives(distortions.missing_samples, " after missing samples"),
        "compute with the time that has passed since the last sample, however long",
    ),
    "survives_held_samples": (
        _survives(distortions.held_samples, " while samples are held"),
        "expect the same value several times: differences and excitation are zero then",
    ),
    "survives_standstill": (
        _survives(distortions.standstill, " at or after a standstill"),
        "guard divisions by speed and slip",
    ),
    "survives_zero_torque_start": (
        _survives(distortions.zero_torque_start, " at or after a start without torque"),
        "guard divisions by force and slip, and expect no excitation at first",
    ),
    "variance_not_negative": (
        _variance_not_negative,
        "keep the covariance positive: symmetrise it or use the Joseph form",
    ),
    "online_and_batch_agree": (
        _online_and_batch_agree,
        "let run and update share one step function and one start",
    ),
    "picklable": (_picklable, "keep no lambdas, open files or generators as attributes"),
    "step_within_sample_time": (
        _step_within_sample_time,
        "make the step cheaper, or compile it (see gripbench.CompiledMethod)",
    ),
}
"""Every check by name: the function, and what to do when it fails."""
