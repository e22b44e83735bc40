"""Time of a cell of 2000 samples: in the sandbox, given one by one, and in this process."""

from pathlib import Path

import pytest

import gripbench
from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.running.execution import execute
from gripbench.bench.running.isolation.limits import Limits
from gripbench.bench.running.isolation.processes import stop_starters
from gripbench.bench.running.isolation.sandbox import Sandbox
from gripbench.methods.samples import select_channels

SOUND = Path(__file__).parents[1] / "plugins" / "kinds" / "sound.py"
SAMPLES = 2000


@pytest.fixture(scope="module")
def spec():
    return choose_method(str(SOUND))


@pytest.fixture(scope="module")
def recording():
    scenario = gripbench.load_scenario("constant_mu").model_copy(update={"horizon": 2.0})
    return gripbench.record(scenario, 0)


def test_cell_in_the_sandbox(benchmark, spec, recording):
    sandbox = Sandbox(Limits())
    sandbox.declare(spec.source, "", {})
    outcome = benchmark(
        sandbox.execute, spec.source, spec.declaration, "", {}, recording.vehicle,
        recording.observations[:SAMPLES], 1e-3,
    )  # fmt: skip
    sandbox.close()
    stop_starters()
    assert len(outcome.estimates) == SAMPLES


def test_cell_in_this_process(benchmark, spec, recording):
    observations = select_channels(recording.observations[:SAMPLES], spec.declaration.sensors)
    method = spec.make()
    outcome = benchmark(
        execute, method, spec.declaration, recording.vehicle, observations, 1e-3, False
    )
    assert len(outcome.estimates) == SAMPLES
