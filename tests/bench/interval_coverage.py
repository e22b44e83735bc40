"""Coverage of the interval of the pooled RMS, by simulation.

Printed by `python tests/bench/interval_coverage.py`.

Each line draws many sets of runs from a law of their mean squares, and counts how often the
interval holds the true RMS. The laws reach from runs that differ by noise alone to those in which
each run has a car of its own: squares of a normal error of a parameter (one degree of freedom),
and RMS values that spread by a factor e^0.5 to either side.
"""

import math

import numpy as np

from gripbench.bench.ranking.statistics import FEWEST_RUNS, pooled_rms_interval

LAWS = {
    "noise alone: chi-square, 30 degrees of freedom": (lambda g, n: g.chisquare(30, n), 30.0),
    "three causes: chi-square, 3": (lambda g, n: g.chisquare(3, n), 3.0),
    "one cause and noise: .05 + chi-square, 1": (lambda g, n: 0.05 + g.chisquare(1, n), 1.05),
    "one cause: chi-square, 1": (lambda g, n: g.chisquare(1, n), 1.0),
    "RMS lognormal, 28 %": (lambda g, n: np.exp(0.5 * g.normal(size=n)), math.exp(0.125)),
    "RMS lognormal, factor e^0.5": (lambda g, n: np.exp(g.normal(size=n)), math.exp(0.5)),
    "heavy tails: square of Student's t, 6": (lambda g, n: g.standard_t(6, n) ** 2, 1.5),
}
"""Law of the mean square of a run, and its mean."""


def coverage(draw, mean, runs, repetitions, seed=0, confidence=0.95):
    """Return the share of intervals that hold the true RMS, and the median ratio of their ends."""
    generator = np.random.default_rng(seed)
    held, ratios = 0, []
    for _ in range(repetitions):
        squares = draw(generator, runs)
        low, high = pooled_rms_interval(squares, np.ones(runs), confidence)
        held += low <= math.sqrt(mean) <= high
        ratios.append(high / low)
    return held / repetitions, float(np.median(ratios))


if __name__ == "__main__":
    print(f"interval of 95 %; none below {FEWEST_RUNS} runs; coverage, median of high over low")
    for name, (draw, mean) in LAWS.items():
        cells = []
        for runs in (10, 20, 50, 100):
            share, ratio = coverage(draw, mean, runs, 1000)
            cells.append(f"{runs}: {100 * share:.1f} % {ratio:.2f}")
        print(f"{name:50s}" + "   ".join(cells), flush=True)
