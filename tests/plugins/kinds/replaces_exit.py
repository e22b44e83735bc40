"""Replaces the way in which its process ends by one that never does."""

import os
import time


class ReplacesExit:
    name = "replaces_exit"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        os._exit = lambda code: time.sleep(1e6)

    def update(self, obs):
        return {"mu_front": 0.5}
