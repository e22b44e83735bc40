"""Moving-horizon estimator and fixed-lag smoother: their twins, their lag, what they import."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from track_twin import drive, rates

from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.running import execution
from gripbench.bench.scoring.scoring import at_lag, score
from gripbench.methods.blocks.track_nodes import between, between_slopes

CAR = drive().vehicle


def settings_of(name):
    method = choose_method(name, "measured_speed").make()
    return method, method._fresh(CAR, 1).params


def plain_residuals(before, after, window, noise):
    """Return what two nodes leave open, from the model in plain NumPy."""
    span, speed, first, last, turning, accel = window
    middle = 0.5 * (first + last)

    def slope(x, steer):
        return np.array([*rates(x, speed, steer, CAR)[:2], 0.0, 0.0, 0.0])

    one = slope(before, first)
    two = slope(before + 0.5 * span * one, middle)
    three = slope(before + 0.5 * span * two, middle)
    four = slope(before + span * three, last)
    moved = before + span / 6.0 * (one + 2.0 * two + 2.0 * three + four)
    walks = np.array(
        [noise["speed_y_walk"], noise["yaw_rate_walk"], *2 * [noise["stiffness_walk"]],
         noise["friction_walk"]]
    )  # fmt: skip
    force = 0.5 * (rates(before, speed, first, CAR)[2] + rates(after, speed, last, CAR)[2])
    readings = [
        (turning - 0.5 * (before[1] + after[1])) / noise["gyro_noise"],
        (accel - force) / noise["accel_y_noise"],
    ]
    return np.array([*((after - moved) / walks / np.sqrt(span)), *np.multiply(readings, span**0.5)])


NODES = (
    np.array([-0.4, 0.25, 0.05, -0.1, np.log(0.35)]),
    np.array([-0.5, 0.27, 0.06, -0.1, np.log(0.36)]),
)
BETWEEN = np.array([0.05, 14.0, 0.05, 0.06, 0.26, 2.9])


def test_factor_is_the_plain_model_and_its_slopes_are_derivatives():
    method, params = settings_of("fixed_lag_smoother_500ms")
    residual, slopes, again = np.empty(7), np.empty((7, 10)), np.empty(7)
    between_slopes(*NODES, BETWEEN, params, residual, slopes)
    expected = plain_residuals(*NODES, BETWEEN, method.settings)
    np.testing.assert_allclose(residual, expected, rtol=1e-9, atol=1e-9)
    step = np.array([1e-4, -2e-5, 3e-5, 1e-5, -2e-5])
    between(NODES[0], NODES[1] + step, BETWEEN, params, again)
    np.testing.assert_allclose(again - residual, slopes[:, 5:] @ step, rtol=2e-3, atol=2e-3)


def test_horizon_is_solved_as_scipy_solves_it():
    pytest.importorskip("casadi")
    from gripbench.methods import moving_horizon_estimator as module

    method, _ = settings_of("moving_horizon_estimator")
    run = drive()
    method.reset(CAR, 0.01)
    horizon = method._running
    names = run.observations.dtype.names
    for sample in run.observations[700:820].tolist():
        method.update(dict(zip(names, sample, strict=True)))
    assert horizon._filled == module.HORIZON
    windows, data = horizon._windows, horizon._data
    root, mean = data[:25].reshape(5, 5, order="F"), data[25:30]

    def residuals(z):
        parts = [root @ (np.append(z[:2], z[-3:]) - mean)]
        for k, window in enumerate(windows):
            ends = [np.append(z[2 * j : 2 * j + 2], z[-3:]) for j in (k, k + 1)]
            parts.append(plain_residuals(*ends, window, method.settings)[[0, 1, 5, 6]])
        return np.concatenate(parts)

    found = horizon._unknowns
    np.testing.assert_allclose(
        np.asarray(horizon._function(found, data)[0]).ravel(),
        residuals(found),
        rtol=1e-6,
        atol=1e-6,
    )
    twin = least_squares(residuals, found + 1e-3, x_scale=0.1, xtol=1e-12, ftol=1e-12, gtol=1e-10)
    np.testing.assert_allclose(found, twin.x, atol=2e-4)
    information = twin.jac.T @ twin.jac
    place = 2 * module.HORIZON
    variance = np.linalg.inv(information)[place, place]
    assert method._records.state["variance"][0, 0] == pytest.approx(variance, rel=0.02)


@pytest.mark.parametrize("name", ["moving_horizon_estimator", "fixed_lag_smoother_500ms"])
def test_solvers_follow_a_slide_and_start_afresh(name):
    spec = choose_method(name, "measured_speed")
    pytest.importorskip(spec.declaration.packages[0])
    run = drive()
    method = spec.make()
    found = method.run(CAR, run.observations)
    again = method.run(CAR, run.observations[:200])
    assert again.tobytes() == found[:200].tobytes()
    past = at_lag(run, spec.declaration.lag)
    late = past.truth["time"] > 6.0
    error = (found["sideslip"] - past.truth["sideslip"])[late]
    assert np.sqrt(np.mean(error**2)) < 0.6 * np.sqrt(np.mean(run.truth["sideslip"][late] ** 2))
    assert (found["sideslip_variance"] > 0.0).all()


def test_what_is_late_is_compared_with_the_past():
    run = drive()
    lag = 0.25
    copy = np.zeros(len(run.truth), [("sideslip", float)])
    copy["sideslip"][25:] = run.truth["sideslip"][:-25]
    exact = score(copy, ("sideslip",), ("sideslip",), at_lag(run, lag))
    assert exact["sideslip"]["rms"].value == pytest.approx(0.0, abs=1e-15)
    assert score(copy, ("sideslip",), ("sideslip",), run)["sideslip"]["rms"].value > 1e-3
    assert at_lag(run, 0.0) is run
    assert np.isnan(at_lag(run, lag).truth["sideslip"][:25]).all()


def test_without_its_package_a_method_is_skipped(monkeypatch):
    declaration = choose_method("moving_horizon_estimator").declaration
    channels = drive().observations.dtype.names
    monkeypatch.setattr(execution, "find_spec", lambda name: None)
    reason = execution.missing(declaration, CAR, channels)
    assert reason == "the package 'casadi' is not installed: pip install casadi"
