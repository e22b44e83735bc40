"""A compiled step that reads behind the end of an array: a plausible figure, unless checked."""

import numpy as np

from gripbench import CompiledMethod, compiled

TABLE = np.array([0.1, 0.2, 0.3])


@compiled
def step(state, obs, params, est):
    state.samples += 1.0
    est.mu_front = 0.5 + 1e-300 * TABLE[3 + int(state.samples) % 2]


class ReadsOutOfBounds(CompiledMethod):
    name = "reads_out_of_bounds"
    title = "Reads out of bounds"
    reference = "none"
    sensors = ("accel_x",)
    estimates = ("mu_front",)
    state = np.dtype([("samples", float)])
    step = step
