"""Sensors: what an instrument makes of the truth.

The chain of one channel is: truth with the parts of a lever arm and of a misaligned axis, delay,
wheel pulses, scale, bias and drift, noise, low-pass, quantisation, sampling. The same compiled
function serves a whole recording and one sample of the Gymnasium environment, and every channel
draws from a stream of its own, so that a sensor's errors do not depend on which other sensors there
are.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from gripbench.compilation import compiled
from gripbench.configuration import CONFIGS, Configuration, named_file, parse, read_toml
from gripbench.envs.signals import NEW, record_type, signal
from gripbench.errors import InputError

_CHUNK = 1024  # random numbers are drawn ahead in blocks; the stream is the same for any size


class Sensor(Configuration):
    """Errors and sampling of one channel; an empty table is a perfect sensor.

    Attributes
    ----------
    source
        Truth that is measured; empty: the signal of the channel's own name.
    bias, bias_std
        Constant error, and the standard deviation of one that is drawn for each seed.
    bias_walk
        Drift of the bias: standard deviation after one second.
    scale, scale_std
        Scale factor, and the standard deviation of its error that is drawn for each seed.
    noise_std
        Standard deviation of white noise, one draw each sample.
    noise_hold
        Time [s] for which one draw of the noise is held; 0: a sample.
    lowpass
        Time constant [s] of a first-order low-pass behind the noise; 0: none.
    quantisation
        Step of the reading; 0: none.
    rate
        Samples a second, the reading is held between them and `<channel>_new` marks the new
        ones; 0: every sample.
    delay
        Age [s] of the truth in a reading.
    negative_scale
        Further scale factor of readings below zero: braking torque beside driving torque.
    cross, misalignment, misalignment_std
        Signal along the axis into which the instrument leans, by which angle [rad], and the
        standard deviation of one that is drawn for each seed.
    lever_x, lever_y
        Place of an accelerometer or speed sensor before and left of the centre of gravity [m].
    pulses
        Teeth of a wheel speed sensor's ring: the reading is the mean speed between the last tooth
        of this reading and that of the one before; 0: the speed itself.
    """

    source: str = ""
    bias: float = 0.0
    bias_std: float = Field(default=0.0, ge=0.0)
    bias_walk: float = Field(default=0.0, ge=0.0)
    scale: float = Field(default=1.0, gt=0.0)
    scale_std: float = Field(default=0.0, ge=0.0)
    noise_std: float = Field(default=0.0, ge=0.0)
    noise_hold: float = Field(default=0.0, ge=0.0)
    lowpass: float = Field(default=0.0, ge=0.0)
    quantisation: float = Field(default=0.0, ge=0.0)
    rate: float = Field(default=0.0, ge=0.0)
    delay: float = Field(default=0.0, ge=0.0, le=10.0)
    negative_scale: float = Field(default=1.0, gt=0.0)
    cross: str = ""
    misalignment: float = Field(default=0.0, ge=-0.5, le=0.5)
    misalignment_std: float = Field(default=0.0, ge=0.0, le=0.2)
    lever_x: float = Field(default=0.0, ge=-10.0, le=10.0)
    lever_y: float = Field(default=0.0, ge=-10.0, le=10.0)
    pulses: int = Field(default=0, ge=0, le=10000)

    @model_validator(mode="after")
    def _check_cross(self) -> Self:
        if (self.misalignment or self.misalignment_std) and not self.cross:
            raise ValueError("misalignment needs 'cross': the signal along the other axis")
        return self


class _SuiteFile(Configuration):
    name: str
    description: str
    sensors: dict[str, Sensor]


def load_sensor_suite(name: str) -> dict[str, Sensor]:
    """Return the sensors of a suite that ships, or of the path of a TOML file, by channel."""
    files = {path.stem: path for path in (CONFIGS / "sensors").glob("*.toml")}
    path = named_file("sensor suite", name, files)
    return parse(_SuiteFile, read_toml(path), path).sensors


_SPEC = np.dtype(
    [
        ("column", np.int64),  # of the truth that is measured
        ("bias", np.float64),
        ("walk", np.float64),
        ("scale", np.float64),
        ("noise", np.float64),
        ("noise_hold", np.float64),
        ("lowpass", np.float64),
        ("quantisation", np.float64),
        ("rate", np.float64),
        ("delay", np.int64),  # samples
        ("negative", np.float64),  # further scale below zero
        ("cross", np.int64),  # column of the axis into which it leans, -1: none
        ("lean", np.float64),  # sine of the misalignment
        ("level", np.float64),  # its cosine
        ("turn", np.int64),  # column of the yaw rate, -1: no lever arm
        ("spin_lever", np.float64),  # over the yaw acceleration
        ("turn_lever", np.float64),  # over the yaw rate
        ("square_lever", np.float64),  # over its square
        ("tooth", np.float64),  # angle between two teeth [rad], 0: none
        ("output", np.int64),  # column of the reading
        ("flag", np.int64),  # column of its `_new` flag, -1: none
    ]
)
_STATE = np.dtype(
    [
        ("drift", np.float64),
        ("noise", np.float64),
        ("noise_index", np.float64),
        ("filtered", np.float64),
        ("reading", np.float64),
        ("sample_index", np.float64),
        ("time", np.float64),
        ("yaw_rate", np.float64),
        ("angle", np.float64),  # of the wheel beyond its last tooth [rad]
        ("teeth", np.float64),  # since the last reading
        ("tooth_time", np.float64),  # when the last tooth passed
        ("counted", np.float64),  # speed of the last reading
        ("counted_time", np.float64),  # the same, of the last reading
    ]
)


@compiled
def _count_teeth(time, elapsed, speed, new, spec, state):
    """Return the wheel speed [rad/s] that the times of the teeth give.

    Where no tooth has passed since the last reading, the wheel turns no faster than the time since
    then allows.
    """
    state.angle += abs(speed) * elapsed
    passed = np.floor(state.angle / spec.tooth)
    if passed > 0.0:
        state.teeth += passed
        state.angle -= passed * spec.tooth
        state.tooth_time = time - state.angle / abs(speed)
    if elapsed <= 0.0:
        state.counted = speed  # the reading before the first teeth is right
    elif new and state.teeth > 0.0:
        span = state.tooth_time - state.counted_time
        counted = state.teeth * spec.tooth / span if span > 0.0 else abs(speed)
        state.counted = counted if speed >= 0.0 else -counted
        state.counted_time = state.tooth_time
        state.teeth = 0.0
    elif new:
        most = spec.tooth / (time - state.counted_time)
        state.counted = min(max(state.counted, -most), most)
    return state.counted


@compiled
def _measure(k, truth, specs, states, history, noise, walk, out):
    """Measure sample `k`: all arguments are rows of this sample, `history` a ring of the past."""
    time = truth[0]
    out[0] = time
    length = history.shape[0]
    for j in range(specs.shape[0]):
        spec = specs[j]
        state = states[j]
        elapsed = time - state.time if k > 0 else 0.0
        value = truth[spec.column]
        if spec.turn >= 0:
            rate = truth[spec.turn]
            spin = (rate - state.yaw_rate) / elapsed if elapsed > 0.0 else 0.0
            state.yaw_rate = rate
            value += spec.spin_lever * spin + (spec.turn_lever + spec.square_lever * rate) * rate
        if spec.cross >= 0:
            value = spec.level * value + spec.lean * truth[spec.cross]
        history[k % length, j] = value
        value = history[max(k - spec.delay, 0) % length, j]
        state.time = time
        new = True
        if spec.rate > 0.0:
            sample = np.floor(time * spec.rate + 1e-9)
            new = k == 0 or sample != state.sample_index
        if spec.tooth > 0.0:
            value = _count_teeth(time, elapsed, value, new, spec, state)
        state.drift += spec.walk * np.sqrt(elapsed) * walk[j]
        index = np.floor(time / spec.noise_hold + 1e-9) if spec.noise_hold > 0.0 else float(k)
        if k == 0 or index != state.noise_index:
            state.noise_index = index
            state.noise = spec.noise * noise[j]
        value = spec.scale * value + spec.bias + state.drift + state.noise
        if spec.lowpass > 0.0:
            if k > 0:
                share = -np.expm1(-elapsed / spec.lowpass)
                value = state.filtered + share * (value - state.filtered)
            state.filtered = value
        if value < 0.0:
            value *= spec.negative
        if spec.quantisation > 0.0:
            value = spec.quantisation * np.round(value / spec.quantisation)
        if spec.rate > 0.0:
            if new:
                state.sample_index = sample
                state.reading = value
            value = state.reading
            out[spec.flag] = 1.0 if new else 0.0
        out[spec.output] = value


@compiled
def _measure_block(first, truth, specs, states, history, noise, walk, out):
    for i in range(truth.shape[0]):
        _measure(first + i, truth[i], specs, states, history, noise[i], walk[i], out[i])


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
        self._specs = np.zeros(len(sensors), _SPEC)
        self._states = np.zeros(len(sensors), _STATE)
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
                [seed, zlib.crc32(channel.encode())]
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
                levers = _levers(source, sensor, channel)
                spec["spin_lever"], spec["turn_lever"], spec["square_lever"] = levers
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
            _measure_block(
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
        _measure_lanes(lanes, self._samples, _as_matrix(truth), *stacks, _as_matrix(observations))
        self._samples[lanes] += 1
        return observations

    def _adopt(self, lane: int, suite: SensorSuite) -> None:
        """Let a suite draw into the lane's part of the stacks."""
        for name in _LANE_ARRAYS:
            setattr(suite, name, self._stacks[name][lane])


_LANE_ARRAYS = ("_specs", "_states", "_history", "_noise", "_walk")


@compiled
def _measure_lanes(lanes, samples, truth, specs, states, history, noise, walk, out):
    for lane in lanes:
        k = samples[lane]
        at = k % noise.shape[1]
        _measure(
            k,
            truth[lane],
            specs[lane],
            states[lane],
            history[lane],
            noise[lane, at],
            walk[lane, at],
            out[lane],
        )


def _column(names: tuple[str, ...], wanted: str, channel: str, key: str) -> int:
    """Return the column of a signal of the truth that a sensor feels besides its own."""
    if wanted not in names:
        raise InputError(f"sensors.{channel}.{key}: the plant gives no '{wanted}'")
    return names.index(wanted)


def _levers(source: str, sensor: Sensor, channel: str) -> tuple[float, float, float]:
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


def _as_matrix(records: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """View records of float64 fields as a matrix, one row a record."""
    return records.view(np.float64).reshape(len(records), -1)
