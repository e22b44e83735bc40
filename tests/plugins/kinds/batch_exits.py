"""Its batch form ends the process."""

import os


class BatchExits:
    name = "batch_exits"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        pass

    def update(self, obs):
        return {"mu_front": 0.5}

    def run(self, vehicle, observations):
        os._exit(0)
