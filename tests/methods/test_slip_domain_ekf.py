"""The filter on the slip: the inverse of the tyre's curve, consistency, a radius that is off."""

from functools import cache

import numpy as np
import pytest

from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.envs.tyres.longitudinal import magic_formula
from gripbench.envs.vehicles import load_vehicle
from gripbench.envs.worlds import record
from gripbench.methods.blocks.inverse_slip import inverse_slip
from gripbench.methods.slip_domain_ekf import SlipDomainEkf

CAR = load_vehicle("li2014").values()


@cache
def drive(name, seed=1000):
    """Return a drive; seeds from 1000 on are never tested."""
    return record(find_scenario(name), seed)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def friction_error(recording, car=None, method=None):
    found = (method or SlipDomainEkf()).run(car or recording.vehicle, recording.observations)
    error = found["mu_front"] - recording.truth["mu_front"]
    return rms(error), found, error


def test_inverse_slip_inverts_the_tyre():
    params = np.rec.array(np.array([tuple(CAR.values())], [(n, float) for n in CAR]))[0]
    for share in (-0.9, -0.3, 0.0, 1e-4, 0.2, 0.6, 0.94):
        slip, slope = inverse_slip(share, params)
        curve = magic_formula.py_func
        factors = params.magic_b, params.magic_c, params.magic_e
        assert curve(slip, *factors) == pytest.approx(share, abs=1e-9)
        h = 1e-7
        numeric = (curve(slip + h, *factors) - curve(slip - h, *factors)) / (2 * h)
        assert slope == pytest.approx(1.0 / numeric, rel=1e-4)


@pytest.mark.parametrize("scenario", ["constant_mu@1", "combined_traction_braking@1"])
def test_friction_of_the_population_with_its_variance(scenario):
    errors, nees, prior = [], [], []
    for seed in (1000, 1001, 1002):
        recording = drive(scenario, seed)
        _, found, error = friction_error(recording)
        errors.append(rms(error))
        nees.append(np.mean(error**2 / found["mu_front_variance"]))
        prior.append(rms(recording.truth["mu_front"] - 0.68))
    assert rms(errors) < 0.9 * rms(prior)
    assert 0.2 < np.mean(nees) < 2.0


def test_a_radius_that_is_off_costs_little():
    """0.7 mm of 350: within what wear and pressure do, which the filter expects."""
    plain, shifted = [], []
    for seed in (1000, 1001, 1002):
        recording = drive("constant_mu@1", seed)
        car = dict(recording.vehicle)
        plain.append(friction_error(recording)[0])
        car["wheel_radius"] *= 1.002
        shifted.append(friction_error(recording, car)[0])
    assert rms(shifted) < 1.2 * rms(plain)


def test_friction_is_known_only_once_it_is_excited():
    recording = drive("large_torque")
    found = SlipDomainEkf().run(recording.vehicle, recording.observations)
    deviation = np.sqrt(found["mu_front_variance"])
    assert deviation[5] == pytest.approx(0.25, rel=0.3)
    assert deviation[12000] < 0.1


CELLS = {
    "constant_mu": (44.67, 0.0186),
    "friction_step": (38.84, 0.028),
    "noisy_acceleration": (58.94, 0.2774),
    "large_torque": (None, 0.3),  # of the force it is above 55.43
    "gradient": (42.88, 0.0195),
    "combined_traction_braking": (55.11, 0.0175),
}
"""Least RMS of Tables IV [N] and V of Li, Du & Li (2014) among the methods without an idealised
channel."""


@pytest.mark.parametrize(
    "scenario",
    [name if name == "friction_step" else pytest.param(name, marks=pytest.mark.slow)
     for name in CELLS],
)  # fmt: skip
def test_the_car_on_paper_beats_the_published_cells(scenario):
    run = drive(scenario)
    error, found, _ = friction_error(run, method=SlipDomainEkf("as_on_paper"))
    force, friction = CELLS[scenario]
    assert error < friction
    if force is not None:
        assert rms(found["force_x_front"] - run.truth["force_x_front"]) < force


def test_without_gps_the_axles_tell_each_other():
    recording = drive("constant_mu@1")
    error, found, _ = friction_error(recording, method=SlipDomainEkf("production"))
    assert np.isfinite(found["mu_front"]).all()
    assert error < 0.5
