"""Time of a sample of methods that are not Python: program over pipes, shared library in C.

Targets: a sample over pipes below 20 us with either protocol, one of a library in one loop below
50 ns.
"""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from gripbench.bench.catalogue.declarations import Source

EXAMPLES = Path(__file__).parents[2] / "examples"
GCC = ("gcc", "-std=c99", "-O2", "-ffp-contract=off")
SAMPLES = 5000

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")

LINES = """
#include <stdio.h>
int main(void)
{
    char line[65536];
    while (fgets(line, sizeof line, stdin)) {
        const int first = line[2] == 'v'; /* "vehicle" */
        puts(first ? "{\\"ready\\": true}" : "{\\"force_x_front\\": 201.3}");
        fflush(stdout);
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The examples with what they are compiled to, and a program that answers lines in C."""
    place = tmp_path_factory.mktemp("foreign")
    for path in (*(EXAMPLES / "c").iterdir(), *(EXAMPLES / "program").iterdir()):
        if path.is_file():
            shutil.copy(path, place)
    shutil.copy(EXAMPLES / "c" / "smoothed_force.c", place / "library.c")
    shutil.copy(EXAMPLES / "program" / "smoothed_force.c", place / "records.c")
    (place / "lines.c").write_text(LINES)
    (place / "lines.py").write_text(
        (place / "smoothed_force_records.py").read_text()
        .replace('"./smoothed_force"', '"./lines"').replace('protocol = "records"', "")
    )  # fmt: skip
    shared = (*GCC, "-shared", "-fPIC", "-o", "libsmoothed_force.so", "library.c")
    for command in (shared, (*GCC, "-o", "smoothed_force", "records.c", "-lm"),
                    (*GCC, "-o", "lines", "lines.c")):  # fmt: skip
        subprocess.run(command, cwd=place, check=True)
    return place


def _method(folder, file):
    return Source("file", f"{folder / file}:").make("", {})


@pytest.mark.parametrize("file", ["lines.py", "smoothed_force_records.py"])
def test_sample_over_pipes(benchmark, folder, file):
    method = _method(folder, file)
    method.reset({"mass": 1298.9}, 1e-3)
    samples = [{"accel_x": 0.1 * k, "time": 1e-3 * k} for k in range(SAMPLES)]

    def samples_one_by_one():
        for sample in samples:
            found = method.update(sample)
        return found

    found = benchmark(samples_one_by_one)
    benchmark.extra_info["steps"] = SAMPLES
    assert np.isfinite(found["force_x_front"])


def test_sample_of_a_library_in_one_loop(benchmark, folder):
    pytest.importorskip("cffi")
    method = _method(folder, "smoothed_force_c.py")
    observations = np.zeros(SAMPLES * 20, [("time", float), ("accel_x", float)])
    observations["time"] = 1e-3 * np.arange(len(observations))
    observations["accel_x"] = np.sin(observations["time"])
    found = benchmark(method.run, {"mass": 1298.9}, observations)
    benchmark.extra_info["steps"] = len(observations)
    assert np.isfinite(found["force_x_front"]).all()
