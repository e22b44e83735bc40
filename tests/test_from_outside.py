"""A package outside gripbench adds a channel, a plant, a scenario, a method and a paper."""

import os
import subprocess
import sys

import pytest

SLEDGE = '''
"""A sledge that a rope pulls over snow: one state, one closed form, one new channel."""

import numpy as np

from gripbench.bench.papers.claims import Paper
from gripbench.bench.papers.reproduction import of_claims
from gripbench.configuration import parse
from gripbench.envs.plants.simulation import Action, Simulation
from gripbench.envs.scenarios import Scenario
from gripbench.envs.signals import Signal, record_type
from gripbench.envs.worlds import World

ROPE = Signal("rope_force", "N", "vehicle", "pulling forward", "load cell", "Force of the rope")


class SledgeScenario(Scenario):
    friction: float
    rope_force: float


class SledgeSimulation(Simulation):
    actions = (Action("rope_force", "N", 0.0, 1e4, "Force of the rope"),)
    truth_type = record_type(("time", "speed_x", "accel_x", "rope_force", "mu"))

    def __init__(self, scenario, vehicle):
        self.scenario, self.mass = scenario, vehicle.values()["mass"]
        self.sample_time = scenario.sample_time

    def reset(self, seed):
        self.time, self.speed = 0.0, 0.0
        return self._sample(self.scenario.rope_force)

    def drive(self):
        return np.array([self.scenario.rope_force])

    def advance(self, action):
        self.speed += self._rate(action[0]) * self.sample_time
        self.time += self.sample_time
        return self._sample(action[0])

    def run(self, seed):
        samples = [self.reset(seed)]
        while len(samples) <= self.scenario.steps:
            samples.append(self.advance(self.drive()))
        return np.concatenate(samples)

    def _rate(self, force):
        return force / self.mass - 9.81 * self.scenario.friction

    def _sample(self, force):
        sample = np.zeros(1, self.truth_type)
        sample[0] = (self.time, self.speed, self._rate(force), force, self.scenario.friction)
        return sample


WORLD = World(SledgeScenario, SledgeSimulation, SledgeSimulation.truth_type)

SCENARIO = """
name = "sledge"
description = "A sledge on a rope"
world = "sledge"
vehicle = "li2014"
horizon = 1.0
sample_time = 0.01
integrator = ""
sensor_suite = ""
friction = 0.1
rope_force = 3000.0
[sensors.rope_force]
[sensors.accel_x]
"""


class Pull:
    name = "pull"
    sensors = ("rope_force", "accel_x")
    estimates = ("mu",)
    vehicle_parameters = ("mass",)

    def reset(self, vehicle, dt):
        self.mass = vehicle["mass"]

    def update(self, obs):
        return {"mu": (obs["rope_force"] / self.mass - obs["accel_x"]) / 9.81}
'''

PAPER = '''
"""A paper of one claim."""

from gripbench.bench.papers.claims import Paper
from gripbench.bench.papers.reproduction import of_claims


def load():
    return Paper.model_validate({
        "name": "sledge2026", "title": "On sledges", "reference": "nobody",
        "seeds": {"tuning_first": 1, "tuning_count": 1, "test_first": 0, "test_count": 1},
        "claims": [{"item": "mu", "behind": "printed", "quantity": "Table 1: mu", "unit": "-",
                    "published": 0.1, "tolerance_low": 0.05, "tolerance_high": 0.15}],
    })


def reproduce(progress=None):
    return of_claims(load(), {"mu": 0.1})
'''

POINTS = """
[gripbench.signals]
rope = sledge:ROPE
[gripbench.worlds]
sledge = sledge:WORLD
[gripbench.methods]
pull = sledge:Pull
[gripbench.papers]
sledge2026 = sledge_paper
"""


@pytest.fixture
def gripbench(tmp_path):
    """The command line with a package outside gripbench installed beside it."""
    site = tmp_path / "site"
    info = site / "sledge-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: sledge\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(POINTS)
    (site / "sledge.py").write_text(SLEDGE)
    (site / "sledge_paper.py").write_text(PAPER)
    environment = {**os.environ, "PYTHONPATH": str(site)}
    program = "from gripbench.bench.command_line import main; main()"

    def run(*arguments):
        return subprocess.run(
            [sys.executable, "-c", program, *arguments],
            env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=300,
        )  # fmt: skip

    code = "import sledge; open('sledge.toml', 'w').write(sledge.SCENARIO)"
    subprocess.run([sys.executable, "-c", code], env=environment, cwd=tmp_path, check=True)
    return run


@pytest.mark.slow
def test_a_package_adds_a_channel_a_plant_a_scenario_and_a_method(gripbench):
    done = gripbench("run", "--scenario", "sledge.toml", "--method", "pull", "--seeds", "1")
    assert done.returncode == 0, done.stderr
    assert "1 ok" in done.stdout
    done = gripbench("list", "signals")
    assert "rope_force" in done.stdout


@pytest.mark.slow
def test_a_package_adds_a_paper(gripbench, tmp_path):
    done = gripbench("reproduce", "sledge2026", "--results", "out")
    assert done.returncode == 0, done.stderr
    assert "1 printed number: 1 reproduced." in done.stdout
    assert (tmp_path / "out" / "sledge2026" / "claims.csv").is_file()
