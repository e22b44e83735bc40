"""A sample of truth in; the readings that the sensors make of it out, compiled.

The chain of one channel is: truth with the parts of a lever arm and of a misaligned axis, delay,
wheel pulses, scale, bias and drift, noise, low-pass, quantisation, sampling. The same compiled
function serves a whole recording and one sample of the Gymnasium environment.
"""

from __future__ import annotations

import numpy as np

from gripbench.compilation import compiled

SENSOR_TYPE = np.dtype(
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
SENSOR_STATE = np.dtype(
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
def measure_block(first, truth, specs, states, history, noise, walk, out):
    """Measure samples in a row; `first` is the number of the first, `out` the readings' rows.

    Parameters
    ----------
    first
        Number of the first sample.
    truth
        Shape (n, columns of the truth).
    specs, states
        Records of `SENSOR_TYPE` and `SENSOR_STATE`, shape (sensors,).
    history
        Ring of what was measured before any delay, shape (longest delay + 1, sensors).
    noise, walk
        Standard normal draws, shape (n, sensors).
    out
        Shape (n, columns of the observations).
    """
    for i in range(truth.shape[0]):
        _measure(first + i, truth[i], specs, states, history, noise[i], walk[i], out[i])


@compiled
def measure_lanes(lanes, samples, truth, specs, states, history, noise, walk, out):
    """Measure one sample of each of these lanes; the arrays of `measure_block` stacked by lane."""
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
