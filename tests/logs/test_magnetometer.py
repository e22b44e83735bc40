import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gripbench.errors import InputError
from gripbench.logs.vehicle.magnetometer import fit_ellipse, hard_iron_at_heading


@settings(max_examples=50, deadline=None)
@given(
    st.floats(-60e-6, 60e-6), st.floats(-60e-6, 60e-6), st.floats(0.8, 1.25),
    st.floats(-0.15, 0.15), st.floats(2.5, 6.2), st.floats(0.0, 6.2),
)  # fmt: skip
def test_hard_and_soft_iron_are_undone(x0, y0, scale, skew, arc, start):
    angle = np.linspace(start, start + arc, 400)
    x, y = 20e-6 * np.cos(angle), -20e-6 * np.sin(angle)
    found = fit_ellipse(x0 + scale * x + skew * y, y0 + skew * x + y / scale)
    np.testing.assert_allclose(found.centre, [x0, y0], atol=1e-9)
    calibrated = found.apply(x0 + scale * x + skew * y, y0 + skew * x + y / scale)
    np.testing.assert_allclose(np.hypot(*calibrated), found.radius, rtol=1e-5)


def test_noise_is_averaged():
    rng = np.random.default_rng(0)
    angle = np.linspace(0.0, 2 * np.pi, 2000)
    noise = 0.5e-6 * rng.standard_normal((2, 2000))
    found = fit_ellipse(5e-6 + 20e-6 * np.cos(angle) + noise[0], 20e-6 * np.sin(angle) + noise[1])
    np.testing.assert_allclose(found.centre, [5e-6, 0.0], atol=0.1e-6)


@pytest.mark.parametrize("kind", ["straight", "short", "few"])
def test_what_is_no_ellipse_is_refused(kind):
    rng = np.random.default_rng(1)
    angle = {"straight": np.zeros(500), "short": np.linspace(0, 1.0, 500), "few": np.zeros(5)}[kind]
    noise = 0.3e-6 * rng.standard_normal((2, len(angle))) * (kind == "straight")
    with pytest.raises(InputError, match="magnetometer"):
        fit_ellipse(20e-6 * np.cos(angle) + noise[0], 20e-6 * np.sin(angle) + noise[1])


def test_hard_iron_at_a_known_heading():
    yaw, declination, iron = np.full(50, 0.3), -0.2, np.array([1e-6, -30e-6, 60e-6])
    earth = np.array([20e-6 * np.cos(0.5), -20e-6 * np.sin(0.5), -40e-6])
    field = (earth + iron)[:, None] * np.ones(50)
    found = hard_iron_at_heading(field, yaw, 20e-6, -40e-6, declination)
    np.testing.assert_allclose(found, iron, atol=1e-15)
