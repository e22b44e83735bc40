"""A forked child answers in its place."""

import os


class Forks:
    name = "forks"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            os.fork()
        return {"mu_front": 0.5}
