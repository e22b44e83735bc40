"""Memory of other seeds' drives on level 1: it comes first on no board."""

import numpy as np
import pytest

from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.catalogue.suites import load_suite
from gripbench.envs.worlds import record

pytestmark = pytest.mark.slow

RATE = 20.0  # Hz
SEEDS, LEARNT = range(6), range(1000, 1006)
CHANNELS = {
    "longitudinal_population": (
        "wheel_speed_front", "wheel_speed_rear", "torque_front", "torque_rear", "accel_x",
    ),
    "lateral_population": (
        "wheel_speed_front_left", "wheel_speed_rear_left", "yaw_rate", "steer_angle", "accel_x",
        "accel_y",
    ),
}  # fmt: skip


class Drive:
    """What there is to remember of a drive, at `RATE`."""

    def __init__(self, run, channels, targets):
        time = run.truth["time"]
        places = np.searchsorted(time, np.arange(0.0, time[-1], 1.0 / RATE))
        self.seen = {name: np.nan_to_num(run.observations[name][places]) for name in channels}
        self.truth = {name: run.truth[name][places].copy() for name in targets}
        self.car = run.vehicle["mass"]

    def recalled(self, target, length):
        values = self.truth[target][:length]
        return np.pad(values, (0, length - len(values)), mode="edge")

    def start(self, seconds, scale):
        length = int(seconds * RATE)
        parts = [values[:length] / scale[name] for name, values in self.seen.items()]
        return np.concatenate([np.pad(p, (0, length - len(p)), mode="edge") for p in parts])


MEMORIES = ("another seed's", "the mean", "alike for 1 s", "alike for 3 s")


def memories(known, drives, drive, scale, target):
    """Return what each memory says of a drive: those of its scenario, and all with its car."""
    length = len(drive.truth[target])
    alike = [one for one in drives if one.car == drive.car]
    said = {
        "another seed's": known[0].recalled(target, length),
        "the mean": np.mean([one.recalled(target, length) for one in known], axis=0),
    }
    for seconds in (1.0, 3.0):
        away = [
            np.sum((one.start(seconds, scale) - drive.start(seconds, scale)) ** 2) for one in alike
        ]
        nearest = alike[int(np.argmin(away))]
        said[f"alike for {seconds:g} s"] = nearest.recalled(target, length)
    return said


def errors_of(suite, targets):
    """Return mean squared errors by target, label and scenario, one a seed."""
    found = {target: {} for target in targets}

    def add(target, label, scenario, error):
        found[target].setdefault(label, {}).setdefault(scenario, []).append(np.mean(error**2))

    chosen, channels = load_suite(suite), CHANNELS[suite]
    known = {
        name: [Drive(record(find_scenario(name), seed), channels, targets) for seed in LEARNT]
        for name in chosen.names()
    }
    drives = [one for those in known.values() for one in those]
    scale = {name: np.concatenate([one.seen[name] for one in drives]).std() for name in channels}
    specs = [spec for spec in chosen.specs() if set(spec.declaration.estimates) & set(targets)]
    for name, mine in known.items():
        scenario = find_scenario(name)
        for seed in SEEDS:
            run = record(scenario, seed)
            drive = Drive(run, channels, targets)
            late = int(scenario.score_from * RATE)
            for target in targets:
                for label, said in memories(mine, drives, drive, scale, target).items():
                    add(target, label, name, (said - drive.truth[target])[late:])
            counted = run.truth["time"] >= scenario.score_from
            for spec in specs:
                if not set(spec.declaration.sensors) <= set(run.observations.dtype.names):
                    continue
                estimates = spec.make().run(run.vehicle, run.observations)
                kind = "baseline" if spec.declaration.baseline else "method"
                for target in set(targets) & set(spec.declaration.estimates):
                    error = estimates[target] - run.truth[target]
                    add(target, f"{kind} {spec.label}", name, error[counted])
    return found


def score(by_scenario):
    """Return the geometric mean over scenarios of the pooled RMS error."""
    return np.exp(np.mean([0.5 * np.log(np.mean(values)) for values in by_scenario.values()]))


@pytest.mark.parametrize(
    ("suite", "targets"),
    [
        ("longitudinal_population", ("mu_front", "force_x_front")),
        ("lateral_population", ("mu", "mu_used", "sideslip")),
    ],
)
def test_memory_is_first_nowhere_and_no_better_than_the_best_guess(suite, targets):
    for target, errors in errors_of(suite, targets).items():
        scores = {label: score(values) for label, values in errors.items()}
        print(target, *(f"{value:.4g} {label}" for label, value in scores.items()), sep="\n")
        guess = min(value for label, value in scores.items() if label.startswith("baseline"))
        best = min(value for label, value in scores.items() if label.startswith("method"))
        for label in MEMORIES:
            assert best < scores[label], (target, label)
            # the mean of a scenario's drives knows its own steps, which the prior of all does not
            assert (0.95 if label == "the mean" else 1.0) * guess < scores[label], (target, label)
