"""A linearised run and the channels that are read in, what each reading says of the unknown out.

An instrument's own errors are unknown too: bias with its drift, scale, misalignment, noise behind a
low-pass; and of the car the ratio and zero of its steering, the gain of its torque signal. Each is
one more entry of what is unknown. Quantisation counts as noise of a twelfth of its step's square, a
wheel's pulses as the speed itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gripbench.bench.bounds.model import Model
from gripbench.bench.bounds.recursion import DIRECT, NONE, Motion, Readings
from gripbench.envs.instruments.sensors import Sensor
from gripbench.envs.instruments.suite import levers
from gripbench.envs.plants.trajectory import Floats

_ROUNDING = 1e-9  # of a reading without any error, over the largest value of its signal


@dataclass(frozen=True)
class Read:
    """A model together with what is read of it.

    Attributes
    ----------
    start
        Covariance of what is unknown at the start.
    motion, readings
        How it moves, what is read.
    size
        Number of entries of what is unknown.
    """

    start: Floats
    motion: Motion
    readings: Readings
    size: int


def source_of(channel: str, sensor: Sensor) -> str:
    """Return the truth that a channel measures."""
    return sensor.source or channel


def signals_of(sensors: dict[str, Sensor]) -> tuple[str, ...]:
    """Return the signals of the truth on which channels depend."""
    found = [source_of(channel, sensor) for channel, sensor in sensors.items()]
    return (*found, *(sensor.cross for sensor in sensors.values() if sensor.cross), "yaw_rate")


class _Unknowns:
    """Entries that come on top of the model's, and the rows of the readings."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.first = len(model.names)
        self.variances: list[float] = []
        self.decays: list[float] = []
        self.spreads: list[float] = []
        self.shared: dict[str, int] = {}

    def add(self, variance: float, spread: float = 0.0, decay: float = 1.0) -> int:
        """Return the place of a new entry; `spread` is what a sample adds to its variance."""
        self.variances.append(variance)
        self.spreads.append(spread)
        self.decays.append(decay)
        return self.first + len(self.variances) - 1

    def cause(self, name: str) -> int | None:
        """Return the place of a cause that several channels share; None: it does not vary."""
        deviation = self.model.deviations.get(name, 0.0)
        if deviation == 0.0:
            return None
        if name not in self.shared:
            self.shared[name] = self.add(deviation**2)
        return self.shared[name]


def read(model: Model, channels: tuple[str, ...]) -> Read:
    """Return what is read of a run through channels.

    Parameters
    ----------
    model
        The run; it has the slopes of `signals_of` these channels.
    channels
        Names of the channels; those that say nothing of the unknown (a clock) are left out.
    """
    unknowns = _Unknowns(model)
    step = float(model.time[1] - model.time[0])
    found = []
    for channel in channels:
        sensor = model.sensors[channel]
        own = _reading(channel, sensor, model, unknowns, step)
        if own is not None:
            found.append((sensor, *own))
    slots = [_in_flight(sensor, model, step) for sensor, *_ in found]
    first_slot = unknowns.first + len(unknowns.variances)
    size = first_slot + sum(slots)
    n = len(model.time)
    rows = np.zeros((n, len(found), size))
    take = np.full((n, len(found)), NONE)
    given = np.full((n, len(found)), NONE)
    variance = np.zeros(len(found))
    for j, (sensor, dense, more, noise) in enumerate(found):
        rows[:, j, : unknowns.first] = dense
        for place, slope in more.items():
            rows[:, j, place] = slope
        new = np.flatnonzero(_new(model.time, _rate(sensor, model)))
        variance[j] = noise * _together(sensor, model, step)
        late = _late(sensor, step)
        if slots[j] == 0:
            given[new, j] = DIRECT
            continue
        before = new - late
        known = before >= 0
        slot = first_slot + sum(slots[:j]) + np.arange(len(new)) % slots[j]
        take[before[known], j] = slot[known]
        given[new[known], j] = slot[known]
    return Read(
        start=_padded(model.start, unknowns, size),
        motion=_with(model.motion, unknowns, size),
        readings=Readings(rows, variance, take, given),
        size=size,
    )


def _reading(
    channel: str, sensor: Sensor, model: Model, unknowns: _Unknowns, step: float
) -> tuple[Floats, dict[int, Floats | float], float] | None:
    """Return a channel's slope to the model's unknown, to its own, and its noise's variance."""
    source = source_of(channel, sensor)
    value, slope = model.truth[source], model.slopes[source]
    if not np.any(slope):
        return None
    if (sensor.lever_x or sensor.lever_y) and model.yaw_acceleration is not None:
        spin, turn, square = levers(source, sensor, channel)
        turning, to_turning = model.truth["yaw_rate"], model.slopes["yaw_rate"]
        value = value + spin * model.yaw_acceleration[0] + (turn + square * turning) * turning
        slope = slope + spin * model.yaw_acceleration[1]
        slope = slope + (turn + 2.0 * square * turning)[:, None] * to_turning
    if sensor.cross:
        slope = slope + math.sin(sensor.misalignment) * model.slopes[sensor.cross]
    negative = np.where(value < 0.0, sensor.negative_scale, 1.0)
    factor = sensor.scale * negative
    more: dict[int, Floats | float] = {}
    if sensor.bias_std or sensor.bias_walk:
        more[unknowns.add(sensor.bias_std**2, sensor.bias_walk**2 * step)] = 1.0
    if sensor.scale_std:
        more[unknowns.add(sensor.scale_std**2)] = value
    if sensor.cross and sensor.misalignment_std:
        more[unknowns.add(sensor.misalignment_std**2)] = model.truth[sensor.cross]
    shared: tuple[tuple[str, Floats | float], ...] = ()
    if channel == "steer_angle":
        shared = (("car.steering_ratio", value), ("car.steering_offset", 1.0))
    elif channel.startswith("torque_"):
        shared = (
            ("car.torque_gain", value),
            ("car.brake_gain", np.where(value < 0.0, value, 0.0)),
        )
    for name, to_cause in shared:
        place = unknowns.cause(name)
        if place is not None:
            more[place] = to_cause
    noise = sensor.noise_std**2
    if sensor.lowpass > 0.0 and noise > 0.0:
        hold = math.exp(-(sensor.noise_hold or model.sample_time) / sensor.lowpass)
        coloured = noise * (1.0 - hold) / (1.0 + hold)
        keep = math.exp(-step / sensor.lowpass)
        more[unknowns.add(coloured, coloured * (1.0 - keep**2), keep)] = 1.0
        noise = 0.0
    noise += sensor.quantisation**2 / 12.0
    exact = (_ROUNDING * max(float(np.abs(value).max()), 1e-300)) ** 2
    return factor[:, None] * slope, more, max(noise, exact)


def _rate(sensor: Sensor, model: Model) -> float:
    """Return how many readings with noise of their own a channel gives in a second."""
    rate = sensor.rate or 1.0 / model.sample_time
    return min(rate, 1.0 / sensor.noise_hold) if sensor.noise_hold and not sensor.lowpass else rate


def _together(sensor: Sensor, model: Model, step: float) -> float:
    """Return the variance of the mean of the readings of one sample, over that of one."""
    return min(1.0 / (_rate(sensor, model) * step), 1.0)


def _new(time: Floats, rate: float) -> np.ndarray:
    """Return at which samples a channel of a rate [Hz] has a new reading."""
    number = np.floor(time * rate + 1e-6)
    return np.diff(number, prepend=number[0] - 1.0) > 0.0


def _late(sensor: Sensor, step: float) -> int:
    return round(sensor.delay / step)


def _in_flight(sensor: Sensor, model: Model, step: float) -> int:
    """Return how many readings are taken but not yet given at a time."""
    late = _late(sensor, step)
    period = max(1.0 / (_rate(sensor, model) * step), 1.0)
    return math.ceil(late / period - 1e-9) if late else 0


def _padded(start: Floats, unknowns: _Unknowns, size: int) -> Floats:
    whole = np.zeros((size, size))
    whole[: unknowns.first, : unknowns.first] = start
    places = np.arange(unknowns.first, unknowns.first + len(unknowns.variances))
    whole[places, places] = unknowns.variances
    return whole


def _with(motion: Motion, unknowns: _Unknowns, size: int) -> Motion:
    n = len(motion.decay)
    decay, spread = np.ones((n, size)), np.zeros((n, size))
    decay[:, : unknowns.first], spread[:, : unknowns.first] = motion.decay, motion.spread
    last = unknowns.first + len(unknowns.variances)
    decay[:, unknowns.first : last] = unknowns.decays
    spread[:, unknowns.first : last] = unknowns.spreads
    return replace(motion, decay=decay, spread=spread)
