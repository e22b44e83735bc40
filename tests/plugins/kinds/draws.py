"""It draws from the global generators."""

import random

import numpy as np


class Draws:
    name = "draws"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        pass

    def update(self, obs):
        return {"mu_front": 0.5 + 0.1 * random.random() + 0.1 * np.random.random()}
