"""Brush identification: known tyres are found, the uncertainty is honest, c_p and l are one."""

import numpy as np
import pytest

from gripbench.bench.papers.yoon2015.brush_identification import (
    PARAMETERS,
    LateralTest,
    identify,
    modelled_acceleration,
    separability,
)
from gripbench.errors import InputError
from gripbench.logs.vehicle.brush_fit import brush_force
from gripbench.methods.friction_ekf import brush_force as force_of_filter

VEHICLE = {"mass": 2450.0, "cg_to_front": 1.573, "cg_to_rear": 2.085}
TRUE = np.array([100e3, 94e3, 0.25])


def synthetic(seed, n=400, noise=0.1, size=0.15, bias=0.1, memory=0.0):
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 20.0, n)
    slips = size * np.sin(0.7 * t), 0.9 * size * np.sin(0.7 * t - 0.3)
    test = LateralTest(*slips, 0.1 * np.sin(0.7 * t), np.zeros(n))
    accel = modelled_acceleration(test, VEHICLE, TRUE) + bias
    errors = rng.normal(size=n)
    for k in range(1, n):
        errors[k] = memory * errors[k - 1] + np.sqrt(1.0 - memory**2) * errors[k]
    accel += noise * errors
    return LateralTest(test.slip_front, test.slip_rear, test.steer, accel)


def test_force_is_that_of_the_filter():
    angles = np.linspace(-0.5, 0.5, 41)
    ours = brush_force(angles, 5e4, 0.3 * 6e3)
    filters = [force_of_filter(angle, 0.3, 6e3, 5e4)[0] for angle in angles]
    np.testing.assert_allclose(ours, filters, rtol=1e-12, atol=1e-9)


def test_exact_data_give_the_exact_tyre():
    found = identify([synthetic(0, noise=0.0), synthetic(0, noise=0.0, bias=-0.2)], VEHICLE)
    for name, true in zip(PARAMETERS, TRUE, strict=True):
        assert found.values[name] == pytest.approx(true, rel=1e-5)
    assert found.residual_rms < 1e-6


@pytest.mark.parametrize("memory", [0.0, 0.7])
def test_uncertainty_covers_the_error(memory):
    """Over 40 noise seeds the normalised errors have the spread of a standard normal."""
    normalised = []
    for seed in range(40):
        found = identify([synthetic(seed, memory=memory)], VEHICLE)
        normalised.append(
            [
                (found.values[name] - true) / found.standard_deviations[name]
                for name, true in zip(PARAMETERS, TRUE, strict=True)
            ]
        )
    spread = np.sqrt(np.mean(np.square(normalised), axis=0))
    assert (spread > 0.7).all()
    assert (spread < 1.4).all()


def test_gentle_tests_do_not_tell_the_friction():
    gentle = identify([synthetic(1, size=0.01, noise=0.02)], VEHICLE)
    hard = identify([synthetic(1, size=0.15, noise=0.02)], VEHICLE)
    assert gentle.standard_deviations["mu"] > 5.0 * hard.standard_deviations["mu"]


def test_only_the_product_of_tread_stiffness_and_length_squared_is_identifiable():
    angles = np.linspace(-0.3, 0.3, 60)
    ratio, direction = separability(angles, 0.3, 6e3, 3e6, 0.09)
    assert ratio < 1e-7
    np.testing.assert_allclose(direction, np.array([1.0, 2.0]) / np.sqrt(5.0), rtol=1e-6)


def test_too_few_or_bad_samples_are_refused():
    with pytest.raises(InputError, match="10 samples, at least 20"):
        identify([synthetic(0, n=10)], VEHICLE)
    bad = synthetic(0)
    bad.accel_y[3] = np.nan
    with pytest.raises(InputError, match="test 0 has a sample that is not finite"):
        identify([bad], VEHICLE)
