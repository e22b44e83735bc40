"""What a population is for: neither memory nor luck nor the plant's inverse comes first."""

import json

import numpy as np
import pytest

import gripbench
from gripbench.envs.populations.draws import draw, paper_of
from gripbench.envs.tyres.longitudinal import magic_formula, slip_ratio
from gripbench.envs.worlds import load_scenario, record

pytestmark = pytest.mark.slow

ALGEBRAIC = '''
from math import atan, sin

class Algebraic:
    """mu = (m a_x + C_r m g + D v^2) / (F_zf f(s_f) + F_zr f(s_r)), no filter, no tuning."""
    name = "algebraic"
    sensors = ("accel_x", "speed_gps", "wheel_speed_front", "wheel_speed_rear")
    estimates = ("mu_front",)
    vehicle_parameters = ("mass", "drag", "rolling_resistance", "wheel_radius", "cg_to_front",
                          "cg_to_rear", "magic_b", "magic_c", "magic_e")

    def reset(self, vehicle, dt):
        self.p, self.mu = vehicle, 0.5

    def update(self, obs):
        p, v = self.p, obs["speed_gps"]
        def f(wheel):
            s = (p["wheel_radius"] * wheel - v) / max(p["wheel_radius"] * wheel, v, 0.1)
            b = p["magic_b"] * s
            return sin(p["magic_c"] * atan(b - p["magic_e"] * (b - atan(b))))
        base = p["cg_to_front"] + p["cg_to_rear"]
        load = p["mass"] * 9.81 / base
        shape = load * (p["cg_to_rear"] * f(obs["wheel_speed_front"])
                        + p["cg_to_front"] * f(obs["wheel_speed_rear"]))
        force = p["mass"] * (obs["accel_x"] + 9.81 * p["rolling_resistance"]) + p["drag"] * v * v
        if abs(force) > 170.0 and abs(shape) > 1.0:
            self.mu = force / shape
        return {"mu_front": self.mu}
'''

MEMORISER = '''
import bisect
import json

DRIVES = json.loads(r"""@DRIVES@""")

class Memoriser:
    """Says what the sideslip was at this time in a drive that it knows and that began alike."""
    name = "@NAME@"
    sensors = ("yaw_rate", "steer_angle")
    estimates = ("sideslip",)

    def reset(self, vehicle, dt):
        self.distance = [0.0] * len(DRIVES)

    def update(self, obs):
        t = obs["time"]
        best = 0
        for i, drive in enumerate(DRIVES):
            k = min(int(t * 20.0), len(drive["yaw_rate"]) - 1)
            if t < 8.0:
                self.distance[i] += (obs["yaw_rate"] - drive["yaw_rate"][k]) ** 2
                self.distance[i] += (obs["steer_angle"] - drive["steer_angle"][k]) ** 2
            if self.distance[i] < self.distance[best]:
                best = i
        k = min(int(t * 20.0), len(DRIVES[best]["sideslip"]) - 1)
        return {"sideslip": DRIVES[best]["sideslip"][k]}
'''

LATERAL = ("dakhlallah_hard", "braking_in_turn", "double_lane_change_snow")


def _drives(names, seeds):
    drives = []
    for name in names:
        for seed in seeds:
            truth = record(load_scenario(name), seed).truth
            every = round(0.05 / (truth["time"][1] - truth["time"][0]))
            channels = ("yaw_rate", "steer_angle", "sideslip")
            drives.append({key: truth[key][::every].round(6).tolist() for key in channels})
    return json.dumps(drives)


def _score(frame, target):
    """Geometric mean over the scenarios of the pooled RMS error, by label."""
    chosen = frame[frame["target"] == target]
    pooled = chosen.groupby(["label", "scenario"])["rms"].agg(lambda v: np.sqrt(np.mean(v**2)))
    return np.exp(np.log(pooled).groupby("label").mean())


def _memorisers(tmp_path, names):
    """Write a method that knows one drive of each scenario, and one that knows ten of each."""
    files = []
    for kind, seeds in (("memoriser", [1000]), ("recogniser", range(1000, 1010))):
        text = MEMORISER.replace("@NAME@", kind)
        text = text.replace("@DRIVES@", _drives(names, seeds))
        path = tmp_path / f"{kind}.py"
        path.write_text(text)
        files.append(str(path))
    return files


def test_memory_of_other_seeds_is_no_better_than_the_best_baseline(tmp_path):
    names = [f"{name}@1" for name in LATERAL]
    files = _memorisers(tmp_path, names)
    baselines = ["zero_sideslip", "bicycle_on_paper", "kinematic_integration"]
    frame = gripbench.run(
        scenarios=names, methods=[*files, *baselines], seeds=6, workers=1, results=tmp_path / "r"
    )
    assert (frame["status"] == "ok").all()
    score = _score(frame, "sideslip")  # one board: all scenarios that it was trained on
    best = score[score.index.isin(baselines)].min()
    assert score["memoriser"] > best, score
    assert score["recogniser"] > best, score


def test_memory_would_pay_at_level_0(tmp_path):
    files = _memorisers(tmp_path, ["dakhlallah_hard"])
    frame = gripbench.run(
        scenarios=["dakhlallah_hard"], methods=[*files, "zero_sideslip"], seeds=2, workers=1,
        results=tmp_path / "r",
    )  # fmt: skip
    score = _score(frame, "sideslip")
    assert score["memoriser"] < 0.1 * score["zero_sideslip"]


STRAIGHT = ("constant_mu@1", "friction_step@1", "friction_steps@1", "combined_traction_braking@1")


def test_neither_the_inverse_of_the_plant_nor_a_lucky_constant_is_first(tmp_path):
    plugin = tmp_path / "algebraic.py"
    plugin.write_text(ALGEBRAIC)
    constants = [f"constant_friction@friction={value}" for value in (0.9, 0.8, 0.7)]
    others = ["constant_friction:prior", "slip_slope:magic_formula"]
    frame = gripbench.run(
        scenarios=STRAIGHT, methods=[str(plugin), *constants, *others], seeds=20, workers=1,
        results=tmp_path / "r",
    )  # fmt: skip
    score = _score(frame, "mu_front")
    assert score.idxmin() not in {"algebraic", *constants}
    assert score["algebraic"] > score["constant_friction:prior"]


def test_the_inverse_of_the_plant_solves_level_0():
    """Beside it: without a population the same fifteen lines have no error at all."""
    run = record(load_scenario("constant_mu").model_copy(update={"road_grade": 0.0}), 0)
    seen, car = run.observations, run.vehicle
    base = car["cg_to_front"] + car["cg_to_rear"]
    errors = []
    for k in range(2000, 19000, 500):
        shares = [
            magic_formula(
                slip_ratio(
                    car["wheel_radius"] * seen[f"wheel_speed_{axle}"][k], seen["speed_gps"][k]
                ),
                car["magic_b"], car["magic_c"], car["magic_e"],
            )
            for axle in ("front", "rear")
        ]  # fmt: skip
        load = car["mass"] * 9.81 / base
        shape = load * (car["cg_to_rear"] * shares[0] + car["cg_to_front"] * shares[1])
        force = car["mass"] * (seen["accel_x"][k] + 9.81 * car["rolling_resistance"])
        force += car["drag"] * seen["speed_gps"][k] ** 2
        errors.append(force / shape - 0.9)
    assert np.abs(errors).max() < 1e-9


TELLS = """
import json

class Tells:
    name = "tells"
    sensors = ("yaw_rate",)
    estimates = ("sideslip",)

    def reset(self, vehicle, dt):
        with open(@FILE@, "a") as file:
            print(json.dumps(dict(vehicle)), file=file)

    def update(self, obs):
        return {"sideslip": 0.0}
"""


def test_a_plug_in_is_given_the_car_on_paper_for_every_seed(tmp_path):
    told, plugin = tmp_path / "told", tmp_path / "tells.py"
    plugin.write_text(TELLS.replace("@FILE@", repr(str(told))))
    scenario = load_scenario("slalom_ice@1").model_copy(update={"horizon": 4.0})
    frame = gripbench.run(
        scenarios=[scenario], methods=[str(plugin)], seeds=2, workers=1, results=tmp_path / "r"
    )
    assert (frame["status"] == "ok").all()
    given = [json.loads(line) for line in told.read_text().splitlines()]
    assert given == [dict(paper_of(scenario))] * 2  # value by value, to the last bit
    for seed in range(2):
        assert draw(scenario, seed).road.values()["mass"] not in given[0].values()
