import math

import numpy as np
import pytest

from gripbench.envs.drivers.path_drivers import (
    SineSteer,
    SineThenSquareSteer,
    SquareSteer,
    StepSteer,
    steering_angles,
    wrapped,
)
from gripbench.envs.roads.road import SPACING, MagneticField, Road, disturb_field, lay_road

NO_PATH = np.zeros(0)


def test_noise_has_its_deviation_and_correlation_length():
    road = Road(mu=0.5, bank_std=0.01, grade_std=0.02, correlation_length=40.0)
    bank, grade, surface = lay_road(road, NO_PATH, 60000.0, 7).profile.T
    lag = round(40.0 / SPACING)
    for profile, deviation in ((bank, 0.01), (grade, 0.02)):
        assert profile.std() == pytest.approx(deviation, rel=0.1)
        correlation = np.corrcoef(profile[:-lag], profile[lag:])[0, 1]
        assert correlation == pytest.approx(math.exp(-1.0), abs=0.1)
    assert abs(np.corrcoef(bank, grade)[0, 1]) < 0.15
    assert (surface == 1.0).all()


def test_profiles_depend_on_the_seed_alone():
    road = Road(mu=0.5, bank_std=0.01)
    one, same, other = (lay_road(road, NO_PATH, 500.0, seed).profile for seed in (1, 1, 2))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def test_turns_are_banked_inwards_in_proportion_to_curvature():
    curvature = np.concatenate([np.zeros(100), np.full(100, 0.01), np.full(100, -0.005)])
    bank = lay_road(Road(mu=0.5, turn_bank=0.14), curvature, 60.0, 0).profile[:, 0]
    assert (bank[:100] == 0.0).all()
    assert np.allclose(bank[100:200], -0.14)  # a left turn lowers the left side
    assert np.allclose(bank[200:240], 0.07)


def test_an_undisturbed_field_stays_so_and_pulses_keep_their_rate_and_size():
    assert not disturb_field(MagneticField(), 0.01, 1000, 3).any()
    field = MagneticField(pulse_rate=0.15)
    added = disturb_field(field, 0.01, 200000, 3)
    size = np.linalg.norm(added, axis=1)
    strong = size > 7.5e-7
    pulses = np.count_nonzero(np.diff(strong.astype(int)) == 1)
    assert pulses == pytest.approx(0.15 * 2000.0, rel=0.3)
    assert 5e-6 < size.max() < 3e-5
    assert np.median(size) < 1e-7


def test_slow_noise_has_its_deviation_and_correlation_time():
    added = disturb_field(MagneticField(slow_std=3e-7, slow_time=2.0), 0.02, 400000, 3)
    assert added.std(axis=0) == pytest.approx([3e-7] * 3, rel=0.1)
    lag = round(2.0 / 0.02)
    correlation = np.corrcoef(added[:-lag, 0], added[lag:, 0])[0, 1]
    assert correlation == pytest.approx(math.exp(-1.0), abs=0.1)


def test_open_loop_steering_follows_its_closed_form():
    time = np.arange(0.0, 30.0, 0.01)
    step = steering_angles(StepSteer(kind="step_steer", start=1.0, amplitude=0.1, rise=0.5), time)
    assert (step[time <= 1.0] == 0.0).all()
    assert np.allclose(step[time >= 1.5], 0.1)
    sine = steering_angles(
        SineSteer(kind="sine_steer", amplitude=0.1, frequency=0.5, build_up=2.0, end=20.0), time
    )
    assert np.allclose(sine[200:2000], 0.1 * np.sin(np.pi * time[200:2000]))
    assert (sine[2000:] == 0.0).all()
    square = steering_angles(
        SquareSteer(kind="square_steer", amplitude=0.1, frequency=0.2, sharpness=50.0), time
    )
    middle = square[np.abs(np.sin(0.4 * np.pi * time)) > 0.2]
    assert np.abs(np.abs(middle[300:]) - 0.1).max() < 1e-6
    both = steering_angles(SineThenSquareSteer(kind="sine_then_square_steer", amplitude=0.1), time)
    assert np.allclose(both[200:1800], 0.1 * np.sin(0.8 * np.pi * time[200:1800]))
    assert np.abs(both).max() <= 0.1 + 1e-12


def test_angles_wrap_into_half_a_turn():
    angles = np.linspace(-20.0, 20.0, 4001)
    folded = np.array([wrapped(angle) for angle in angles])
    assert np.abs(folded).max() <= math.pi
    assert np.allclose(np.exp(1j * folded), np.exp(1j * angles))
