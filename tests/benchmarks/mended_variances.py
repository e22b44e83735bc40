"""What filters and their mended variants state of their errors, on cars that chose nothing.

Printed by `python tests/benchmarks/mended_variances.py [SEEDS]`: every scenario of the suites of
level 1, seeds from 1000 on (2 by default); NEES, RMS, CRPS and how many samples lie within the
stated 90 % interval. Angles in degrees.
"""

import sys

import numpy as np

from gripbench.bench.catalogue.registry import choose_method
from gripbench.bench.catalogue.scenarios import find_scenario
from gripbench.bench.catalogue.suites import load_suite
from gripbench.bench.running.execution import missing
from gripbench.bench.scoring.scoring import context_of
from gripbench.envs.signals import signal
from gripbench.envs.worlds import record

FIRST_SEED = 1000
LATERAL, LONGITUDINAL = "lateral_population", "longitudinal_population"
CASES = (
    (
        LONGITUDINAL,
        "force_x_front",
        "extended_kalman_filter",
        "extended_kalman_filter:lasting_errors",
    ),
    (LONGITUDINAL, "mu_front", "slip_domain_ekf", "slip_domain_ekf@flex_walk=0.1"),
    (LATERAL, "sideslip", "single_track_ekf"),
    (LATERAL, "sideslip", "dugoff_ekf"),
    (LATERAL, "sideslip", "kinematic_observer"),
    (LATERAL, "mu", "velocity_friction_ekf", "velocity_friction_ekf:lasting_errors"),
)


def scores(recordings, target, choice):
    """Return NEES, RMS, CRPS and coverage of 90 %, pooled over all samples."""
    spec = choose_method(choice)
    outputs = spec.declaration.outputs
    sums = np.zeros(5)
    for recording in recordings:
        channels = recording.observations.dtype.names
        if missing(spec.declaration, recording.vehicle, channels):
            continue
        made = spec.make().run(recording.vehicle, recording.observations)
        counted = recording.truth["time"] >= recording.score_from
        counted &= np.isfinite(recording.truth[target])
        estimate, truth, context = context_of(target, made, outputs, recording, counted)
        error = estimate - truth
        stated = context.stated(error)
        sums += (
            np.sum(stated.normalised() ** 2), np.sum(error**2), np.sum(stated.crps()),
            np.sum(stated.inside(0.9)), len(error),
        )  # fmt: skip
    nees, square, crps, inside = sums[:4] / sums[4]
    return nees, np.sqrt(square), crps, inside


if __name__ == "__main__":
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    print(f"{'':42s}{'':15s}{'NEES':>8s}{'RMS':>9s}{'CRPS':>9s}{'in 90 %':>9s}")
    for suite in (LONGITUDINAL, LATERAL):
        names = load_suite(suite).names()
        seeds = range(FIRST_SEED, FIRST_SEED + number)
        drives = [record(find_scenario(name), seed) for name in names for seed in seeds]
        for home, target, *choices in CASES:
            for choice in choices if home == suite else ():
                nees, rms, crps, inside = scores(drives, target, choice)
                unit = signal(target).display_factor
                print(
                    f"{choice:42s}{target:15s}{nees:8.3g}{unit * rms:9.3g}{unit * crps:9.3g}"
                    f"{100 * inside:7.0f} %",
                    flush=True,
                )
