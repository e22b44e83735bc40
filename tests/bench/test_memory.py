"""What a run keeps in memory: no recordings, and rows only where somebody asks for them."""

import tracemalloc

import gripbench
from gripbench.bench.running.api import plan_of
from gripbench.bench.running.backends import Backend
from gripbench.bench.running.runner import run_plan
from gripbench.bench.running.store import Store


def peak(scenario, seeds, results, on_row):
    """Return the highest memory [bytes] that Python and NumPy held at once during a run."""
    plan = plan_of("", [scenario], ["slip_slope"], seeds)
    tracemalloc.start()
    try:
        report = run_plan(plan, Store(results), Backend(workers=1), on_row=on_row)
        assert report.computed == seeds
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_ten_times_as_many_seeds_need_no_more_memory(short_scenario, tmp_path):
    recording = gripbench.record(gripbench.load_scenario(short_scenario), 0)
    size = recording.observations.nbytes + recording.truth.nbytes
    gripbench.run(  # compiles, which would take long while memory is traced
        scenarios=[short_scenario], methods=["slip_slope"], results=tmp_path / "c", workers=1
    )
    few = peak(short_scenario, 4, tmp_path / "few", lambda row: None)
    many = peak(short_scenario, 40, tmp_path / "many", lambda row: None)
    kept = peak(short_scenario, 40, tmp_path / "kept", [].append)
    print(
        f"\none recording {size / 1024:.0f} KiB; peak {few / 1024:.0f} KiB with 4 seeds, "
        f"{many / 1024:.0f} KiB with 40, {kept / 1024:.0f} KiB where all rows are kept"
    )
    assert many - few < 2 * size  # garbage not collected yet; 36 recordings would be 36 times it
    assert kept - many < 40 * 16 * 1024  # what the summary of a run is made of: rows
