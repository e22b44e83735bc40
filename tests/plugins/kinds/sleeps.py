"""It sleeps."""

import time


class Sleeps:
    name = "sleeps"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            time.sleep(1e6)
        return {"mu_front": 0.5}
