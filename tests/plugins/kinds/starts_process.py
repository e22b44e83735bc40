"""A process of its own session outlives it."""

import subprocess


class StartsProcess:
    name = "starts_process"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            subprocess.Popen(["sleep", "98765"], start_new_session=True)
        return {"mu_front": 0.5}
