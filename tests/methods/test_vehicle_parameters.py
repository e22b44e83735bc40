"""A method declares the vehicle parameters that its estimates depend on, and no others."""

import functools

import numpy as np
import pytest

from gripbench.bench.catalogue.registry import built_in_methods, choose_method
from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.envs.worlds import record

DRIVES = (
    ("combined_traction_braking@1", 12.0),
    ("gradient@1", 6.0),
    ("dakhlallah_hard@1", 10.0),
    ("braking_in_turn@1", 14.0),
    ("slalom_snow@1", 10.0),
    ("banked_turn@1", 12.0),
    ("friction_step", 6.0),
    ("slalom_snow", 10.0),
    ("braking_in_turn", 14.0),
)
"""Scenarios and how much [s] of them; level 0 for the methods that read what no sensor gives."""


@functools.cache
def _drive(name, horizon):
    scenario = find_scenario(name)
    return record(scenario.model_copy(update={"horizon": min(horizon, scenario.horizon)}), 3)


def _run(method, run, **changes):
    estimates = method.run({**run.vehicle, **changes}, run.observations)
    for name in estimates.dtype.names:
        assert np.isfinite(estimates[name]).all(), name  # what is not declared is NaN
    return estimates.tobytes()


def _fits(method, run):
    return set(method.sensors) <= set(run.observations.dtype.names) and set(
        method.vehicle_parameters
    ) <= set(run.vehicle)


@pytest.mark.slow
@pytest.mark.parametrize(("cls", "variant"), [
    pytest.param(cls, variant, id=f"{cls.name}:{variant}")
    for cls in built_in_methods().values()
    for variant in ("corrected", *cls.variants)
])  # fmt: skip
def test_each_declared_parameter_changes_the_estimates(cls, variant):
    method = cls(variant)
    left = set(method.vehicle_parameters)
    for drive in DRIVES:
        if not left:
            break
        run = _drive(*drive)
        if not _fits(method, run):
            continue
        expected = _run(method, run)
        for name in sorted(left):
            value = run.vehicle[name]
            if _run(method, run, **{name: 1.05 * value if value else 0.05}) != expected:
                left.discard(name)
    assert left == set()


TYRE = {"magic_b", "magic_c", "magic_e"}


@pytest.mark.parametrize(
    ("choice", "declared"),
    [
        ("slip_slope", {"magic_b", "magic_c"}),
        ("slip_slope:paper", set()),
        ("slip_slope:magic_formula", TYRE),
        ("slip_slope@tyre_shape=true", TYRE),
        ("slip_slope@slope_gain=0.03", set()),
        ("slip_slope:paper@slope_gain=0", {"magic_b", "magic_c"}),
        ("extended_kalman_filter:magic_formula", TYRE),
    ],
)
def test_settings_decide_what_is_read_of_the_tyre(choice, declared):
    spec = choose_method(choice)
    assert TYRE & set(spec.declaration.vehicle_parameters) == declared
    run = _drive("friction_step", 1.0)
    if not declared:
        run = _without(run, TYRE)
    _run(spec.make(), run)


def _without(run, names):
    vehicle = {key: value for key, value in run.vehicle.items() if key not in names}
    return type(run)(**{**vars(run), "vehicle": vehicle})


def test_a_tyre_stiffness_on_paper_scales_the_friction_of_the_slope():
    """Equation 15 with mu = k/(B C): no constant of a plant stands in its place."""
    method, run = choose_method("slip_slope").make(), _drive("friction_step", 4.0)
    right = method.run(run.vehicle, run.observations)["mu_front"]
    stiff = {**run.vehicle, "magic_b": 1.25 * run.vehicle["magic_b"]}
    np.testing.assert_allclose(1.25 * method.run(stiff, run.observations)["mu_front"], right)
