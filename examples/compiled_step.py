"""A compiled step: front force from the torque balance of the front wheels.

gripbench check examples/compiled_step.py
gripbench run --suite longitudinal --seeds 20 --method examples/compiled_step.py
"""

import numpy as np

from gripbench import CompiledMethod, Parameter, compiled


@compiled
def step(state, obs, params, est):
    """F = (T - J dw/dt) / R, the wheel's acceleration differenced behind a low-pass."""
    if state.samples == 0.0:
        state.filtered = obs.wheel_speed_front
    elapsed = obs.time - state.time if state.samples > 0.0 else 0.0
    state.time = obs.time
    state.samples += 1.0
    acceleration = 0.0
    if elapsed > 0.0:
        gap = obs.wheel_speed_front - state.filtered
        acceleration = gap / (params.time_constant + elapsed)
        state.filtered += elapsed * acceleration
    torque = obs.torque_front - params.wheel_inertia * acceleration
    est.force_x_front = torque / params.wheel_radius


class TorqueBalance(CompiledMethod):
    """Front force from torque and wheel speed."""

    name = "torque_balance"
    title = "Torque balance"
    reference = "Balance of angular momentum of a wheel"
    sensors = ("wheel_speed_front", "torque_front")
    estimates = ("force_x_front",)
    vehicle_parameters = ("wheel_radius", "wheel_inertia")
    parameters = (Parameter("time_constant", 0.05, "s", "Time constant of the low-pass", 1e-4),)
    state = np.dtype([("time", float), ("samples", float), ("filtered", float)])
    step = staticmethod(step)
