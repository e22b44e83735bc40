"""The trained examples: what they learn from drives whose law is known, online as in training."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from gripbench.bench.running.isolation.training_drives import TrainingDrive
from gripbench.envs.signals import record_type

FOLDER = Path(__file__).parents[2] / "examples" / "trained"
CAR = {
    "mass": 1500.0, "cg_to_front": 1.1, "cg_to_rear": 1.6, "cornering_stiffness_front": 9e4,
    "cornering_stiffness_rear": 1.1e5, "wheel_radius": 0.3,
}  # fmt: skip


@pytest.fixture
def examples(monkeypatch):
    """Names in the example files."""
    monkeypatch.syspath_prepend(str(FOLDER))
    names = {}
    for path in sorted(FOLDER.glob("*.py")):
        names |= runpy.run_path(str(path))
    yield names
    sys.modules.pop("windows", None)


def drive(examples, law, seed):
    """Return a drive of smooth random samples whose sideslip is a law of its rows."""
    random = np.random.default_rng(seed)
    samples = np.empty(400, record_type((*examples["SENSORS"], "time")))
    time = samples["time"] = 0.01 * np.arange(400)
    for name in examples["SENSORS"]:
        tones = random.normal(size=4) @ np.sin(
            np.outer(random.uniform(0.5, 6.0, 4), time) + random.uniform(0.0, 6.0, (4, 1))
        )
        samples[name] = 60.0 + tones if name.startswith("wheel") else 0.1 * tones
    truth = np.zeros(400, record_type(("time", "sideslip")))
    truth["time"] = time
    windows = examples["Windows"](CAR)
    for k, sample in enumerate(samples.tolist()):
        row = windows.take(dict(zip(samples.dtype.names, sample, strict=True)))
        if row is not None:
            truth["sideslip"][k] = law(row)
    return TrainingDrive("made", CAR, samples, truth)


def online(method, state, one):
    """Return the estimates at every sample."""
    method.fitted = state
    method.reset(one.vehicle, 0.01)
    names = one.observations.dtype.names
    samples = one.observations.tolist()
    found = [method.update(dict(zip(names, item, strict=True)))["sideslip"] for item in samples]
    return np.array(found)


def test_the_regression_finds_a_linear_law_and_repeats_it_online(examples):
    weights = np.random.default_rng(0).normal(size=30)
    drives = [drive(examples, lambda row: weights[: len(row)] @ row, k) for k in range(6)]
    method = examples["WindowRegression"](ridge=1e-12)
    state = method.fit(drives[:5], 100)
    found, truth = online(method, state, drives[5]), drives[5].truth["sideslip"]
    ticks = truth != 0.0
    assert ticks.sum() > 150
    np.testing.assert_allclose(found[ticks], truth[ticks], rtol=1e-3, atol=1e-4)


def test_the_network_learns_what_no_line_can_and_the_same_each_time(examples):
    drives = [drive(examples, lambda row: np.tanh(4.0 * row[1]) ** 2, k) for k in range(6)]
    network, line = examples["WindowNetwork"](), examples["WindowRegression"]()
    state = network.fit(drives[:5], 60)
    again = examples["WindowNetwork"]().fit(drives[:5], 60)
    assert all(np.array_equal(state[name], again[name]) for name in state)
    rows, targets, share = examples["training_rows"](drives[:5])
    fitted = examples["sideslip"](rows, **state)
    linear = rows @ line.fit(drives[:5], 1)["weights"]
    assert share @ (fitted - targets) ** 2 < 0.5 * share @ (linear - targets) ** 2
