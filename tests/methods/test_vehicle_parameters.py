"""Every vehicle parameter that a method declares is one that its estimates depend on."""

import functools

import pytest

from gripbench.bench.catalogue.registry import built_in_methods, find_scenario
from gripbench.envs.worlds import record

pytestmark = pytest.mark.slow

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

WITHOUT_EFFECT: dict[tuple[str, str, str], str] = {}
"""Parameters of a method and variant that change nothing, with the reason."""


@functools.cache
def _drive(name, horizon):
    scenario = find_scenario(name)
    return record(scenario.model_copy(update={"horizon": min(horizon, scenario.horizon)}), 3)


def _makers():
    for cls in built_in_methods().values():
        for variant in ("corrected", *cls.variants):
            yield cls, variant


@pytest.mark.parametrize(("cls", "variant"), [
    pytest.param(cls, variant, id=f"{cls.name}:{variant}") for cls, variant in _makers()
])  # fmt: skip
def test_each_declared_parameter_changes_the_estimates(cls, variant):
    method = cls(variant)
    left = {
        name
        for name in method.vehicle_parameters
        if (cls.name, variant, name) not in WITHOUT_EFFECT
    }
    for drive in DRIVES:
        if not left:
            break
        run = _drive(*drive)
        if not set(method.sensors) <= set(run.observations.dtype.names):
            continue
        if not set(method.vehicle_parameters) <= set(run.vehicle):
            continue
        expected = method.run(run.vehicle, run.observations)
        for name in sorted(left):
            value = run.vehicle[name]
            other = {**run.vehicle, name: 1.05 * value if value else 0.05}
            if method.run(other, run.observations).tobytes() != expected.tobytes():
                left.discard(name)
    assert left == set()
