"""What is expected of a method: a check makes trials and says what is wrong with the estimates."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.bench.catalogue import distortions
from gripbench.bench.catalogue.declarations import Declaration
from gripbench.bench.running.execution import ONLINE_SAMPLES
from gripbench.bench.running.isolation.limits import CellFailure
from gripbench.bench.scoring.scoring import missing_at_first
from gripbench.envs.recordings import Recording
from gripbench.envs.signals import VARIANCE, difference
from gripbench.methods.outputs import quantile_field
from gripbench.methods.samples import select_channels

SAMPLES = 2000
"""Samples of the recording that most checks run on."""

SLOW_SAMPLES = 10_000
"""Samples of each scenario that a method without a batch form has to get through."""


class ExpectationError(Exception):
    """What a check found."""


class NotApplicableError(Exception):
    """Why a check says nothing about this method."""


Perform = Callable[[str, dict[str, float], npt.NDArray[Any], float], list[npt.NDArray[Any]]]
"""Makes a trial of a method: form, vehicle, observations, sample time; see `trials.FORMS`."""


_ONE_BY_ONE = ("online", "reset", "reused")
"""Forms of trials that give samples one by one."""


@dataclass
class Subject:
    """A method and what it is checked with; every trial is made once."""

    perform: Perform
    bounded: Perform | None
    declaration: Declaration
    batch: bool
    online: bool
    recordings: tuple[Recording, ...]
    period: float
    made: dict[tuple[str, bytes], list[npt.NDArray[Any]] | Exception] = field(default_factory=dict)

    @property
    def vehicle(self) -> dict[str, float]:
        """Vehicle parameters of the recording that most checks run on."""
        return self.recordings[0].vehicle

    @property
    def observations(self) -> npt.NDArray[Any]:
        """What the method is given of that recording, shape (n,)."""
        return select_channels(self.recordings[0].observations[:SAMPLES], self.declaration.sensors)

    def estimates(
        self, observations: npt.NDArray[Any], vehicle: dict[str, float] | None = None
    ) -> npt.NDArray[Any]:
        """Run a new method in its fastest form."""
        return self.trial("run", observations, vehicle)[0]

    def trial(
        self, form: str, observations: npt.NDArray[Any], vehicle: dict[str, float] | None = None
    ) -> list[npt.NDArray[Any]]:
        """Make a trial, or find again what came of it."""
        if form in _ONE_BY_ONE and not self.online:
            raise NotApplicableError("it has no update: it takes whole recordings")
        vehicle = self.vehicle if vehicle is None else vehicle
        content = hashlib.sha256(observations.tobytes() + repr(vehicle).encode()).digest()
        if (form, content) not in self.made:
            try:
                found: Any = self.perform(form, vehicle, observations, self.period)
            except Exception as error:
                found = error
            self.made[form, content] = found
        found = self.made[form, content]
        if isinstance(found, Exception):
            raise found
        return found


def _declares_its_channels(subject: Subject) -> None:
    del subject  # its declaration was read and checked before any other check


def _reads_only_its_channels(subject: Subject) -> None:
    # Neither form is given more than the declared channels: reading another one raises.
    subject.estimates(subject.observations)
    if subject.online:
        subject.trial("online", subject.observations[:200])


def _reset_equals_fresh(subject: Subject) -> None:
    first, again = subject.trial("reset", subject.observations)
    _same(first, again, "after reset its estimates differ from those of a new one")


def _same_input_same_output(subject: Subject) -> None:
    message = "two runs over the same data differ"
    first, second = subject.trial("run in two", subject.observations)
    _same(first, second, message)
    _same(subject.estimates(subject.observations), first, message)


def _causal(subject: Subject) -> None:
    observations = subject.observations
    whole = subject.estimates(observations)
    cuts = np.random.default_rng(len(observations)).integers(2, max(len(observations), 3), 2)
    for length in sorted({len(observations) // 3, len(observations) // 2, *map(int, cuts)}):
        length = max(length, 2)
        part = subject.estimates(observations[:length])
        _same(whole[:length], part, "estimates change when later samples are cut off")


def _copy_safe(subject: Subject) -> None:
    observations = subject.observations[:500]
    (fresh,) = subject.trial("online", observations)
    given, later = subject.trial("reused", observations)
    _same(fresh, given, "its estimates change when the observation's dict is used again")
    _same(given, later, "update changes estimates that it returned before")


def _reads_within_bounds(subject: Subject) -> None:
    if subject.bounded is None:
        raise NotApplicableError("only a method in a file of its own is compiled again for it")
    try:
        form = "online" if subject.online else "run"
        subject.bounded(form, subject.vehicle, subject.observations[:500], subject.period)
    except CellFailure as error:
        if "IndexError" in str(error):
            raise ExpectationError(
                f"compiled with bounds checking it reads outside an array: {error}"
            ) from None
        raise


def _runs(subject: Subject) -> Iterator[tuple[Recording, npt.NDArray[Any], npt.NDArray[Any]]]:
    """Yield each recording with the samples that the method was run over, and its estimates."""
    for recording in subject.recordings:
        observations = recording.observations
        observations = observations if subject.batch else observations[:SLOW_SAMPLES]
        selected = select_channels(observations, subject.declaration.sensors)
        yield recording, selected, subject.estimates(selected, recording.vehicle)


def _finite_on_every_scenario(subject: Subject) -> None:
    for recording, observations, estimates in _runs(subject):
        _finite(subject, estimates, observations, f" in scenario {recording.scenario}")


def _survives(
    distort: Callable[[npt.NDArray[Any]], npt.NDArray[Any]], where: str
) -> Callable[[Subject], None]:
    def check(subject: Subject) -> None:
        if not _all_finite(subject, subject.estimates(subject.observations)):
            raise NotApplicableError("mend 'finite_on_every_scenario' first")
        observations = distort(subject.observations)
        _finite(subject, subject.estimates(observations), observations, where)

    return check


def _variance_not_negative(subject: Subject) -> None:
    if not subject.declaration.variances:
        raise NotApplicableError("it declares no variance")
    for recording, _, estimates in _runs(subject):
        for name in subject.declaration.variances:
            variance = estimates[name + VARIANCE]  # NaN is the finding of another check
            lowest = float(np.min(variance[~np.isnan(variance)], initial=np.inf))
            if lowest < 0.0:
                where = f"in scenario {recording.scenario}"
                raise ExpectationError(f"{name}{VARIANCE} is as low as {lowest:g} {where}")


def _quantiles_in_order(subject: Subject) -> None:
    if not subject.declaration.quantiles:
        raise NotApplicableError("it declares no quantiles")
    for recording, _, estimates in _runs(subject):
        for name, levels in subject.declaration.quantiles.items():
            fields = [quantile_field(name, level) for level in levels]
            for low, high in pairwise(fields):
                offset = difference(name, estimates[high], estimates[low])
                if (offset < 0.0).any():
                    time = float(recording.observations["time"][int(np.argmax(offset < 0.0))])
                    where = f"at t = {time:.6g} s in scenario {recording.scenario}"
                    raise ExpectationError(f"{low} is above {high} {where}")


def _online_and_batch_agree(subject: Subject) -> None:
    if not subject.batch or not subject.online:
        raise NotApplicableError("it has one form only")
    batch = subject.estimates(subject.observations)
    (online,) = subject.trial("online", subject.observations)
    for name in subject.declaration.outputs:
        one, other = batch[name], online[name]
        differ = np.where(np.isnan(one) & np.isnan(other), 0.0, np.abs(one - other))
        scale = float(np.nanmax(np.abs(other), initial=1e-300))
        worst = float(np.max(differ))
        if not worst <= 1e-9 * scale:
            raise ExpectationError(f"run and update give {name} with a difference of {worst:g}")


def _picklable(subject: Subject) -> None:
    original, twin = subject.trial("pickled", subject.observations)
    _same(original, twin, "its unpickled copy differs")


def _step_within_sample_time(subject: Subject) -> None:
    (found,) = subject.trial("timed", subject.observations[:ONLINE_SAMPLES])
    median = float(found[subject.declaration.outputs[0]][0])
    if median > subject.period:
        raise ExpectationError(
            f"half of its steps take more than {median * 1e3:.2f} ms, "
            f"and a sample comes every {subject.period * 1e3:g} ms"
        )


def _same(first: npt.NDArray[Any], second: npt.NDArray[Any], message: str) -> None:
    for name in first.dtype.names or ():
        differs = ~(
            (first[name] == second[name]) | (np.isnan(first[name]) & np.isnan(second[name]))
        )
        if differs.any():
            raise ExpectationError(f"{message} ({name}, from sample {int(np.argmax(differs))})")


def _all_finite(subject: Subject, estimates: npt.NDArray[Any]) -> bool:
    return all(_said_finite(estimates[name]).all() for name in subject.declaration.outputs)


def _said_finite(values: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Return which estimates are finite, or stand before the first one."""
    return np.isfinite(values) | (np.arange(len(values)) < missing_at_first(values))


def _finite(
    subject: Subject, estimates: npt.NDArray[Any], observations: npt.NDArray[Any], where: str
) -> None:
    for name in subject.declaration.outputs:
        finite = _said_finite(estimates[name])
        if not finite.all():
            first = int(np.argmin(finite))
            time = float(observations["time"][first])
            raise ExpectationError(f"{name} is {estimates[name][first]} at t = {time:.6g} s{where}")


FIRST = "declares_its_channels"

CHECKS: dict[str, tuple[Callable[[Subject], None], str]] = {
    FIRST: (_declares_its_channels, "declare name, sensors and estimates"),
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
    "reads_within_bounds": (_reads_within_bounds, "keep every index within its array"),
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
    "quantiles_in_order": (
        _quantiles_in_order,
        "sort the quantiles of a sample before they are returned",
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
