"""Force of the acceleration: the accelerometer in, m a_x shared by the static axle loads out."""

from __future__ import annotations

import numpy as np

from gripbench.methods.contract import CompiledMethod, compiled


@compiled
def _step(state, obs, params, est):
    if obs.accel_x == obs.accel_x:
        state.accel_x = obs.accel_x
    force = params.mass * state.accel_x / (params.cg_to_front + params.cg_to_rear)
    est.force_x_front = params.cg_to_rear * force
    est.force_x_rear = params.cg_to_front * force


class ForceOfAcceleration(CompiledMethod):
    """Axle forces by Newton's law and the static loads."""

    name = "force_of_acceleration"
    title = "m a_x by static loads"
    reference = "Baseline; Newton's second law"
    baseline = True
    sensors = ("accel_x",)
    estimates = ("force_x_front", "force_x_rear")
    vehicle_parameters = ("mass", "cg_to_front", "cg_to_rear")
    state = np.dtype([("accel_x", np.float64)])
    step = staticmethod(_step)
