"""A segmentation fault."""

import ctypes


class Crashes:
    name = "crashes"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            ctypes.string_at(0)
        return {"mu_front": 0.5}
