"""Scenario, seed, sensors and targets in; the least error that any estimate can have, over time.

The bound is local: the information of the readings is that along the very run that was driven. Its
mean over seeds is what is compared with a method's mean square error.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gripbench.bench.bounds.instruments import read, signals_of
from gripbench.bench.bounds.model import SHARE, STEP, Model, linearise
from gripbench.bench.bounds.recursion import least_variance
from gripbench.envs.plants.trajectory import Floats
from gripbench.envs.scenarios import Scenario
from gripbench.envs.signals import SIGNALS, signal
from gripbench.envs.worlds import known_worlds, sensors_of
from gripbench.errors import InputError, unknown

KNOWABLE = 0.5
"""Share of the prior's standard deviation below which a bound must be for a target to be known."""


@dataclass(frozen=True)
class Bound:
    """The bound of one run, one target and one set of channels.

    Attributes
    ----------
    scenario, seed, channels, target
        Of what.
    time
        Samples [s], shape (n,).
    truth
        The target, shape (n,).
    deviation
        Least standard deviation of an estimate's error, shape (n,).
    prior
        What is known without any instrument: the smaller of the root mean square of the least
        deviation then, and that of the target itself (who says 0 is no further off).
    gained
        Information about the target that the readings of a sample give, over its length
        [1/unit^2/s], shape (n,).
    scored
        Samples that count in a score, shape (n,).
    """

    scenario: str
    seed: int
    channels: tuple[str, ...]
    target: str
    time: Floats
    truth: Floats
    deviation: Floats
    prior: float
    gained: Floats
    scored: np.ndarray

    @property
    def knowable(self) -> np.ndarray:
        """Where the instruments take half of the prior's deviation away, shape (n,)."""
        return np.asarray(self.deviation <= KNOWABLE * self.prior)

    @property
    def rms(self) -> float:
        """Root of the mean variance over the samples that count."""
        return math.sqrt(float(np.mean(self.deviation[self.scored] ** 2)))

    @property
    def knowable_share(self) -> float:
        """Share of the samples that count in which the target can be known."""
        return float(np.mean(self.knowable[self.scored]))


def channels_of(scenario: Scenario, given: Iterable[str] = ()) -> tuple[str, ...]:
    """Return the channels of a scenario that names of instruments or channels choose; none: all.

    Raises
    ------
    InputError
        If a name is unknown, or the scenario has no such instrument.
    """
    present = tuple(sensors_of(scenario, 0))
    instruments = {signal(channel).instrument for channel in present}
    chosen: list[str] = []
    for name in given:
        if name in instruments:
            chosen += [channel for channel in present if signal(channel).instrument == name]
        elif name in present:
            chosen.append(name)
        elif name in SIGNALS or name in {one.instrument for one in SIGNALS.values()}:
            raise InputError(
                f"{scenario.name}: its car has no '{name}'; it has {', '.join(sorted(instruments))}"
            )
        else:
            raise unknown("sensor", name, {*instruments, *present})
    names = set(chosen) if chosen else set(present)
    return tuple(channel for channel in present if channel in names)


def check_target(scenario: Scenario, target: str) -> None:
    """Raise InputError where the truth of a scenario has no such signal."""
    known = set(known_worlds()[scenario.world].truth_type.names or ()) - {"time", "gps_time"}
    if target not in known:
        raise unknown(f"target of {scenario.name}", target, known)


def bounds(
    scenario: Scenario,
    seed: int,
    sets: Sequence[tuple[str, ...]],
    targets: Sequence[str],
    step: float = STEP,
    share: float = SHARE,
) -> list[Bound]:
    """Return the bounds of one run for every set of channels and every target.

    Parameters
    ----------
    scenario
        See `gripbench.bench.bounds.model.reason_for_none`.
    seed
        Seed of the run.
    sets
        Sets of channels, as `channels_of` returns them.
    targets
        Signals of the truth.
    step, share
        As `gripbench.bench.bounds.model.linearise` takes them.

    Raises
    ------
    InputError
        If there is no bound for the scenario or the run, or a target is unknown.
    """
    for target in targets:
        check_target(scenario, target)
    sensors = sensors_of(scenario, seed)
    used = {name: sensors[name] for channels in sets for name in channels}
    model = linearise(scenario, seed, (*targets, *signals_of(used)), step, share)
    prior, _ = _least(model, (), targets)
    scored = model.time >= scenario.score_from - 1e-9
    if not scored.any():
        raise InputError(f"{scenario.name}: seed {seed} ends before its score begins")
    found = []
    for channels in sets:
        variance, gained = _least(model, channels, targets)
        if not np.isfinite(variance).all():
            raise InputError(
                f"{scenario.name}: seed {seed}: no bound: the recursion does not hold, a wheel "
                "beyond the peak of its tyre's force runs away within a sample"
            )
        for t, target in enumerate(targets):
            found.append(
                Bound(
                    scenario=scenario.name,
                    seed=seed,
                    channels=channels,
                    target=target,
                    time=model.time,
                    truth=model.truth[target],
                    deviation=np.sqrt(variance[:, t]),
                    prior=_rms(np.minimum(prior[scored, t], _LARGEST), model.truth[target][scored]),
                    gained=gained[:, t] / (model.time[1] - model.time[0]),
                    scored=scored,
                )
            )
    return found


_LARGEST = 1e100  # open loop, some cars' variances grow without bound


def _rms(variance: Floats, truth: Floats) -> float:
    return math.sqrt(float(min(np.mean(variance), np.mean(truth**2))))


def _least(
    model: Model, channels: tuple[str, ...], targets: Sequence[str]
) -> tuple[Floats, Floats]:
    whole = read(model, channels)
    rows = np.zeros((len(model.time), len(targets), whole.size))
    for t, target in enumerate(targets):
        rows[:, t, : len(model.names)] = model.slopes[target]
    return least_variance(whole.start, whole.motion, whole.readings, rows)
