"""The sensors of a run and its truth in; observations out, of one run or of several at once.

Every channel draws from a stream of its own, so that a sensor's errors do not depend on which other
sensors there are.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from gripbench.envs.hidden_draws import entropy
from gripbench.envs.instruments.measuring import (
    SENSOR_STATE,
    SENSOR_TYPE,
    measure_block,
    measure_lanes,
)
from gripbench.envs.instruments.sensors import Sensor
from gripbench.envs.signals import NEW, record_type, signal
from gripbench.errors import InputError

_CHUNK = 1024  # random numbers are drawn ahead in blocks; the stream is the same for any size


class SensorSuite:
    """The sensors of one run.

    Parameters
    ----------
    sensors
        Sensor by channel.
    truth_type
        Structured type of the truth; its first field is `time`.
    sample_time
        Base sample time [s]; `None` when samples are not equally spaced (no delay then).
    seed
        Seed of the run.
    """

    def __init__(
        self,
        sensors: Mapping[str, Sensor],
        truth_type: np.dtype[Any],
        sample_time: float | None,
        seed: int,
    ) -> None:
        truth_names = truth_type.names or ()
        names = ["time"]
        for channel, sensor in sensors.items():
            signal(channel)
            names.append(channel)
            if sensor.rate > 0.0:
                names.append(channel + NEW)
        self.observation_type = record_type(names)
        self._specs = np.zeros(len(sensors), SENSOR_TYPE)
        self._states = np.zeros(len(sensors), SENSOR_STATE)
        self._streams: list[tuple[np.random.Generator, np.random.Generator]] = []
        for j, (channel, sensor) in enumerate(sensors.items()):
            source = sensor.source or channel
            if source not in truth_names:
                raise InputError(f"sensors.{channel}: the plant gives no '{source}' to measure")
            if sensor.delay > 0.0 and sample_time is None:
                raise InputError(f"sensors.{channel}.delay needs equally spaced samples")
            if sample_time is not None and sensor.rate * sample_time > 1.0 + 1e-9:
                raise InputError(
                    f"sensors.{channel}.rate is {sensor.rate:g} Hz: faster than the scenario's "
                    f"samples, {1.0 / sample_time:g} Hz"
                )
            first, drawn, walked = np.random.SeedSequence(
                entropy(seed, zlib.crc32(channel.encode()))
            ).spawn(3)
            constant = np.random.default_rng(first).standard_normal(3)
            self._streams.append((np.random.default_rng(drawn), np.random.default_rng(walked)))
            spec = self._specs[j]
            spec["column"] = truth_names.index(source)
            spec["bias"] = sensor.bias + sensor.bias_std * constant[0]
            spec["walk"] = sensor.bias_walk
            spec["scale"] = sensor.scale + sensor.scale_std * constant[1]
            spec["noise"] = sensor.noise_std
            spec["noise_hold"] = sensor.noise_hold
            spec["lowpass"] = sensor.lowpass
            spec["quantisation"] = sensor.quantisation
            spec["rate"] = sensor.rate
            spec["negative"] = sensor.negative_scale
            lean = sensor.misalignment + sensor.misalignment_std * constant[2]
            spec["cross"] = _column(truth_names, sensor.cross, channel, "cross") if lean else -1
            spec["lean"], spec["level"] = np.sin(lean), np.cos(lean)
            spec["turn"] = -1
            if sensor.lever_x or sensor.lever_y:
                spec["turn"] = _column(truth_names, "yaw_rate", channel, "lever_x")
                arms = levers(source, sensor, channel)
                spec["spin_lever"], spec["turn_lever"], spec["square_lever"] = arms
            spec["tooth"] = 2.0 * np.pi / sensor.pulses if sensor.pulses else 0.0
            spec["delay"] = round(sensor.delay / sample_time) if sample_time else 0
            spec["output"] = names.index(channel)
            spec["flag"] = names.index(channel + NEW) if sensor.rate > 0.0 else -1
        longest = int(self._specs["delay"].max(initial=0))
        self._history = np.zeros((longest + 1, len(sensors)))
        self._noise = np.zeros((_CHUNK, len(sensors)))
        self._walk = np.zeros((_CHUNK, len(sensors)))
        self._samples = 0

    def observe(self, truth: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Measure the next samples.

        Parameters
        ----------
        truth
            Structured array, shape (n,): the n samples that follow those already measured.

        Returns
        -------
        Structured array, shape (n,), of `observation_type`.
        """
        rows = _as_matrix(truth)
        observations = np.empty(len(truth), self.observation_type)
        out = _as_matrix(observations)
        done = 0
        while done < len(truth):
            at = self._samples % _CHUNK
            if at == 0:
                self._draw()
            take = min(_CHUNK - at, len(truth) - done)
            measure_block(
                self._samples,
                rows[done : done + take],
                self._specs,
                self._states,
                self._history,
                self._noise[at : at + take],
                self._walk[at : at + take],
                out[done : done + take],
            )
            self._samples += take
            done += take
        return observations

    def _draw(self) -> None:
        for j, (noise, walk) in enumerate(self._streams):
            if self._specs[j]["noise"] > 0.0:
                self._noise[:, j] = noise.standard_normal(_CHUNK)
            if self._specs[j]["walk"] > 0.0:
                self._walk[:, j] = walk.standard_normal(_CHUNK)


def _column(names: tuple[str, ...], wanted: str, channel: str, key: str) -> int:
    """Return the column of a signal of the truth that a sensor feels besides its own."""
    if wanted not in names:
        raise InputError(f"sensors.{channel}.{key}: the plant gives no '{wanted}'")
    return names.index(wanted)


def levers(source: str, sensor: Sensor, channel: str) -> tuple[float, float, float]:
    """Return what a lever arm puts before yaw acceleration, yaw rate and its square."""
    x, y = sensor.lever_x, sensor.lever_y
    known = {
        "accel_x": (-y, 0.0, -x),
        "accel_y": (x, 0.0, -y),
        "speed_x": (0.0, -y, 0.0),
        "speed_gps": (0.0, -y, 0.0),
        "speed_y": (0.0, x, 0.0),
    }
    if source not in known:
        raise InputError(
            f"sensors.{channel}.lever_x: a lever arm changes {', '.join(known)}, not '{source}'"
        )
    return known[source]


class SensorLanes:
    """The sensors of several runs, measured together in one compiled call.

    Parameters
    ----------
    suites
        Sensors of each lane, alike but for their seeds; they must not have measured yet.
    """

    def __init__(self, suites: list[SensorSuite]) -> None:
        self.observation_type = suites[0].observation_type
        self._suites = suites
        self._samples = np.zeros(len(suites), np.int64)
        self._stacks = {
            name: np.stack([getattr(suite, name) for suite in suites]) for name in _LANE_ARRAYS
        }
        for lane, suite in enumerate(suites):
            self._adopt(lane, suite)

    def replace(self, lane: int, suite: SensorSuite) -> None:
        """Start a lane afresh; `suite` must not have measured yet."""
        for name in _LANE_ARRAYS:
            self._stacks[name][lane] = getattr(suite, name)
        self._samples[lane] = 0
        self._suites[lane] = suite
        self._adopt(lane, suite)

    def observe(
        self, truth: npt.NDArray[Any], lanes: npt.NDArray[np.intp] | None = None
    ) -> npt.NDArray[Any]:
        """Measure the next sample of each lane.

        Parameters
        ----------
        truth
            Structured array, shape (lanes,).
        lanes
            Numbers of the lanes that have a next sample; all unless given. The others' rows of
            the result are zero.

        Returns
        -------
        Structured array, shape (lanes,), of `observation_type`.
        """
        if lanes is None:
            lanes = np.arange(len(truth))
        for lane in lanes[self._samples[lanes] % _CHUNK == 0]:
            self._suites[lane]._draw()
        observations = np.zeros(len(truth), self.observation_type)
        stacks = [self._stacks[name] for name in _LANE_ARRAYS]
        measure_lanes(lanes, self._samples, _as_matrix(truth), *stacks, _as_matrix(observations))
        self._samples[lanes] += 1
        return observations

    def _adopt(self, lane: int, suite: SensorSuite) -> None:
        """Let a suite draw into the lane's part of the stacks."""
        for name in _LANE_ARRAYS:
            setattr(suite, name, self._stacks[name][lane])


_LANE_ARRAYS = ("_specs", "_states", "_history", "_noise", "_walk")


def _as_matrix(records: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """View records of float64 fields as a matrix, one row a record."""
    return records.view(np.float64).reshape(len(records), -1)
