"""Rows of methods that exist on paper only."""

import numpy as np

from gripbench.bench.running.rows import Row, Runtime, Stratum, TargetScore, frame_of

TORQUE = ("torque_front", "wheel_speed_front", "accel_x")
GPS = (*TORQUE, "speed_gps")
IDEAL = (*TORQUE, "wheel_acceleration_front")


def score(rms, count=100, **more):
    squares = rms * rms * count
    parts = {"low": Stratum(sum_of_squares=squares / 4, count=count // 2),
             "limit": Stratum(sum_of_squares=3 * squares / 4, count=count // 2)}  # fmt: skip
    values = {"peak": 3 * rms, "bias": rms / 2, "by_utilisation": parts, **more}
    return TargetScore(rms=rms, sum_of_squares=squares, count=count, **values)


def row(label, seed, rms, scenario="step", target="mu_front", **more):
    """One row; `rms` None makes it a failure."""
    name, _, variant = label.partition(":")
    scored = more.pop("score", None) or (None if rms is None else score(rms))
    values = {
        "key": f"{scenario}-{label}-{seed}", "method": name, "variant": variant, "sensors": TORQUE,
        "targets": (target,), "sample_period": 0.01, "title": name.replace("_", " ").title(),
        "status": "failed" if scored is None else "ok",
        "reason": "ValueError: no" if scored is None else "",
        "runtime": None if scored is None else Runtime(batch=1e-6, p50=2e-6, p99=3e-6,
                                                       maximum=9e-6, deadline_misses=0.0),
    }  # fmt: skip
    scores = {} if scored is None else {target: scored}
    return Row(scenario=scenario, seed=seed, label=label, scores=scores, **{**values, **more})


def noisy_rows(factors, seeds=20, scenarios=("step", "hill"), spread=0.05, shift=0, **of_label):
    """Rows of methods whose RMS is a factor times the run's difficulty, with noise of their own."""
    rows = []
    for number, scenario in enumerate(scenarios):
        for seed in range(shift, shift + seeds):
            difficulty = np.random.default_rng([number, seed]).uniform(0.5, 2.0)
            for index, (label, factor) in enumerate(factors.items()):
                own = np.random.default_rng([number, seed, index]).normal(1.0, spread)
                more = of_label.get(label, {})
                rows.append(row(label, seed, factor * difficulty * own, scenario, **more))
    return rows


def noisy_frame(factors, **more):
    return frame_of(noisy_rows(factors, **more))
