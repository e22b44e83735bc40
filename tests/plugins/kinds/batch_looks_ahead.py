"""Its batch form takes the mean of the whole recording."""

import numpy as np


class BatchLooksAhead:
    name = "batch_looks_ahead"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        pass

    def update(self, obs):
        return {"mu_front": 0.5}

    def run(self, vehicle, observations):
        estimates = np.zeros(len(observations), [("mu_front", float)])
        estimates["mu_front"] = observations["accel_x"].mean()
        return estimates
