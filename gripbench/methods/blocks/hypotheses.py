"""Interacting multiple models: filters under several hypotheses in, their mixture out.

Blom & Bar-Shalom (1988), The interacting multiple model algorithm for systems with Markovian
switching coefficients, IEEE Transactions on Automatic Control 33, as in Bar-Shalom, Li &
Kirubarajan, Estimation with Applications to Tracking and Navigation, 11.6.6. The chain leaves a
hypothesis at one rate and comes to the others by their prior weights, so that without information
the weights return to the prior.
"""

from __future__ import annotations

from math import exp, log

import numpy as np

from gripbench.compilation import compiled

LEAST_WEIGHT = 1e-9


def bank_type(hypotheses: int, states: int) -> np.dtype:
    """Return the structured type of a bank of filters under `hypotheses` hypotheses."""
    k, n = hypotheses, states
    return np.dtype(
        [
            ("x", np.float64, (k, n)),
            ("P", np.float64, (k, n, n)),
            ("weight", np.float64, (k,)),
            ("prior", np.float64, (k,)),
            ("score", np.float64, (k,)),  # logarithm of the likelihood of the step
            ("mixed_x", np.float64, (k, n)),
            ("mixed_P", np.float64, (k, n, n)),
            ("share", np.float64, (k, k)),  # of hypothesis i in what j starts from
        ]
    )


@compiled
def mix(bank, leaving, copied):
    """Start a step: predicted weights, and for each hypothesis the mixture that leads to it.

    Parameters
    ----------
    bank
        Record of `bank_type`.
    leaving
        Probability that the hypothesis changes in this step.
    copied
        Share of these changes that bring their state along; 1 is the algorithm of Blom &
        Bar-Shalom. A hypothesis of small weight is mostly what has come to it: with 1 it has the
        state and the spread of the one that wins, is unlikely for that alone, and never comes
        back.
    """
    k, n = bank.x.shape
    x, P = bank.x, bank.P
    for j in range(k):
        total, flow = 0.0, 0.0
        for i in range(k):
            come = leaving * bank.prior[j] * bank.weight[i]
            stay = (1.0 - leaving) * bank.weight[i] if i == j else 0.0
            bank.share[i, j] = copied * come + stay
            flow += come + stay
            total += bank.share[i, j]
        bank.score[j] = flow
        for i in range(k):
            bank.share[i, j] /= total
        for a in range(n):
            mean = 0.0
            for i in range(k):
                mean += bank.share[i, j] * x[i, a]
            bank.mixed_x[j, a] = mean
        for a in range(n):
            for b in range(a, n):
                total = 0.0
                for i in range(k):
                    if bank.share[i, j] > LEAST_WEIGHT:
                        da = x[i, a] - bank.mixed_x[j, a]
                        db = x[i, b] - bank.mixed_x[j, b]
                        total += bank.share[i, j] * (P[i, a, b] + da * db)
                bank.mixed_P[j, a, b] = total
                bank.mixed_P[j, b, a] = total
    for j in range(k):
        bank.weight[j] = bank.score[j]
        bank.score[j] = 0.0


@compiled
def take(bank, j, filter):
    """Copy what hypothesis `j` starts from into a filter."""
    n = filter.x.shape[0]
    for a in range(n):
        filter.x[a] = bank.mixed_x[j, a]
        for b in range(n):
            filter.P[a, b] = bank.mixed_P[j, a, b]


@compiled
def put(bank, j, filter):
    """Copy a filter back as hypothesis `j`."""
    n = filter.x.shape[0]
    for a in range(n):
        bank.x[j, a] = filter.x[a]
        for b in range(n):
            bank.P[j, a, b] = filter.P[a, b]


@compiled
def score_of(distance, variance):
    """Return the logarithm of a Gaussian likelihood, less its constant.

    Parameters
    ----------
    distance
        Innovation squared over its variance.
    variance
        Variance of the innovation.
    """
    return -0.5 * (distance + log(variance))


@compiled
def weigh(bank):
    """End a step: weights by the likelihoods in `score`."""
    k = bank.weight.shape[0]
    best = -np.inf
    for j in range(k):
        best = max(best, bank.score[j])
    if not best > -np.inf:
        return
    total = 0.0
    for j in range(k):
        bank.weight[j] = max(bank.weight[j] * exp(bank.score[j] - best), LEAST_WEIGHT)
        total += bank.weight[j]
    for j in range(k):
        bank.weight[j] /= total


@compiled
def moments(bank, a):
    """Return mean and variance of state `a` over the mixture."""
    mean, square = 0.0, 0.0
    for j in range(bank.weight.shape[0]):
        mean += bank.weight[j] * bank.x[j, a]
    for j in range(bank.weight.shape[0]):
        away = bank.x[j, a] - mean
        square += bank.weight[j] * (bank.P[j, a, a] + away * away)
    return mean, square
