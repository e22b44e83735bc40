import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gripbench.envs.tyres.combined import (
    BRUSH,
    DUGOFF,
    FITTED_CURVE,
    MAGIC_FORMULA,
    SHAPES,
    combined_force,
    secant,
    tangent,
)
from gripbench.envs.tyres.magic_formula import MAGIC_SHAPE

shapes = st.sampled_from(sorted(SHAPES.values()))
slips = st.floats(-50.0, 50.0)
stiffnesses = st.floats(1e3, 2e5)
capacities = st.floats(1.0, 1e4)


@settings(deadline=None)
@given(shapes, slips, slips, stiffnesses, stiffnesses, capacities)
def test_force_stays_in_the_friction_circle_and_opposes_sliding(shape, sx, sy, cx, cy, capacity):
    fx, fy = combined_force(shape, sx, sy, cx, cy, capacity)
    assert math.hypot(fx, fy) <= capacity * (1.0 + 1e-12)
    assert fx * sx >= 0.0
    assert fy * sy >= 0.0


@settings(deadline=None)
@given(shapes, slips, slips, stiffnesses, stiffnesses, capacities)
def test_force_is_odd_in_slip(shape, sx, sy, cx, cy, capacity):
    fx, fy = combined_force(shape, sx, sy, cx, cy, capacity)
    mirrored = combined_force(shape, -sx, -sy, cx, cy, capacity)
    across = combined_force(shape, sx, -sy, cx, cy, capacity)
    assert mirrored == (-fx, -fy)
    assert across == (fx, -fy)


@pytest.mark.parametrize("shape", SHAPES.values())
def test_slope_at_zero_slip_is_the_stiffness(shape):
    small = 1e-9
    fx, _ = combined_force(shape, small, 0.0, 6e4, 5e4, 2e3)
    _, fy = combined_force(shape, 0.0, small, 6e4, 5e4, 2e3)
    assert fx / small == pytest.approx(6e4, rel=1e-6)
    assert fy / small == pytest.approx(5e4, rel=1e-6)
    assert combined_force(shape, 0.0, 0.0, 6e4, 5e4, 2e3) == (0.0, 0.0)


@pytest.mark.parametrize("shape", SHAPES.values())
def test_a_wheel_in_the_air_gives_no_force(shape):
    assert combined_force(shape, 0.3, -0.2, 6e4, 5e4, 0.0) == (0.0, 0.0)


@pytest.mark.parametrize(("shape", "joint"), [(BRUSH, 3.0), (DUGOFF, 0.5), (MAGIC_FORMULA, 1e-6)])
def test_shapes_are_continuous_where_their_branches_meet(shape, joint):
    below = secant(shape, joint * (1.0 - 1e-12))
    above = secant(shape, joint * (1.0 + 1e-12))
    assert below == pytest.approx(above, rel=1e-9)


def test_brush_is_equation_15_of_yoon_with_the_slip_angle_absolute():
    mu, load, stiffness = 0.25, 6000.0, 5e4
    theta = stiffness / (3.0 * mu * load)  # 2 c_p l^2 / (3 mu F_z), and C = 2 c_p l^2
    for alpha in np.radians([-20.0, -2.0, -0.5, 0.3, 1.0, 4.0, 12.0]):
        sigma = math.tan(alpha)
        t = theta * abs(sigma)
        size = mu * load * (3.0 * t - 3.0 * t**2 + t**3 if t <= 1.0 else 1.0)
        _, force = combined_force(BRUSH, 0.0, sigma, 6e4, stiffness, mu * load)
        assert force == pytest.approx(math.copysign(size, alpha), rel=1e-12)


def test_dugoff_is_equations_2_to_4_of_dakhlallah_in_braking():
    mu, load, cx, cy = 0.8, 4000.0, 3e4, 5.7e4
    for ratio, alpha in [(-0.02, 0.01), (-0.1, 0.05), (-0.3, -0.2), (-0.01, -0.002)]:
        slide = 1.0 - abs(ratio)
        lam = mu * load * slide / (2.0 * math.hypot(cx * ratio, cy * math.tan(alpha)))
        f = (2.0 - lam) * lam if lam < 1.0 else 1.0
        fx, fy = combined_force(DUGOFF, ratio / slide, -math.tan(alpha) / slide, cx, cy, mu * load)
        assert fx == pytest.approx(cx * ratio / slide * f, rel=1e-12)
        assert fy == pytest.approx(-cy * math.tan(alpha) / slide * f, rel=1e-12)


def test_magic_formula_peaks_at_the_capacity_and_falls_behind_it():
    s = np.linspace(0.01, 30.0, 20000)
    force = np.array([secant(MAGIC_FORMULA, value) * value for value in s])
    peak = s[np.argmax(force)]
    assert force.max() == pytest.approx(1.0, abs=1e-6)
    assert peak == pytest.approx(MAGIC_SHAPE * math.tan(math.pi / (2.0 * MAGIC_SHAPE)), rel=1e-2)
    assert force[-1] < 0.92


@given(shapes, st.floats(1e-3, 60.0))
def test_tangent_is_the_slope_of_the_force(shape, s):
    step = 1e-6 * max(s, 1.0)
    ahead, behind = (secant(shape, at) * at for at in (s + step, s - step))
    assert tangent(shape, s) == pytest.approx((ahead - behind) / (2.0 * step), abs=2e-6)


def test_the_fitted_curve_peaks_at_one_where_burckhardt_does():
    s = np.linspace(0.0, 40.0, 40_001)[1:]
    force = np.array([secant(FITTED_CURVE, value) * value for value in s])
    assert force.max() == pytest.approx(1.0, abs=1e-6)
    # c1 c2 exp(-c2 lambda) = c3, and lambda is s times peak over initial slope
    slip = math.log(1.2801 * 23.99 / 0.52) / 23.99
    peak = 1.2801 * (1.0 - math.exp(-23.99 * slip)) - 0.52 * slip
    expected = slip * (1.2801 * 23.99 - 0.52) / peak
    assert s[force.argmax()] == pytest.approx(expected, abs=2e-3)
    assert force[-1] == pytest.approx((1.2801 * (1.0 - math.exp(-23.99)) - 0.52) / peak)
