"""Equations as Anderson & Bevly (2004) print them, in place of the corrected ones.

What is wrong with each stands at the corrected form, in `gripbench.methods.kinematic_kalman_filter`
and `gripbench.methods.model_based_kalman_filter`.
"""

from __future__ import annotations

from gripbench.compilation import compiled
from gripbench.methods.kinematic_kalman_filter import held_rate, walk_time
from gripbench.methods.model_based_kalman_filter import course_variance
from gripbench.methods.settings import Variant


@compiled
def older_rate(before, now):
    """Return the older reading: the forward Euler step of eq. 3."""
    return before


@compiled
def printed_walk_time(elapsed):
    """Return T^2, which eq. 4 prints for both states."""
    return elapsed * elapsed


@compiled
def printed_course_variance(P, variance):
    """Return the sum of three variances, eq. 8."""
    return P[0, 0] + P[2, 2] + variance


FORMS = {
    "kinematic_kalman_filter": {
        "paper": Variant(functions={held_rate: older_rate, walk_time: printed_walk_time})
    },
    "model_based_kalman_filter": {
        "paper": Variant(functions={course_variance: printed_course_variance})
    },
}
"""Variants with printed equations, by method."""
