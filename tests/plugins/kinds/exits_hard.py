"""It ends its process."""

import os


class ExitsHard:
    name = "exits_hard"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            os._exit(0)
        return {"mu_front": 0.5}
