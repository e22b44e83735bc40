"""Rows of methods that exist on paper only."""

import math

import numpy as np

from gripbench.bench.running.rows import Row, Runtime, frame_of
from gripbench.bench.scoring.metric import Value

TORQUE = ("torque_front", "wheel_speed_front", "accel_x")
GPS = (*TORQUE, "speed_gps")
IDEAL = (*TORQUE, "wheel_acceleration_front")


def mean_square(total, count):
    return Value(value=math.sqrt(total / count), total=total, count=count)


def score(rms, count=100, **more):
    squares = rms * rms * count
    return {
        "rms": Value(value=rms, total=squares, count=count),
        "peak": Value(value=3 * rms),
        "bias": Value(value=rms / 2, total=rms / 2 * count, count=count),
        "convergence_time": Value(value=None),
        "rms_low": mean_square(squares / 4, count // 2),
        "rms_limit": mean_square(3 * squares / 4, count // 2),
        **more,
    }


def response(total, count, delay=None, **more):
    """What the metrics of excitation say of a run; `jump_delay` where the friction jumps."""
    jump = {"jump_delay": Value(value=more["jump_delay"])} if "jump_delay" in more else {}
    excited = {"excited_rms": mean_square(total, count), "friction_delay": Value(value=delay)}
    return {**excited, **jump}


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
