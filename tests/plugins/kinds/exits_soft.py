"""It asks to exit."""

import sys


class ExitsSoft:
    name = "exits_soft"
    sensors = ("accel_x",)
    estimates = ("mu_front",)

    def reset(self, vehicle, dt):
        self.samples = 0

    def update(self, obs):
        self.samples += 1
        if self.samples == 100:
            sys.exit(0)
        return {"mu_front": 0.5}
