"""Sideslip filter of Yoon, Li & Ahn (2015), eq. 9-12: velocities from accelerometers and late GPS.

A Kalman filter over v_x, b_x, v_y, b_y, the velocities and the biases of the accelerometers. The
accelerometers drive it (eq. 9), the GPS velocity turned into vehicle axes by the heading filter's
attitude corrects it (eq. 10-11).

Errata corrected: eq. 8 has the wrong sign of psi' v_y in its first row, eq. 9 is right and used
here; the third row of eq. 10 gives v_z; eq. 12 is beta = atan2(v_y, v_x), printed with the two
exchanged.

GPS velocity arrives 400 ms late, five times a second: while one measurement is on its way, two
more are taken. The filter that holds here runs at the age of the last measurement; each new one
moves it forward through the recorded inputs, corrects it where the measurement was true, and a
copy replays the inputs since then to the present. That is exact for any number of measurements
in flight. The measurement shifting of Larsen et al. (1998), which the paper cites, carries one
gain to the present and is exact for a single measurement in flight only; here it diverges
(`delay_handling = "larsen"`). A sample that is repeated, older than the last one taken, from the
future or older than the recorded inputs is left out and counted.
"""

from __future__ import annotations

import numpy as np

from gripbench.methods.blocks.kalman import correct_scalar, filter_type, predict
from gripbench.methods.contract import Parameter, compiled

IGNORE_DELAY, REPLAY, LARSEN = 0.0, 1.0, 2.0
"""The choices of the parameter `delay_handling`, as the step sees them."""

_HISTORY = 1024
_TIME, _ACCEL_X, _ACCEL_Y, _YAW_RATE, _YAW, _ROLL, _YAW_VARIANCE = range(7)

SIDESLIP_STATE = np.dtype(
    [
        ("now", filter_type(4)),  # v_x, b_x, v_y, b_y at the last sample
        ("late", filter_type(4)),  # the same at the last GPS measurement taken
        ("late_time", np.float64),
        ("late_next", np.int64),  # input that comes next for `late`
        ("started", np.int64),
        ("steps", np.int64),
        ("left_out", np.int64),
        ("inputs", np.float64, (_HISTORY, 7)),
        ("past_x", np.float64, (_HISTORY, 4)),  # of `now`, for Larsen's formula
        ("past_P", np.float64, (_HISTORY, 4, 4)),
        ("transition", np.float64, (4, 4)),
    ]
)
"""State of the sideslip filter; `now.x` is v_x [m/s], b_x [m/s^2], v_y [m/s], b_y [m/s^2]."""

SIDESLIP_PARAMETERS = (
    Parameter("velocity_walk", 0.03, "m/s/sqrt(s)", "Random walk of the velocities", 0.0, 100.0),
    Parameter("bias_walk", 0.03, "m/s^2/sqrt(s)", "Random walk of the biases", 0.0, 100.0),
    Parameter("bias_std", 0.2, "m/s^2", "First standard deviation of the biases", 0.0, 10.0),
    Parameter("gps_std", 0.07, "m/s", "Noise of the GPS velocity in vehicle axes", 1e-6, 100.0),
    Parameter(
        "heading_share", 0.25, "-",
        "Share of the heading's standard deviation that differs from sample to sample", 0.0, 1.0,
    ),
    Parameter(
        "delay_handling", "replay", "-", "What becomes of the age of a GPS sample",
        choices=("ignored", "replay", "larsen"),
    ),
)  # fmt: skip


@compiled
def velocity_in_vehicle(yaw, roll, north, west, up):
    """Return v_x and v_y [m/s] from the velocity in earth axes, eq. 10, at zero pitch."""
    forward = np.cos(yaw) * north + np.sin(yaw) * west
    level = -np.sin(yaw) * north + np.cos(yaw) * west
    return forward, np.cos(roll) * level + np.sin(roll) * up


@compiled
def sideslip_predict(f, accel_x, accel_y, yaw_rate, elapsed, params):
    """Advance velocities and biases by eq. 9 over `elapsed` [s] with constant inputs.

    The turn of the axes is exact, the acceleration is taken at half the turn: errors are of third
    order in the time.

    Parameters
    ----------
    f
        Filter of four states.
    accel_x, accel_y
        Accelerations [m/s^2] less gravity's components.
    yaw_rate
        Rate of the heading [rad/s].
    elapsed
        Time [s].
    params
        Record with `velocity_walk` and `bias_walk`.
    """
    turn = yaw_rate * elapsed
    cosine, sine = np.cos(turn), np.sin(turn)
    along, across = elapsed * np.cos(0.5 * turn), elapsed * np.sin(0.5 * turn)
    F, Q = f.F, f.Q
    F[0, 0], F[0, 1], F[0, 2], F[0, 3] = cosine, -along, sine, -across
    F[1, 0], F[1, 1], F[1, 2], F[1, 3] = 0.0, 1.0, 0.0, 0.0
    F[2, 0], F[2, 1], F[2, 2], F[2, 3] = -sine, across, cosine, -along
    F[3, 0], F[3, 1], F[3, 2], F[3, 3] = 0.0, 0.0, 0.0, 1.0
    Q[0, 0] = params.velocity_walk**2 * elapsed
    Q[1, 1] = params.bias_walk**2 * elapsed
    Q[2, 2] = Q[0, 0]
    Q[3, 3] = Q[1, 1]
    predict(f)
    f.x[0] += along * accel_x + across * accel_y
    f.x[2] += along * accel_y - across * accel_x


@compiled
def sideslip_update(f, speed_x, speed_y, variance_x, variance_y):
    """Take a measurement of both velocities [m/s] with their variances [m^2/s^2], eq. 11."""
    f.h[:] = 0.0
    f.h[0] = 1.0
    correct_scalar(f, speed_x - f.x[0], variance_x)
    f.h[0] = 0.0
    f.h[2] = 1.0
    correct_scalar(f, speed_y - f.x[2], variance_y)


@compiled
def sideslip_estimate(f):
    """Return the sideslip angle [rad] of eq. 12 and its variance; zero below walking pace."""
    speed_x, speed_y = f.x[0], f.x[2]
    squared = speed_x**2 + speed_y**2
    if squared < 0.25:
        return 0.0, (np.pi / 2.0) ** 2
    variance = (
        speed_x**2 * f.P[2, 2] + speed_y**2 * f.P[0, 0] - 2.0 * speed_x * speed_y * f.P[0, 2]
    ) / squared**2
    return np.arctan2(speed_y, speed_x), max(variance, 0.0)


@compiled
def _advance(sideslip, f, time, following, until, params):
    """Move a filter from `time` to `until` through the inputs from `following` on; return the next.

    The input in row k holds between the samples k - 1 and k.
    """
    inputs = sideslip.inputs
    length = inputs.shape[0]
    while following < sideslip.steps and time < until:
        row = inputs[following % length]
        end = min(row[_TIME], until)
        if end > time:
            sideslip_predict(f, row[_ACCEL_X], row[_ACCEL_Y], row[_YAW_RATE], end - time, params)
            time = end
        if row[_TIME] <= time:
            following += 1
    return following


@compiled
def _first_after(sideslip, time):
    """Return the number of the first sample that is not before `time`."""
    length = sideslip.inputs.shape[0]
    oldest = max(sideslip.steps - length, 0)
    number = sideslip.steps - 1
    while number > oldest and sideslip.inputs[(number - 1) % length, _TIME] >= time:
        number -= 1
    return number


@compiled
def _take(f, sideslip, number, time, north, west, up, params):
    """Correct a filter that stands at `time` with a GPS velocity that was true then."""
    row = sideslip.inputs[number % sideslip.inputs.shape[0]]
    yaw = row[_YAW] - row[_YAW_RATE] * (row[_TIME] - time)
    speed_x, speed_y = velocity_in_vehicle(yaw, row[_ROLL], north, west, up)
    noise = params.gps_std**2
    yaw_variance = row[_YAW_VARIANCE]
    sideslip_update(
        f, speed_x, speed_y, noise + speed_y**2 * yaw_variance, noise + speed_x**2 * yaw_variance
    )


@compiled
def _begin(sideslip, time, north, west, up, params):
    number = _first_after(sideslip, time)
    row = sideslip.inputs[number % sideslip.inputs.shape[0]]
    speed_x, speed_y = velocity_in_vehicle(row[_YAW], row[_ROLL], north, west, up)
    late = sideslip.late
    late.x[0], late.x[1], late.x[2], late.x[3] = speed_x, 0.0, speed_y, 0.0
    late.P[0, 0] = params.gps_std**2 + speed_y**2 * row[_YAW_VARIANCE]
    late.P[2, 2] = params.gps_std**2 + speed_x**2 * row[_YAW_VARIANCE]
    late.P[1, 1] = params.bias_std**2
    late.P[3, 3] = params.bias_std**2
    sideslip.late_time = time
    sideslip.late_next = number
    sideslip.started = 1


@compiled
def _replay(sideslip, params):
    """Bring the present filter from the age of the last measurement to the last sample."""
    sideslip.now.x[:] = sideslip.late.x
    sideslip.now.P[:] = sideslip.late.P
    _advance(sideslip, sideslip.now, sideslip.late_time, sideslip.late_next, np.inf, params)


@compiled
def _shift(sideslip, time, north, west, up, params):
    """Take a late measurement by Larsen's formula for a single one in flight.

    The gain is that of the time of the measurement, carried to the present by the transition in
    between, as if nothing had been corrected since then.
    """
    length = sideslip.inputs.shape[0]
    number = _first_after(sideslip, time)
    late, now, M = sideslip.late, sideslip.now, sideslip.transition
    late.x[:] = sideslip.past_x[number % length]
    late.P[:] = sideslip.past_P[number % length]
    late.Q[:] = 0.0
    M[:] = 0.0
    for i in range(4):
        M[i, i] = 1.0
    scratch = late.work
    for k in range(number + 1, sideslip.steps):
        row = sideslip.inputs[k % length]
        elapsed = row[_TIME] - sideslip.inputs[(k - 1) % length, _TIME]
        turn = row[_YAW_RATE] * elapsed
        cosine, sine = np.cos(turn), np.sin(turn)
        along, across = elapsed * np.cos(0.5 * turn), elapsed * np.sin(0.5 * turn)
        for j in range(4):
            ahead, bias_x, left, bias_y = M[0, j], M[1, j], M[2, j], M[3, j]
            M[0, j] = cosine * ahead - along * bias_x + sine * left - across * bias_y
            M[2, j] = -sine * ahead + across * bias_x + cosine * left - along * bias_y
    row = sideslip.inputs[number % length]
    measured = velocity_in_vehicle(row[_YAW], row[_ROLL], north, west, up)
    for axis in range(2):
        state = 2 * axis
        noise = params.gps_std**2 + measured[1 - axis] ** 2 * row[_YAW_VARIANCE]
        residual = measured[axis] - late.x[state]
        spread = late.P[state, state] + noise
        for i in range(4):
            gain = 0.0
            for j in range(4):
                gain += M[i, j] * late.P[j, state]
            scratch[0, i] = gain
        for i in range(4):
            now.x[i] += scratch[0, i] / spread * residual
            for j in range(4):
                now.P[i, j] -= scratch[0, i] * scratch[0, j] / spread
        late.h[:] = 0.0
        late.h[state] = 1.0
        correct_scalar(late, residual, noise)


@compiled
def sideslip_step(sideslip, time, accel_x, accel_y, yaw_rate, yaw, roll, yaw_variance, params):
    """Record the inputs that held since the last sample and advance the present filter.

    Parameters
    ----------
    sideslip
        Record of `SIDESLIP_STATE`.
    time
        Time [s]; a sample that is not later than the last one is left out.
    accel_x, accel_y
        Accelerations [m/s^2] less gravity's components.
    yaw_rate
        Rate of the heading [rad/s].
    yaw, roll, yaw_variance
        Attitude [rad] at `time` and the heading's variance [rad^2].
    params
        Record with the parameters of `SIDESLIP_PARAMETERS`.
    """
    length = sideslip.inputs.shape[0]
    before = sideslip.inputs[(sideslip.steps - 1) % length, _TIME] if sideslip.steps else time
    if sideslip.steps and time <= before:
        return
    row = sideslip.inputs[sideslip.steps % length]
    if sideslip.started and sideslip.late_next <= sideslip.steps - length:
        # No GPS for as long as the inputs are recorded: the late filter takes the oldest in.
        sideslip.late_next = _advance(
            sideslip, sideslip.late, sideslip.late_time, sideslip.late_next, row[_TIME], params
        )
        sideslip.late_time = row[_TIME]
    row[_TIME], row[_ACCEL_X], row[_ACCEL_Y], row[_YAW_RATE] = time, accel_x, accel_y, yaw_rate
    row[_YAW], row[_ROLL] = yaw, roll
    row[_YAW_VARIANCE] = params.heading_share**2 * yaw_variance
    sideslip.steps += 1
    if sideslip.started:
        sideslip_predict(sideslip.now, accel_x, accel_y, yaw_rate, time - before, params)
    if params.delay_handling == LARSEN:
        sideslip.past_x[(sideslip.steps - 1) % length] = sideslip.now.x
        sideslip.past_P[(sideslip.steps - 1) % length] = sideslip.now.P


@compiled
def sideslip_gps(sideslip, gps_time, north, west, up, params):
    """Take a GPS velocity [m/s] that was true at `gps_time` [s]; call after `sideslip_step`.

    Returns
    -------
    Whether the measurement was used; one that is repeated, out of order, from the future or
    older than the recorded inputs is not.
    """
    length = sideslip.inputs.shape[0]
    latest = sideslip.inputs[(sideslip.steps - 1) % length, _TIME]
    oldest = sideslip.inputs[max(sideslip.steps - length, 0) % length, _TIME]
    finite = np.isfinite(north) and np.isfinite(west) and np.isfinite(up)
    known = oldest <= gps_time <= latest
    if not (finite and known) or (sideslip.started and gps_time <= sideslip.late_time):
        sideslip.left_out += 1
        return False
    taken_at = latest if params.delay_handling == IGNORE_DELAY else gps_time
    if not sideslip.started:
        _begin(sideslip, taken_at, north, west, up, params)
        _replay(sideslip, params)
        if params.delay_handling == LARSEN:
            sideslip.past_x[:] = sideslip.now.x
            sideslip.past_P[:] = sideslip.now.P
    elif params.delay_handling == LARSEN:
        _shift(sideslip, gps_time, north, west, up, params)
        sideslip.past_x[(sideslip.steps - 1) % length] = sideslip.now.x
        sideslip.past_P[(sideslip.steps - 1) % length] = sideslip.now.P
    elif params.delay_handling == IGNORE_DELAY:
        number = sideslip.steps - 1
        _take(sideslip.now, sideslip, number, latest, north, west, up, params)
    else:
        late = sideslip.late
        sideslip.late_next = _advance(
            sideslip, late, sideslip.late_time, sideslip.late_next, gps_time, params
        )
        number = _first_after(sideslip, gps_time)
        _take(late, sideslip, number, gps_time, north, west, up, params)
    sideslip.late_time = gps_time
    if params.delay_handling == REPLAY:
        _replay(sideslip, params)
    return True
