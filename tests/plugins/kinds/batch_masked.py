"""Its batch form returns masked values."""

import numpy as np


class BatchMasked:
    name = "batch_masked"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        pass

    def update(self, obs):
        return {"mu_front": 0.5}

    def run(self, vehicle, observations):
        return np.ma.masked_all(len(observations), [("mu_front", float)])
