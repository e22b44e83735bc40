"""How often a consistent filter lies within the band of its NEES, by simulation.

Printed by `python tests/bench/nees_coverage.py`. First the runs' mean squares are drawn from laws
of mean one, then from normal errors that are correlated in time: a filter that states the right
variance, and errors whose memory reaches from one sample to the whole run.
"""

import numpy as np

from gripbench.bench.scoring.consistency import runs_test

LAWS = {
    "noise alone: chi-square, 30 degrees of freedom": lambda g, n: g.chisquare(30, n) / 30.0,
    "three causes: chi-square, 3": lambda g, n: g.chisquare(3, n) / 3.0,
    "one cause and noise: .05 + chi-square, 1": lambda g, n: (0.05 + g.chisquare(1, n)) / 1.05,
    "one cause: chi-square, 1": lambda g, n: g.chisquare(1, n),
    "heavy tails: square of Student's t, 6": lambda g, n: g.standard_t(6, n) ** 2 / 1.5,
    "RMS lognormal, factor e^0.5": lambda g, n: np.exp(g.normal(size=n)) / np.exp(0.5),
    "memory of 1 sample in 200": lambda g, n: correlated(g, n, 0.0),
    "memory of 20 samples in 200": lambda g, n: correlated(g, n, np.exp(-1.0 / 20.0)),
    "memory of 2000 samples in 200": lambda g, n: correlated(g, n, np.exp(-1.0 / 2000.0)),
}
"""Mean squares of n runs of a consistent filter."""


def correlated(generator, runs, memory, samples=200):
    """Return the mean squares of runs whose errors are normal, of variance 1, with a memory."""
    from scipy.signal import lfilter

    noise = generator.normal(size=(runs, samples))
    noise[:, 1:] *= np.sqrt(1.0 - memory**2)
    return np.mean(lfilter([1.0], [1.0, -memory], noise, axis=1) ** 2, axis=1)


def held(draw, runs, repetitions, seed=0, factor=1.0):
    """Return the share of tests in which a filter whose variance is off by a factor passes."""
    generator = np.random.default_rng(seed)
    passes = 0
    for _ in range(repetitions):
        test = runs_test(factor * draw(generator, runs), np.ones(runs))
        passes += test.low <= test.mean <= test.high
    return passes / repetitions


if __name__ == "__main__":
    print("share of consistent filters within the band of 95 %; in brackets: NEES 2, NEES 1/2")
    for name, draw in LAWS.items():
        cells = [
            f"{runs}: {100 * held(draw, runs, 2000):.1f} % "
            f"({100 * held(draw, runs, 500, factor=2.0):.0f}, "
            f"{100 * held(draw, runs, 500, factor=0.5):.0f})"
            for runs in (2, 5, 10, 20, 100)
        ]
        print(f"{name:50s}" + "   ".join(cells), flush=True)
