"""One step of an extended Kalman filter on the single-track model with brush tyres.

States are v_y and r; behind them may stand ln C_f and ln C_r over the values on paper and ln mu,
in this order (five states), or ln mu alone (three).
"""

from __future__ import annotations

from math import exp, log

from gripbench.compilation import compiled
from gripbench.methods.blocks.kalman import correct_scalar, predict_covariance
from gripbench.methods.blocks.single_track import motion, static_loads

_LEAST, _LARGEST = log(0.05), log(1.4)


@compiled
def evaluate_track(x, speed, steer, friction, params, out):
    """Fill `out`, shape (2, 7), as `motion` does; `friction` is used where mu is no state."""
    n = x.shape[0]
    mu = exp(x[n - 1]) if n > 2 else friction
    front, rear = params.cornering_stiffness_front, params.cornering_stiffness_rear
    if n == 5:
        front, rear = front * exp(x[2]), rear * exp(x[3])
    load_front, load_rear = static_loads(params)
    motion(speed, x, steer, front, rear, mu * load_front, mu * load_rear, params, out)


@compiled
def _slope(out, row, k, n):
    """Return the slope of a row of `out` to state `k` of `n`."""
    if k < 2:
        return out[row, 1 + k]
    if n == 5 and k < 4:
        return out[row, 2 + k]  # columns 4 and 5
    return out[row, 3]


@compiled
def predict_track(filter, span, speed, steer, friction, params, out):
    """Advance by `span` [s]; the caller has set what of Q belongs to states behind the second."""
    x, F, Q = filter.x, filter.F, filter.Q
    n = x.shape[0]
    evaluate_track(x, speed, steer, friction, params, out)
    for i in range(n):
        for k in range(n):
            F[i, k] = 1.0 if i == k else 0.0
    for k in range(n):
        F[0, k] += span * _slope(out, 0, k, n)
        F[1, k] += span * _slope(out, 1, k, n)
    F[0, 1] -= span * speed
    Q[0, 0] = params.speed_y_walk**2 * span
    Q[1, 1] = params.yaw_rate_walk**2 * span
    x[0] += span * (out[0, 0] - speed * x[1])
    x[1] += span * out[1, 0]
    predict_covariance(filter)


@compiled
def correct_track(filter, span, speed, steer, friction, yaw_rate, accel_y, params, out):
    """Take yaw rate and a_y; return of each the distance, the variance and the innovation.

    The distance is the innovation squared over its variance.
    """
    x, h, P = filter.x, filter.h, filter.P
    n = x.shape[0]
    h[:] = 0.0
    h[1] = 1.0
    noise = params.gyro_noise**2 / span
    first = P[1, 1] + noise
    rate = yaw_rate - x[1]
    distance = correct_scalar(filter, rate, noise)
    evaluate_track(x, speed, steer, friction, params, out)
    for k in range(n):
        h[k] = _slope(out, 0, k, n)
    noise = params.accel_y_noise**2 / span
    second = noise
    for i in range(n):
        for k in range(n):
            second += h[i] * P[i, k] * h[k]
    accel = accel_y - out[0, 0]
    other = correct_scalar(filter, accel, noise)
    if n > 2:
        x[n - 1] = min(max(x[n - 1], _LEAST), _LARGEST)
    if n == 5:
        x[2], x[3] = min(max(x[2], -1.0), 1.0), min(max(x[3], -1.0), 1.0)
    return (distance, first, rate), (other, second, accel)
