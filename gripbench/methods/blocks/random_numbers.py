"""A state of 64 bits in, random numbers out: a generator that lives in a method's record.

NumPy's generators cannot be kept in a record, and numba's own is one for the whole thread, so that
a method's numbers would depend on what ran before it.

References
----------
G. Marsaglia, Xorshift RNGs, Journal of Statistical Software 8 (2003); G. Box, M. Muller, A note on
the generation of random normal deviates, Annals of Mathematical Statistics 29 (1958).
"""

from __future__ import annotations

from math import cos, log, pi, sin, sqrt

import numpy as np

from gripbench.compilation import compiled

RANDOM_STATE = np.dtype(np.uint64)

_13, _7, _17, _11 = np.uint64(13), np.uint64(7), np.uint64(17), np.uint64(11)


@compiled
def advance(bits):
    """Return the next state; it must not be 0."""
    bits ^= bits << _13
    bits ^= bits >> _7
    bits ^= bits << _17
    return bits


@compiled
def uniform(bits):
    """Return the number of a state, above 0 and below 1."""
    return (float(bits >> _11) + 0.5) * 2.0**-53


@compiled
def two_normals(bits):
    """Return the next state and two independent standard normal numbers."""
    bits = advance(bits)
    radius = sqrt(-2.0 * log(uniform(bits)))
    bits = advance(bits)
    angle = 2.0 * pi * uniform(bits)
    return bits, radius * cos(angle), radius * sin(angle)
