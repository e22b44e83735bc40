"""Its batch form returns texts."""

import numpy as np


class BatchOfTexts:
    name = "batch_of_texts"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        pass

    def update(self, obs):
        return {"mu_front": 0.5}

    def run(self, vehicle, observations):
        return np.full(len(observations), "0.5", [("mu_front", "U3")])
