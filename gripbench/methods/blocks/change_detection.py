"""Normalised innovations in, whether what they are of has changed out: cumulated sums.

Page (1954), Continuous inspection schemes, Biometrika 41, in the two-sided form of Gustafsson
(1997), Automatica 33, section 4.
"""

from __future__ import annotations

from math import exp

import numpy as np

from gripbench.compilation import compiled
from gripbench.methods.settings import Parameter

CHANGE_STATE = np.dtype([("rise", np.float64), ("fall", np.float64)])

CHANGE_PARAMETERS = (
    Parameter("drift", 0.5, "-", "Innovation that counts as none", 0.0, 5.0),
    Parameter("threshold", 5.0, "-", "Cumulated innovation that is a change", 0.5, 100.0),
)
"""Parameters of the detector."""


@compiled
def has_changed(state, innovation, params):
    """Cumulate a normalised innovation to both sides; return whether there was a change."""
    state.rise = max(0.0, state.rise + innovation - params.drift)
    state.fall = max(0.0, state.fall - innovation - params.drift)
    if max(state.rise, state.fall) <= params.threshold:
        return False
    state.rise = state.fall = 0.0
    return True


@compiled
def chance_of_change(state, odds, params):
    """Return the probability that there was a change which is not found yet.

    A sum grows by the log-likelihood ratio of a shift of twice the drift, over that shift; at the
    threshold the odds are even.

    Parameters
    ----------
    odds
        Odds without any evidence.
    """
    evidence = max(state.rise, state.fall) - params.threshold
    odds += exp(2.0 * params.drift * evidence)
    return odds / (1.0 + odds)
