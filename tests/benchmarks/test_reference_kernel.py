"""The kernel that all other runtimes relate to; `gripbench leaderboard` finds it by its name."""

import pytest

from gripbench.bench.publishing.timings import STEPS, reference_kernel

CALL = 100_000


@pytest.mark.benchmark(min_rounds=50)
def test_reference_kernel(benchmark):
    reference_kernel(1)
    benchmark.extra_info[STEPS] = CALL
    assert 0.0 < benchmark(reference_kernel, CALL) < 1.0
