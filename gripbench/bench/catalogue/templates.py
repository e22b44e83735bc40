"""The files that `gripbench new method` writes."""

from __future__ import annotations

import re
from pathlib import Path

from gripbench.bench.catalogue.registry import built_in_methods
from gripbench.errors import InputError
from gripbench.writing import write_atomically

_PLAIN = '''"""{title}: say here which paper and which equations."""


class {class_name}:
    """Front force from the accelerometer alone, as a start."""

    name = "{name}"
    sensors = ("accel_x",)
    estimates = ("force_x_front",)
    vehicle_parameters = ("mass",)

    def __init__(self, time_constant=0.05):
        self.time_constant = time_constant  # of the low-pass [s]

    def reset(self, vehicle, dt):
        """Forget everything; `vehicle` holds its parameters by name, `dt` is the sample time."""
        self.mass = vehicle["mass"]
        self.time = None
        self.force = 0.0

    def update(self, obs):
        """Take one sample; `obs["time"]` [s] and the declared sensors, SI units."""
        measured = 0.5 * self.mass * obs["accel_x"]
        elapsed = 0.0 if self.time is None else obs["time"] - self.time
        self.time = obs["time"]
        self.force += elapsed / (self.time_constant + elapsed) * (measured - self.force)
        return {{"force_x_front": self.force}}
'''

_COMPILED = '''"""{title}: say here which paper and which equations."""

import numpy as np

from gripbench import CompiledMethod, Parameter, compiled


@compiled
def step(state, obs, params, est):
    """Take one sample; SI units throughout."""
    measured = 0.5 * params.mass * obs.accel_x
    elapsed = obs.time - state.time if state.samples > 0.0 else 0.0
    state.time = obs.time
    state.samples += 1.0
    state.force += elapsed / (params.time_constant + elapsed) * (measured - state.force)
    est.force_x_front = state.force


class {class_name}(CompiledMethod):
    """Front force from the accelerometer alone, as a start."""

    name = "{name}"
    title = "{title}"
    reference = "say here which paper and which equations"
    sensors = ("accel_x",)
    estimates = ("force_x_front",)
    vehicle_parameters = ("mass",)
    parameters = (Parameter("time_constant", 0.05, "s", "Time constant of the low-pass", 1e-6),)
    state = np.dtype([("time", float), ("samples", float), ("force", float)])
    step = staticmethod(step)
'''

_TEST = '''"""Test of {name}: every check that the benchmark makes."""

from pathlib import Path

import pytest

from gripbench.bench.catalogue.check import CHECKS, check_estimator, failures

METHOD = f"{{Path(__file__).with_name('{name}.py')}}:{class_name}"


@pytest.mark.parametrize("check", CHECKS)
def test_check(check):
    assert failures(check_estimator(METHOD, ["constant_mu", "gradient"], checks=[check])) == {{}}
'''


def write_method(name: str, folder: Path, compiled: bool) -> tuple[Path, Path]:
    """Write a working method and its test.

    Parameters
    ----------
    name
        Lower case with underscores.
    folder
        Where to write.
    compiled
        Whether its step is compiled.

    Raises
    ------
    InputError
        If the name cannot be one, or a file is there already.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise InputError(f"name '{name}': use lower case letters, digits and underscores")
    if name in built_in_methods():
        raise InputError(f"name '{name}': a built-in method has it; choose another")
    method, test = folder / f"{name}.py", folder / f"test_{name}.py"
    for path in (method, test):
        if path.exists():
            raise InputError(f"{path}: exists already; choose another name or folder")
    words = {
        "name": name,
        "class_name": "".join(part.capitalize() for part in name.split("_")),
        "title": name.replace("_", " ").capitalize(),
    }
    write_atomically(method, (_COMPILED if compiled else _PLAIN).format(**words))
    write_atomically(test, _TEST.format(**words))
    return method, test
