"""It kills its own process."""

import os
import signal


class KillsItself:
    name = "kills_itself"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            os.kill(os.getpid(), signal.SIGKILL)
        return {"mu_front": 0.5}
