"""Course as heading: the GPS course in, the same angle out; with a gyroscope, its integral.

A vehicle without sideslip points where it moves. The variant `gyroscope` adds the integral of the
yaw rate to the first course instead.
"""

from __future__ import annotations

import numpy as np

from gripbench.methods.blocks.course_history import wrapped
from gripbench.methods.contract import CompiledMethod, Variant, compiled


@compiled
def _step(state, obs, params, est):
    if obs.course == obs.course:
        state.yaw = obs.course
    est.yaw = state.yaw


@compiled
def _step_gyroscope(state, obs, params, est):
    if state.located == 0.0 and obs.course == obs.course:
        state.located, state.yaw = 1.0, obs.course
    else:
        state.yaw = wrapped(state.yaw + state.rate * obs.elapsed)
    if obs.yaw_rate == obs.yaw_rate:
        state.rate = obs.yaw_rate
    est.yaw = state.yaw


class CourseAsHeading(CompiledMethod):
    """The last GPS course as the heading."""

    name = "course_as_heading"
    title = "Course as heading"
    reference = "Baseline"
    baseline = True
    sensors = ("course",)
    estimates = ("yaw",)
    variants = {"gyroscope": Variant(sensors=("course", "yaw_rate"), step=_step_gyroscope)}
    state = np.dtype([(name, np.float64) for name in ("yaw", "rate", "located")])
    step = staticmethod(_step)
