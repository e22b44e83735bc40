"""Speed of the longitudinal world beside filterpy and scipy, as ratios within one run.

Run with `pytest tests/benchmarks/test_longitudinal_speed.py --benchmark-enable -n 0`; without
`--benchmark-enable` each job runs once, to see that it works.
"""

import longitudinal_speed as speed
import numpy as np
import pytest

SHORT = 200


@pytest.fixture
def samples(request):
    """More samples when times are taken."""
    disabled = request.config.getoption("benchmark_disable")
    enabled = request.config.getoption("benchmark_enable")
    return SHORT if disabled and not enabled else 5000


def _compare(benchmark, ours, reference, name, share=1.0):
    """Time ours with the benchmark, both once more beside each other; note the ratio."""
    benchmark(ours)
    if benchmark.stats is not None:
        mine, other = speed.seconds(ours, 5), speed.seconds(reference, 5) / share
        benchmark.extra_info[f"{name}_seconds"] = other
        benchmark.extra_info["times_faster"] = other / mine


def test_kalman_batch_against_filterpy(benchmark, samples):
    rows = speed.observations(samples)
    reference = speed.filterpy(speed.as_dicts(rows[:SHORT]))
    _compare(benchmark, speed.batch(rows), reference, "filterpy", SHORT / samples)


def test_kalman_online_against_filterpy(benchmark, samples):
    rows = speed.as_dicts(speed.observations(samples))
    reference = speed.filterpy(rows[:SHORT])
    _compare(benchmark, speed.online(rows), reference, "filterpy", SHORT / samples)


@pytest.mark.parametrize("compiled", [False, True], ids=["plain", "compiled"])
@pytest.mark.parametrize("name", speed.CLEAN)
def test_clean_rollout_against_lsoda_of_equal_accuracy(benchmark, samples, name, compiled):
    horizon = samples * 1e-3 * 6
    tolerance, ours, theirs = speed.equal_accuracy(name, horizon)
    benchmark.extra_info["front_force_error"] = ours
    benchmark.extra_info["lsoda_front_force_error"] = theirs
    assert theirs <= ours < 0.5
    chosen = speed.scenario(name, 0.0, horizon)
    reference = speed.lsoda_recording(chosen, tolerance, compiled)
    truth, other = speed.rollout(chosen)(), reference()
    for channel in ("speed_x", "wheel_speed_front", "slip_ratio_rear"):
        np.testing.assert_allclose(other[channel], truth[channel], rtol=1e-4, atol=1e-4)
    _compare(benchmark, speed.rollout(chosen), reference, "lsoda")


def test_noisy_rollout_against_restarted_lsoda(benchmark, samples):
    chosen = speed.scenario("constant_mu", 3.6e-4, samples * 1e-3)
    reference = speed.lsoda(chosen, 1e-6, 1e-7, restart=True)
    _compare(benchmark, speed.rollout(chosen), reference, "lsoda")
