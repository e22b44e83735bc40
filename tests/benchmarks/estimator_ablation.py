"""Print the tables of docs/estimator.md: our own estimators with one part removed at a time.

    python tests/benchmarks/estimator_ablation.py [SEEDS]

Drives are those of the population at level 1, seeds 0 to SEEDS - 1 (5 unless given); no setting
was chosen on them.
"""

import sys

import numpy as np

from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.envs.worlds import record
from gripbench.methods.baselines.bicycle_on_paper import BicycleOnPaper
from gripbench.methods.baselines.constant_friction import ConstantFriction
from gripbench.methods.baselines.kinematic_integration import KinematicIntegration
from gripbench.methods.baselines.zero_sideslip import ZeroSideslip
from gripbench.methods.sideslip_friction_bank import SideslipFrictionBank
from gripbench.methods.slip_domain_ekf import SlipDomainEkf

TURNS = (
    "slalom_snow", "double_lane_change_ice", "mu_jump_lane_change", "two_turns", "banked_turn",
    "dakhlallah_limit",
)  # fmt: skip
STRAIGHT = ("constant_mu", "friction_step", "large_torque", "combined_traction_braking")

BANK = {
    "complete": {},
    "no kinematics": {"accel_y_noise": 1.0},
    "no tyres": {"model_floor": 2.0, "model_error": 0.5, "model_time": 2.0},
    "one class of friction": {"friction_spread": 0.02, "change_rate": 1e-4},
    "stiffness as on paper": {"stiffness_std": 1e-3, "stiffness_walk": 0.0},
    "steering zero as on paper": {"steer_offset_std": 1e-5},
    "no hypothesis of a bank": {"banking_share": 1e-6},
    "states are copied": {"copied_share": 1.0},
    "no bank of the road": {"bank_walk": 0.0, "offset_y_walk": 0.0},
    "any sideslip is usual": {"usual_sideslip": 10.0},
    "errors are white": {"model_time": 0.01},
}
SLIP = {
    "complete": {},
    "radius as on paper": {"radius_mean": 0.0, "radius_std": 1e-5, "radius_walk": 0.0},
    "stiffness as on paper": {"stiffness_std": 1e-3},
    "mass as on paper": {"payload_mean": 0.0, "payload_std": 1e-4},
    "GPS has no age": {"gps_age": 0.0, "gps_age_std": 1e-5},
    "no steps of friction": {"threshold": 100.0},
    "errors are white": {"model_time": 0.02},
    "variance of the filter alone": {"shape_error": 0.0, "change_odds": 0.0},
}
BASELINES = {
    "zero sideslip": ZeroSideslip(),
    "kinematic integration": KinematicIntegration(),
    "bicycle on paper": BicycleOnPaper(),
}


def rms(values):
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def errors(method, recordings, target):
    """Return RMS error, and mean NEES where the method tells its variance."""
    total, count, nees = 0.0, 0, []
    for recording in recordings:
        found = method.run(recording.vehicle, recording.observations)
        late = recording.truth["time"] >= recording.score_from
        error = (found[target] - recording.truth[target])[late]
        total, count = total + float(error @ error), count + len(error)
        if target + "_variance" in found.dtype.names:
            nees.append(np.mean(error**2 / found[target + "_variance"][late]))
    return (total / count) ** 0.5, float(np.mean(nees)) if nees else np.nan


def table(title, names, methods, target, unit, seeds):
    """Print one table: a row a method, a column a scenario."""
    drives = {
        name: [record(find_scenario(f"{name}@1"), seed) for seed in range(seeds)] for name in names
    }
    print(f"\n{title}\n\n| | {' | '.join(names)} | mean | NEES |")
    print("| --- |" + " ---: |" * (len(names) + 2))
    for label, method in methods.items():
        found = [errors(method, drives[name], target) for name in names]
        cells = [f"{unit * value:.3g}" for value, _ in found]
        mean = unit * np.mean([value for value, _ in found])
        nees = np.mean([value for _, value in found])
        print(f"| {label} | {' | '.join(cells)} | {mean:.3g} | {nees:.2g} |", flush=True)


def main():
    """Print both tables."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    degrees = 180.0 / np.pi
    banks = {name: SideslipFrictionBank(**changes) for name, changes in BANK.items()}
    table("Sideslip [deg]", TURNS, banks | BASELINES, "sideslip", degrees, seeds)
    slips = {name: SlipDomainEkf(**changes) for name, changes in SLIP.items()}
    slips |= {"without GPS": SlipDomainEkf("production")}
    slips |= {"constant, the prior's mean": ConstantFriction("prior")}
    table("Friction [-]", STRAIGHT, slips, "mu_front", 1.0, seeds)


if __name__ == "__main__":
    main()
