"""A child, in a session of its own, outlives it."""

import os
import time


class ForksAndLeaves:
    name = "forks_and_leaves"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            child = os.fork()
            if child == 0:
                os.setsid()
                time.sleep(1e6)
        return {"mu_front": 0.5}
