"""It closes all descriptors."""

import os


class ClosesEverything:
    name = "closes_everything"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            os.closerange(0, 256)
        return {"mu_front": 0.5}
