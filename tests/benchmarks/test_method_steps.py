"""Time of a step of every built-in method, in a batch and one call at a time.

A new method is timed without any change here: on the first shipped scenario that gives it what it
reads.
"""

import functools

import numpy as np
import pytest

from gripbench.bench.catalogue.registry import built_in_methods, choose_method
from gripbench.bench.publishing.timings import FORM, LABEL, STEPS
from gripbench.bench.running.execution import missing
from gripbench.envs.worlds import load_scenario, record, scenario_files
from gripbench.methods.samples import select_channels

ONLINE_CALLS = 500


@functools.cache
def recording(scenario):
    return record(load_scenario(scenario), 0)


def drive_for(spec):
    """The first recording on which a method can run, or a reason why there is none."""
    reason = "there is no scenario"
    for scenario in sorted(scenario_files()):
        drive = recording(scenario)
        reason = missing(spec.declaration, drive.vehicle, drive.observations.dtype.names)
        if not reason:
            return drive
    pytest.skip(f"{spec.label}: {reason}")


def choices():
    """Every method with each of its variants."""
    for name, method in built_in_methods().items():
        yield name
        yield from (f"{name}:{variant}" for variant in method.variants)


@pytest.mark.parametrize("name", list(choices()))
@pytest.mark.benchmark(group="batch", min_rounds=20)
def test_batch_step(benchmark, name):
    spec = choose_method(name)
    drive = drive_for(spec)
    observations = select_channels(drive.observations, spec.declaration.sensors)
    method = spec.make()
    method.run(drive.vehicle, observations[:2])
    benchmark.extra_info.update({LABEL: spec.label, FORM: "batch", STEPS: len(observations)})
    estimates = benchmark(method.run, drive.vehicle, observations)
    assert len(estimates) == len(observations)


@pytest.mark.parametrize("name", built_in_methods())
@pytest.mark.benchmark(group="online", min_rounds=20)
def test_online_step(benchmark, name):
    spec = choose_method(name)
    drive = drive_for(spec)
    selected = select_channels(drive.observations[:ONLINE_CALLS], spec.declaration.sensors)
    samples = [dict(zip(selected.dtype.names, item.item(), strict=True)) for item in selected]
    method = spec.make()
    period = float(np.diff(selected["time"]).mean())

    def run():
        method.reset(drive.vehicle, period)
        for sample in samples:
            estimates = method.update(sample)
        return estimates

    run()
    benchmark.extra_info.update({LABEL: spec.label, FORM: "online", STEPS: len(samples)})
    assert set(benchmark(run)) == set(spec.declaration.outputs)
