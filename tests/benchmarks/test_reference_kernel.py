"""The kernel that all other runtimes relate to; `gripbench leaderboard` finds it by its name."""

from gripbench.bench.timings import STEPS, reference_kernel

CALL = 100_000


def test_reference_kernel(benchmark):
    reference_kernel(1)
    benchmark.extra_info[STEPS] = CALL
    assert 0.0 < benchmark(reference_kernel, CALL) < 1.0
