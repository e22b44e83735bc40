"""Twenty spoilt lines in, out those that no test notices: `python tests/mutants.py [WORD...]`.

Each line that matters is replaced in a temporary copy of the package, and the test file that
should notice runs against the copy. A mutant that survives is printed and makes exit code 1; a
line that is no longer in its file, or is there twice, is an error: the list has aged. Words choose
the mutants whose file contains one of them.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]


class Mutant(NamedTuple):
    """A spoilt line: file below `gripbench/`, its text, what it becomes, the tests that fail."""

    file: str
    old: str
    new: str
    tests: str


MUTANTS = (
    Mutant(
        "envs/instruments/suite.py",
        "sensor.scale + sensor.scale_std * constant[1]",
        "sensor.scale + sensor.scale_std * constant[0]",
        "tests/envs/test_sensors.py",
    ),
    Mutant(
        "envs/instruments/measuring.py",
        "spec.walk * np.sqrt(elapsed) * walk[j]",
        "spec.walk * elapsed * walk[j]",
        "tests/envs/test_sensors.py",
    ),
    Mutant(
        "envs/signals.py",
        "return angle - 2.0 * math.pi * turns",
        "return angle - 1.0 * math.pi * turns",
        "tests/envs/test_signals.py",
    ),
    Mutant(
        "envs/tyres/longitudinal.py",
        "return sin(angle), cos(angle) * shape * inner_slope / (1.0 + inner * inner)",
        "return sin(angle), cos(angle) * inner_slope / (1.0 + inner * inner)",
        "tests/envs/test_tyres.py",
    ),
    Mutant(
        "envs/tyres/longitudinal.py",
        "max(abs(rolling_speed), abs(speed), CRAWL_SPEED)",
        "max(abs(speed), CRAWL_SPEED)",
        "tests/envs/test_tyres.py",
    ),
    Mutant(
        "logs/channels/series.py",
        'return wrapped(converted) if name == "course" and not target else converted',
        "return converted",
        "tests/logs",
    ),
    Mutant(
        "logs/importing.py",
        'truth[name] = wrapped(between) if name == "course" else between',
        "truth[name] = between",
        "tests/logs/test_importing.py",
    ),
    Mutant(
        "methods/blocks/kalman.py",
        "total += W[i, k] * F[j, k]",
        "total += W[i, k] * F[k, j]",
        "tests/methods/test_kalman.py",
    ),
    Mutant(
        "methods/dugoff_ekf.py",
        "- 2.0 * x[1] * forward * P[0, 1]",
        "+ 2.0 * x[1] * forward * P[0, 1]",
        "tests/methods/test_dugoff_ekf.py",
    ),
    Mutant(
        "methods/heading_ekf.py",
        "f.P[0, 1] = by_roll * params.roll_std**2",
        "f.P[0, 1] = 0.0",
        "tests/methods/test_heading_ekf.py",
    ),
    Mutant(
        "methods/kinematic_kalman_filter.py",
        "state.course_innovation = wrapped(obs.course - (x[0] - turned))",
        "state.course_innovation = obs.course - (x[0] - turned)",
        "tests/methods/test_kinematic_kalman_filter.py",
    ),
    Mutant(
        "methods/model_based_kalman_filter.py",
        "state.course_innovation = wrapped(obs.course - (x[0] + x[2] - turned))",
        "state.course_innovation = obs.course - (x[0] + x[2] - turned)",
        "tests/methods/test_model_based_kalman_filter.py",
    ),
    Mutant(
        "methods/model_based_kalman_filter.py",
        "return P[0, 0] + P[2, 2] + variance + 2.0 * P[0, 2]",
        "return P[0, 0] + P[2, 2] + variance",
        "tests/methods/test_model_based_kalman_filter.py",
    ),
    Mutant(
        "bench/ranking/statistics.py",
        "np.maximum(spread, 0.0) * runs / (runs - 1.0)",
        "np.maximum(spread, 0.0)",
        "tests/bench/test_statistics.py",
    ),
    Mutant(
        "bench/ranking/statistics.py",
        "factors = np.arange(len(flat), 0, -1)",
        "factors = np.arange(len(flat) - 1, -1, -1)",
        "tests/bench/test_statistics.py",
    ),
    Mutant(
        "bench/running/fingerprints.py",
        "digest(scenario_digest(scenario), scoring_digest(), *([secret] if secret else []))",
        "digest(scenario_digest(scenario), *([secret] if secret else []))",
        "tests/bench/test_keys.py",
    ),
    Mutant(
        "bench/running/cells.py",
        "repr(sorted(versions().items())), method.digest, str(seed), *learned)",
        "repr(sorted(versions().items())), str(seed), *learned)",
        "tests/bench/test_keys.py",
    ),
    Mutant(
        "bench/catalogue/registry.py",
        "declaration.variant, repr(settings))",
        "declaration.variant)",
        "tests/bench/test_keys.py",
    ),
    Mutant(
        "bench/scoring/scoring.py",
        "estimate = on_branch(name, estimates[name][counted], true)",
        "estimate = estimates[name][counted]",
        "tests/bench/test_scoring.py",
    ),
    Mutant(
        "bench/scoring/distributions.py",
        "(np.abs(self.error) <= _normal_quantile(0.5 + level / 2.0) * self.deviation) * 1.0",
        "(np.abs(self.error) <= _normal_quantile(level) * self.deviation) * 1.0",
        "tests/bench/test_distributions.py",
    ),
)


def survivors(mutants: Iterable[Mutant]) -> Iterator[Mutant]:
    """Yield the mutants that their tests do not notice.

    Raises
    ------
    ValueError
        If the text of one is not in its file exactly once.
    """
    chosen = list(mutants)
    for mutant in chosen:
        found = (ROOT / "gripbench" / mutant.file).read_text(encoding="utf-8").count(mutant.old)
        if found != 1:
            raise ValueError(f"gripbench/{mutant.file} has {found} times: {mutant.old}")
    with tempfile.TemporaryDirectory() as scratch:
        copy = Path(scratch)
        for name in ("gripbench", "tests"):  # compiled functions travel along: they go by content
            shutil.copytree(ROOT / name, copy / name)
        shutil.copy(ROOT / "pyproject.toml", copy)
        for mutant in chosen:
            path = copy / "gripbench" / mutant.file
            whole = path.read_text(encoding="utf-8")
            path.write_text(whole.replace(mutant.old, mutant.new), encoding="utf-8")
            if _passes(copy, mutant.tests):
                yield mutant
            path.write_text(whole, encoding="utf-8")


def _passes(copy: Path, tests: str) -> bool:
    """Return whether tests pass on a copy of the package; it is an error if none ran."""
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", tests],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode not in (0, 1):
        raise ValueError(f"{tests}: {done.stdout[-500:]}{done.stderr[-500:]}")
    return done.returncode == 0


def main(words: list[str]) -> int:
    """Run the mutants whose file contains one of the words, all without words."""
    chosen = [one for one in MUTANTS if not words or any(word in one.file for word in words)]
    alive = 0
    for mutant in survivors(chosen):
        alive += 1
        print(f"survives {mutant.tests}: gripbench/{mutant.file}: {mutant.new}", flush=True)
    print(f"{len(chosen) - alive} of {len(chosen)} mutants were noticed")
    return 1 if alive else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
