"""The sideslip filter: a filterpy twin, delays against an exact batch solution, odd GPS samples."""

from types import SimpleNamespace

import numba
import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from scipy.spatial.transform import Rotation

from gripbench.methods.blocks.kalman import filter_type
from gripbench.methods.sideslip_kalman_filter import (
    IGNORE_DELAY,
    LARSEN,
    REPLAY,
    SIDESLIP_STATE,
    sideslip_estimate,
    sideslip_gps,
    sideslip_predict,
    sideslip_step,
    sideslip_update,
    velocity_in_vehicle,
)

NOISE = {
    "velocity_walk": 0.03,
    "bias_walk": 0.03,
    "bias_std": 0.2,
    "gps_std": 0.07,
    "heading_share": 1.0,
}
DT = 0.01


def parameters(delay_handling=REPLAY):
    values = NOISE | {"delay_handling": delay_handling}
    record = np.zeros(1, [(name, float) for name in values])
    for name, value in values.items():
        record[name] = value
    return record


def test_velocity_in_vehicle_is_a_rotation():
    turned = Rotation.from_euler("ZYX", [0.8, 0.0, 0.1]).inv().apply([3.0, -4.0, 0.5])
    np.testing.assert_allclose(
        velocity_in_vehicle(0.8, 0.1, 3.0, -4.0, 0.5), turned[:2], rtol=1e-12
    )


def transition(turn):
    """Exact discrete form of eq. 9 but for the acceleration's place in the turn."""
    c, s = np.cos(turn), np.sin(turn)
    a, b = DT * np.cos(turn / 2), DT * np.sin(turn / 2)
    return np.array([[c, -a, s, -b], [0, 1, 0, 0], [-s, b, c, -a], [0, 0, 0, 1.0]])


def step_noise():
    walk, bias = NOISE["velocity_walk"] ** 2 * DT, NOISE["bias_walk"] ** 2 * DT
    return np.diag([walk, bias, walk, bias])


def test_predict_and_update_agree_with_filterpy():
    rng = np.random.default_rng(2)
    ours, params = np.zeros(1, filter_type(4)), parameters()
    twin = KalmanFilter(dim_x=4, dim_z=2)
    twin.x = np.array([15.0, 0.0, 1.0, 0.0])
    twin.P = np.diag([0.3, 0.04, 0.2, 0.04])
    ours["x"][0], ours["P"][0] = twin.x, twin.P
    twin.H = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0]])
    twin.Q = step_noise()
    for k in range(300):
        turn, accel = 0.5 * rng.normal() * DT, rng.normal(size=2)
        B = -transition(turn)[:, [1, 3]]
        B[[1, 3]] = 0.0
        twin.predict(u=accel, B=B, F=transition(turn))
        sideslip_predict(ours[0], *accel, turn / DT, DT, params[0])
        if k % 20 == 0:
            z, R = np.array([15.0, 1.0]) + rng.normal(size=2), np.array([0.01, 0.02])
            twin.update(z, R=np.diag(R))
            sideslip_update(ours[0], *z, *R)
        np.testing.assert_allclose(ours["x"][0], twin.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(ours["P"][0], twin.P, rtol=1e-9, atol=1e-12)


def test_prediction_matches_the_continuous_equation():
    from scipy.integrate import solve_ivp

    ours, params = np.zeros(1, filter_type(4)), parameters()
    start = np.array([15.0, 0.3, 2.0, -0.2])
    ours["x"][0] = start

    def rates(_, x):
        return [1.0 - x[1] + 0.6 * x[2], 0.0, 2.0 - x[3] - 0.6 * x[0], 0.0]

    for _ in range(100):
        sideslip_predict(ours[0], 1.0, 2.0, 0.6, DT, params[0])
    exact = solve_ivp(rates, (0.0, 1.0), start, rtol=1e-10, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(ours["x"][0], exact, atol=1e-4)


@numba.njit
def _run(state, times, inputs, arrivals, gps, yaw_variance, params, out):
    """Rows of `gps`: true at, north, west; taken at the samples `arrivals` (-1 ends)."""
    following = 0
    for k in range(times.shape[0]):
        turn, yaw = inputs[k, 2], inputs[k, 3]
        sideslip_step(
            state, times[k], inputs[k, 0], inputs[k, 1], turn, yaw, 0.0, yaw_variance, params
        )
        while following < arrivals.shape[0] and arrivals[following] == k:
            sideslip_gps(
                state, gps[following, 0], gps[following, 1], gps[following, 2], 0.0, params
            )
            following += 1
        for i in range(4):
            out[k, i] = state.now.x[i]
            for j in range(4):
                out[k, 4 + 4 * i + j] = state.now.P[i, j]


def scene(seed=0, duration=20.0, period=0.2, delay=0.4):
    """Noisy inputs and GPS of a turning car with biased accelerometers; heading known."""
    rng = np.random.default_rng(seed)
    n = round(duration / DT)
    times = np.arange(n) * DT
    yaw_rate = 0.4 * np.sin(0.7 * times)
    vx, vy = 15.0 + 2.0 * np.sin(0.3 * times), 1.5 * np.sin(0.8 * times)
    ax = 0.6 * np.cos(0.3 * times) - yaw_rate * vy + 0.2 + 0.02 * rng.normal(size=n)
    ay = 1.2 * np.cos(0.8 * times) + yaw_rate * vx - 0.15 + 0.02 * rng.normal(size=n)
    yaw = np.concatenate([[0.0], np.cumsum(yaw_rate[1:] * DT)])
    inputs = np.column_stack([ax, ay, yaw_rate, yaw])
    taken = np.arange(0, n, round(period / DT))
    north = vx * np.cos(yaw) - vy * np.sin(yaw)
    west = vx * np.sin(yaw) + vy * np.cos(yaw)
    noise = 0.05 * rng.normal(size=(len(taken), 2))
    gps = np.column_stack([times[taken], north[taken] + noise[:, 0], west[taken] + noise[:, 1]])
    arrivals = taken + round(delay / DT)
    return SimpleNamespace(
        times=times, inputs=inputs, gps=gps, arrivals=arrivals, vx=vx, vy=vy,
        beta=np.arctan2(vy, vx),
    )  # fmt: skip


def run(case, delay_handling=REPLAY, yaw_std=0.0):
    state = np.zeros(1, SIDESLIP_STATE)
    out = np.zeros((len(case.times), 20))
    params = parameters(delay_handling)[0]
    _run(
        state[0], case.times, case.inputs, case.arrivals, case.gps, yaw_std**2, params, out
    )  # fmt: skip
    return out, state


def batch_solution(case, until):
    """Mean and covariance of the state at sample `until` given all GPS that arrived by then.

    One linear least-squares problem over the start and every process-noise sample: no recursion
    in common with the filter.
    """
    known = [i for i in range(len(case.gps)) if case.arrivals[i] <= until]
    first = round(case.gps[known[0], 0] / DT)
    # state k = A_k start + offset_k + sum_j G_kj w_j, covariance between any two by propagation
    states = [np.array([0.0, 0.0, 0.0, 0.0])]
    speeds = velocity_in_vehicle(case.inputs[first, 3], 0.0, *case.gps[known[0], 1:], 0.0)
    states[0][[0, 2]] = speeds
    prior = np.diag([NOISE["gps_std"] ** 2, NOISE["bias_std"] ** 2] * 2)
    transitions = []
    for k in range(first + 1, until + 1):
        ax, ay, yaw_rate, _ = case.inputs[k]
        F = transition(yaw_rate * DT)
        transitions.append(F)
        states.append(F @ states[-1] - F[:, 1] * ax * [1, 0, 1, 0] - F[:, 3] * ay * [1, 0, 1, 0])
    covariances = [prior]
    for F in transitions:
        covariances.append(F @ covariances[-1] @ F.T + step_noise())
    used = [round(case.gps[i, 0] / DT) - first for i in known[1:]]

    def cross(a, b):
        """Covariance of the states a and b, samples after `first`."""
        if a < b:
            return cross(b, a).T
        P = covariances[b]
        for F in transitions[b:a]:
            P = F @ P
        return P

    H = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0]])
    m = len(used)
    S = np.zeros((2 * m, 2 * m))
    C = np.zeros((4, 2 * m))
    residual = np.zeros(2 * m)
    last = until - first
    for i, a in enumerate(used):
        C[:, 2 * i : 2 * i + 2] = cross(last, a) @ H.T
        for j, b in enumerate(used):
            S[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] = H @ cross(a, b) @ H.T
        yaw = case.inputs[a + first, 3]
        z = velocity_in_vehicle(yaw, 0.0, *case.gps[known[1 + i], 1:], 0.0)
        residual[2 * i : 2 * i + 2] = z - H @ states[a]
    S += np.eye(2 * m) * NOISE["gps_std"] ** 2
    K = np.linalg.solve(S, C.T).T
    return states[last] + K @ residual, covariances[last] - K @ C.T


@pytest.mark.parametrize("delay", [0.0, 0.13, 0.4, 0.63])
def test_replay_is_exact_with_any_number_in_flight(delay):
    case = scene(duration=3.0, delay=delay)
    out, _ = run(case)
    for until in (120, 250, 299):
        mean, covariance = batch_solution(case, until)
        np.testing.assert_allclose(out[until, :4], mean, rtol=0, atol=1e-8)
        np.testing.assert_allclose(out[until, 4:].reshape(4, 4), covariance, rtol=0, atol=1e-9)


def test_replay_is_exact_for_gps_between_samples():
    """GPS halfway between two samples equals a run sampled twice as finely."""
    case = scene(duration=4.0)
    shifted = case.gps.copy()
    shifted[:, 0] += 0.5 * DT
    coarse, _ = run(SimpleNamespace(**(vars(case) | {"gps": shifted})))
    fine = np.repeat(case.inputs, 2, axis=0)[1:]
    yaw_rate = fine[:, 2]
    fine[:, 3] = np.concatenate([[0.0], np.cumsum(yaw_rate[1:] * 0.5 * DT)])
    times = np.arange(len(fine)) * 0.5 * DT
    halves = SimpleNamespace(times=times, inputs=fine, gps=shifted, arrivals=2 * case.arrivals)
    refined, _ = run(halves)
    np.testing.assert_allclose(refined[::2][-1, :4], coarse[-1, :4], atol=2e-5)


def test_larsens_formula_is_exact_for_one_in_flight():
    case = scene(duration=6.0, period=0.4, delay=0.4)
    replayed, _ = run(case)
    shifted, _ = run(case, LARSEN)
    np.testing.assert_allclose(shifted[-1, :4], replayed[-1, :4], rtol=0, atol=1e-7)


def test_larsens_formula_diverges_with_two_in_flight():
    """The same measurements, heading known to 1 degree: the paper's 5 Hz and 400 ms."""
    diverged = 0
    for seed in range(10):
        case = scene(seed=seed)
        replayed, _ = run(case, yaw_std=np.radians(1.0))
        shifted, _ = run(case, LARSEN, yaw_std=np.radians(1.0))
        assert (
            np.abs(replayed[300:, [0, 2]] - np.column_stack([case.vx, case.vy])[300:]).max() < 0.5
        )
        assert shifted[:, 4 + 10].min() < 0.0  # a variance, of v_y
        diverged += np.abs(shifted[:, 2] - case.vy).max() > 100.0
    assert diverged == 10


def test_ignoring_the_delay_costs_accuracy_and_a_bias_is_learnt():
    case = scene()
    replayed, _ = run(case)
    ignored, _ = run(case, IGNORE_DELAY)
    error = np.sqrt(np.mean((replayed[300:, 2] - case.vy[300:]) ** 2))
    assert np.sqrt(np.mean((ignored[300:, 2] - case.vy[300:]) ** 2)) > 5.0 * error
    np.testing.assert_allclose(replayed[-1, [1, 3]], [0.2, -0.15], atol=0.05)


def _with_gps(case, order, **changes):
    return SimpleNamespace(**(vars(case) | {"gps": case.gps[order]} | changes))


def test_repeated_and_out_of_order_samples_change_nothing():
    case = scene(duration=8.0)
    clean, _ = run(case)
    n = len(case.gps)
    repeated = np.repeat(np.arange(n), 2)
    twice, state = run(_with_gps(case, repeated, arrivals=np.repeat(case.arrivals, 2)))
    np.testing.assert_array_equal(twice, clean)
    assert state["left_out"][0] == np.sum(case.arrivals < len(case.times))
    # Each sample is followed by the one before it once more.
    order = np.ravel(np.column_stack([np.arange(1, n), np.arange(n - 1)]))
    arrivals = np.repeat(case.arrivals[1:], 2)
    skipped, _ = run(_with_gps(case, np.arange(1, n), arrivals=case.arrivals[1:]))
    mixed, _ = run(_with_gps(case, order, arrivals=arrivals))
    np.testing.assert_array_equal(mixed, skipped)


def test_samples_from_the_future_and_not_finite_are_left_out():
    case = scene(duration=4.0)
    clean, _ = run(_with_gps(case, np.delete(np.arange(len(case.gps)), [5, 7]),
                             arrivals=np.delete(case.arrivals, [5, 7])))  # fmt: skip
    gps = case.gps.copy()
    gps[5, 0] = 100.0
    gps[7, 1] = np.nan
    dirty, state = run(SimpleNamespace(**(vars(case) | {"gps": gps})))
    np.testing.assert_array_equal(dirty, clean)
    assert state["left_out"][0] == 2


def test_long_outage_is_bridged():
    """Longer than the record of the inputs (1024 samples): no restart, and it recovers."""
    case = scene(duration=40.0)
    kept = (case.gps[:, 0] < 8.0) | (case.gps[:, 0] > 25.0)
    out, state = run(_with_gps(case, kept, arrivals=case.arrivals[kept]))
    assert state["left_out"][0] == 0
    assert np.isfinite(out).all()
    at = np.searchsorted(case.times, 30.0)
    assert np.abs(out[at:, 2] - case.vy[at:]).max() < 0.3
    assert out[2500, 4 + 10] > 4.0 * out[700, 4 + 10]  # variance of v_y grew in between


def test_sideslip_and_its_variance():
    ours = np.zeros(1, filter_type(4))
    ours["x"][0] = [15.0, 0.0, 1.5, 0.0]
    root = np.random.default_rng(3).normal(size=(4, 4)) * 0.01
    ours["P"][0] = root @ root.T
    angle, variance = sideslip_estimate(ours[0])
    assert angle == pytest.approx(np.arctan2(1.5, 15.0))
    draws = np.random.default_rng(4).multivariate_normal(ours["x"][0], ours["P"][0], 200_000)
    assert variance == pytest.approx(np.var(np.arctan2(draws[:, 2], draws[:, 0])), rel=0.02)
    ours["x"][0] = 0.0
    assert sideslip_estimate(ours[0]) == (0.0, pytest.approx((np.pi / 2) ** 2))
